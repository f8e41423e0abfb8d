"""The true server for tests of the page, round a robot without physics and a planner that answers at once.

    python -m tests.ar.session.page_server [--light]

prints `ready PORT TOKEN` and serves until its input ends. A line on its input is a fault to be shown: `silent` and
`speak` (the robot tells nothing new), `drop` and `listen` (all connections end, and none is taken until then), `fault`
(the robot reports one); `doubtful` and `sure`: how a grasp is foreseen; `cameras` and `blind`: they see the arm, and
their stream is not sound any more; `code` renews the pairing code. The modes that
there were, and what else the server logged, come back as a line of JSON. With `--light` meshes have few triangles. It
is patient with clients that draw by software beside other work: PATIENCE.
"""

import asyncio
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
from aiohttp import web
from aiohttp.test_utils import unused_port
from trimesh.creation import icosphere

from tests.ar.hybrid.conftest import SIZE, rubbing_arm
from tests.ar.teleop.test_plan import LIMITS, NETWORK, OFFSET, RADIUS, STRAIGHT, arc
from tests.support.operator import PACKAGE, READY_JOINTS, config
from trunkline.ar.hybrid.compose import compose, panda_joints
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import controller as control
from trunkline.ar.session import lease, messages
from trunkline.ar.session import scene as pictured
from trunkline.ar.session.anchors import Anchors
from trunkline.ar.session.arm_cameras import MeasuredArm
from trunkline.ar.session.auth import Origins, make_token
from trunkline.ar.session.bodies import drawn_bodies
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.correction_steps import CorrectionAnswer, CorrectionOrder
from trunkline.ar.session.log_format import Subject
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.previewer import (
    Answer,
    AnyOrder,
    FollowAnswer,
    FollowRequest,
    InlinePreviewer,
    PlanAnswer,
    PredictionAnswer,
    PreviewBegun,
    PreviewPiece,
)
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.session.server import Composition, Server
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.following import Following, sought
from trunkline.ar.teleop.messages import ExecutorReport, Obstacle, PlanReport, Targets, WorldObject
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.reach_message import Reading
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.vectors import add, conjugate, distance, rotate, scale, subtract
from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.model.arm.spiral import spiral_chain
from trunkline.pipeline.config import PROJECT, load_folder

RATE, LENGTH, UNITS = 72.0, 0.5, 24  # Hz, m
TICK = 0.005  # s
PATIENCE = 5.0  # s for which a client may be silent
CENTRE, REACH = (0.0, 0.0, 0.333), 0.85  # m, of the ball in which the mount can be
AROUND, ALONG = 32, 10
CERTIFICATE = b"""<!doctype html><title>Certificate</title><style>p { color: green }</style><p>of the twin</p>
<script type="module">fetch("/").catch(() => document.title = "Replay, no requests");</script>"""
OFF = np.array([0.006, 0.004, 0.002])  # m
TABLE = Obstacle("the table", (0.35, -0.5, -0.05), (0.95, 0.5, -0.02))
CUP = WorldObject("the cup", "cylinder", 0.05, 0.12, 0.1, (0.65, 0.3, 0.04), support="standing")


class Balls:
    """Reach: of the mount a ball about the shoulder, of the tip one about the mount."""

    def rigid(self, mount, pointing) -> Reading:
        return _in_ball(mount, CENTRE, REACH)

    def soft(self, tip, gravity) -> Reading:
        return _in_ball(tip, (0.0, 0.0, 0.0), 1.1 * LENGTH)


def _in_ball(point, centre, radius) -> Reading:
    away = distance(point, centre)
    if away <= radius:
        return Reading("inside")
    return Reading("outside", away - radius, add(centre, scale(subtract(point, centre), 0.98 * radius / away)))


class Bowl:
    """Where the tip can be, the same under any gravity, in place of `scene.Shells`."""

    def at(self, down) -> np.ndarray:
        angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)[:, None]
        polar = np.linspace(0.02, 2.0, ALONG)[None]
        side = np.sin(polar)
        points = [side * np.cos(angle), side * np.sin(angle), -np.cos(polar) + 0 * angle]
        return 0.8 * LENGTH * np.stack(points, axis=-1).reshape(-1, 3)


class Figure:
    """The hybrid robot as it is drawn, its arm of constant curvature."""

    def __init__(self) -> None:
        robot = PandaRobot("panda", OFFSET, 1.5, 0.0, list(READY_JOINTS))
        self.model = compose(rubbing_arm(spiral_chain(**SIZE), 8), robot).compile()
        self.data, self.bodies = mujoco.MjData(self.model), drawn_bodies(self.model)
        self.ids = [self.model.body(name).id for name in self.bodies]
        self.rigid = self.model.jnt_qposadr[panda_joints(self.model)]
        units = [self.model.body(f"unit_{number:02d}") for number in range(1, UNITS + 1)]
        self.soft = [self.model.jnt_qposadr[unit.jntadr[0]] for unit in units]

    def poses(self, joints: np.ndarray, commands: np.ndarray) -> np.ndarray:
        """Of all that is drawn. Shape (B, 7)."""
        self.data.qpos[self.rigid] = joints
        self.data.qpos[self.soft] = -(STRAIGHT[0] - commands[0]) / RADIUS / UNITS
        mujoco.mj_kinematics(self.model, self.data)
        return np.column_stack([self.data.xpos[self.ids], self.data.xquat[self.ids]])


class Robot:
    """Where its plan says, in real time."""

    def __init__(self, figure: Figure) -> None:
        self.figure, self.robot = figure, PlanFollower(np.array(READY_JOINTS), STRAIGHT, LIMITS, PACKAGE)
        self.start, self.stop, self.hear = self.robot.start, self.robot.stop, self.robot.hear
        self.last, self.fault = time.monotonic(), ""
        self.frozen: RobotState | None = None
        self.is_silent = False

    def permit(self, waits: bool = False) -> None:
        self.robot.waits = waits

    def follow(self, following: Following) -> str:
        return self.robot.follow(following, TICK)

    def state(self) -> ExecutorReport:
        return ExecutorReport("fault", "", self.fault) if self.fault else self.robot.state()

    def robot_state(self) -> RobotState:
        if self.is_silent and self.frozen is not None:
            return self.frozen
        now = time.monotonic()
        while self.last + TICK <= now:
            self.robot.advance(TICK)
            self.last += TICK
        poses = self.figure.poses(self.robot.joints, self.robot.commands)
        self.frozen = RobotState(now, 0.0, self.robot.joints, self.robot.commands, np.full(7, np.nan), poses)
        return self.frozen


def within(targets: Targets) -> Targets:
    """With the tip where the plain arm can have it: it has one bend, and a test points by pixels."""
    turn = base_quaternion(targets.pointing, targets.heading)
    x, _, z = rotate(conjugate(turn), subtract(targets.tip.position, targets.rigid.position))
    places = arc(np.linspace(-2.5, 2.5, 501))
    nearest = places[np.argmin(np.hypot(places[:, 0] - x, places[:, 2] - z))]
    tip = add(targets.rigid.position, rotate(turn, tuple(map(float, nearest))))
    return replace(targets, tip=replace(targets.tip, position=tip))


class Cameras:
    """They see every fourth body of the arm, OFF from where it is drawn."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.fault = robot, ""
        self.rows = [0, *range(3, UNITS, 4)]

    def show(self, bodies: np.ndarray) -> None:
        first = self.robot.figure.bodies.index("unit_01")
        self.poses = bodies[[first + row for row in self.rows]] + np.pad(OFF, (0, 4))

    def latest(self) -> MeasuredArm:
        return MeasuredArm(time.monotonic(), self.poses, self.poses[-1, :3], 0.01, 120.0, 0.0, self.fault, None)


class Planning:
    """Plans at once; its previews are the plan itself."""

    def __init__(self, figure: Figure) -> None:
        self.figure = figure
        self.probability = 0.84
        self.planner = Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET, step=0.005)

    def answers(self, order: AnyOrder) -> Iterator[Answer]:
        if isinstance(order, FollowRequest):
            targets = order.targets and within(order.targets)
            yield FollowAnswer(order.serial, *sought(self.planner, targets, order.joints, order.world))
            return
        if isinstance(order, CorrectionOrder):
            yield CorrectionAnswer(order.serial, order.number, None, "no motor brings the tip nearer")
            return
        serial = order.request.serial
        try:
            request = replace(order.request, targets=within(order.request.targets))
            plan = self.planner.plan(request, order.world, order.joints, order.commands)
        except InputError as error:
            yield PlanAnswer(PlanReport(serial, refused=str(error)))
            return
        plan = replace(plan, correction=order.correction)
        digest, step = plan.digest(), 1 / RATE
        times = np.arange(0.0, plan.duration, step)
        poses = np.array([self.figure.poses(*plan.at(time)) for time in times], dtype=np.float32)
        tips, shares = poses[::9, -1, :3].astype(float), np.linspace(0, 1, len(times[::9]))
        yield PlanAnswer(PlanReport(serial, digest, "", plan.package, plan.world), plan)
        phases = tuple((name, plan.step * row) for name, row in plan.phases)
        preview = messages.PreviewMessage(
            digest, step, float(times[-1]), 0.0, phases, plan.correction, order.uncorrected
        )
        yield PreviewBegun(serial, preview)
        for first in range(0, len(times), 18):
            piece = poses[first : first + 18]
            yield PreviewPiece(serial, first, float(times[first]), piece, first + 18 >= len(times))
        spread = tuple(float(share) for share in 0.004 + 0.018 * shares)
        path = tuple(tuple(map(float, tip)) for tip in tips)
        prediction = messages.PredictionMessage(
            digest, self.probability, 0.68, 0.93, tuple(map(float, times[::9])), path, spread, 0.9, 32
        )
        yield PredictionAnswer(serial, prediction)


def drawing(figure: Figure) -> dict:
    """As /scene.json has it."""
    maps = {"rigid": np.ones((4, 4, 4)), "rigid_origin": np.zeros(3), "rigid_spacing": np.array(0.1)}
    ball = icosphere(subdivisions=3, radius=REACH).apply_translation(CENTRE)
    reach = {"vertices": ball.vertices.ravel().tolist(), "faces": ball.faces.ravel().tolist()}
    scene = pictured.scene(figure.model, figure.bodies, maps, LENGTH)
    return scene | {"reach": reach, "shell": {"around": AROUND, "along": ALONG}}


async def listen(runner: web.AppRunner, port: int) -> web.TCPSite:
    site = web.TCPSite(runner, "127.0.0.1", port)
    await site.start()
    return site


async def obey(
    server: Server, robot: Robot, cameras: Cameras, planning: Planning, runner: web.AppRunner, port: int, log: list[str]
) -> None:
    """Lines of the input, until it ends; the log goes out for each."""
    loop = asyncio.get_running_loop()
    site = await listen(runner, port)
    print(f"ready {port} {server.composition.token}", flush=True)
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        word = line.strip()
        robot.is_silent = word == "silent" or (robot.is_silent and word != "speak")
        robot.fault = {"fault": "joint 4: torque", "well": ""}.get(word, robot.fault)
        planning.probability = {"doubtful": 0.4, "sure": 0.84}.get(word, planning.probability)
        if word == "cameras":
            server.controller.cameras = cameras
        cameras.fault = "found no frame for 0.20 s" if word == "blind" else cameras.fault
        if word == "drop":
            await site.stop()
            for client in list(server.clients.values()):
                await client.socket.close()
        if word == "listen":
            site = await listen(runner, port)
        if word == "code":
            log.append(f"code {server.code.renew(time.monotonic())}")
        print(json.dumps(log), flush=True)


async def serve(port: int, folder: Path) -> None:
    lease.LEASE_TIMEOUT = control.UNDRAWN = PATIENCE
    figure, token, log = Figure(), make_token(), []
    robot, planning = Robot(figure), Planning(figure)
    core = config().core
    safety = replace(core.safety, silence=PATIENCE, plan_wait=PATIENCE, start_wait=PATIENCE)
    settings = replace(core, delay=0.3, safety=safety)
    core = Teleoperation(settings, Balls(), PACKAGE, OFFSET)
    subject = Subject(figure.bodies, (), (), STRAIGHT, (figure.bodies[-1], (0.0, 0.0, 0.0)))
    world, previewer = make_world((TABLE,), (CUP,)), InlinePreviewer(planning.answers)
    controller = SessionController(core, robot, previewer, world, 0.1, LogWriter(subject))
    page, origins = PROJECT / "trunkline/ar/page", Origins.of(["127.0.0.1"], port, tls=False)
    alignment = load_folder(SessionConfig, PROJECT / "conf/live").alignment
    anchors = Anchors(folder / "anchors.json")
    server = Server(Composition(
        controller, token, origins, PACKAGE, drawing(figure), Bowl(), RATE, page, log.append, alignment, anchors,
        CERTIFICATE,
    ))  # fmt: skip
    tick = server.tick

    def watched(now: float, dt: float) -> None:
        before = controller.intent.mode if controller.intent else ""
        tick(now, dt)
        if controller.intent.mode != before:
            log.append(f"mode {controller.intent.mode}")

    server.tick = watched
    runner = web.AppRunner(server.app())
    await runner.setup()
    await obey(server, robot, Cameras(robot), planning, runner, port, log)
    await runner.cleanup()


if __name__ == "__main__":
    if sys.argv[1:] == ["--light"]:
        pictured.MOST_TRIANGLES = 2000
    with TemporaryDirectory() as folder:
        asyncio.run(serve(unused_port(), Path(folder)))
