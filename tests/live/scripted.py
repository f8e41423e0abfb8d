"""A small server for tests of the page: the true wire and the true core, and a robot that does what it is told at once.

    python -m tests.live.scripted PORT

prints `ready` and serves until its input ends. Plans are straight ways in joint space, reach is two balls, previews
have no physics. Lines on its input are faults to be shown: `silent`, `drop`, `fault`. What is not in here is the real
server's: leases of several, clocks, access.
"""

import asyncio
import sys
import time
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from aiohttp import WSMsgType, web
from trimesh.creation import icosphere

from tests.hybrid.conftest import SIZE, rubbing_arm
from trunkline.arm.spiral import spiral_chain
from trunkline.errors import InputError
from trunkline.hybrid.compose import compose, panda_joints
from trunkline.hybrid.robots import PandaRobot
from trunkline.live import talk, wire
from trunkline.live.scene import drawn
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.teleop import messages
from trunkline.teleop.alignment import base_quaternion
from trunkline.teleop.config import Config
from trunkline.teleop.core import Teleoperation
from trunkline.teleop.reading import Reading
from trunkline.teleop.rigid_ik import RigidIK
from trunkline.teleop.vectors import add, distance, scale, subtract

TOKEN, CODE, PACKAGE = "0123456789abcdef0123456789abcdef", "123456", "f" * 64
RATE, STEP, DURATION = 72.0, 1 / 72, 2.0  # Hz, s, s of a plan
READY = [0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8]
CENTRE, REACH, LENGTH = (0.0, 0.0, 0.333), 0.85, 0.5  # m, of both balls
AROUND, ALONG = 32, 10  # points of the tip's reach
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none'; "
    "frame-ancestors 'none'"
)
WORLD = messages.World(
    "world",
    (messages.Box("table", (0.35, -0.5, -0.05), (0.95, 0.5, -0.02)),),
    (messages.Thing("cup", "cylinder", 0.05, 0.12, 0.1, (0.62, 0.22, 0.04), support="standing"),),
)


class Balls:
    """Both targets' reach as balls: of the mount about the shoulder, of the tip about the mount."""

    def rigid(self, mount, pointing) -> Reading:
        return _of_ball(mount, CENTRE, REACH)

    def soft(self, tip, gravity) -> Reading:
        return _of_ball(tip, (0.0, 0.0, 0.0), LENGTH)


def _of_ball(point, centre, radius) -> Reading:
    away = distance(point, centre)
    if away <= radius:
        return Reading("inside")
    return Reading("outside", away - radius, add(centre, scale(subtract(point, centre), 0.98 * radius / away)))


@dataclass
class Body:
    """The hybrid robot as it is drawn: joints of the Panda (7,) and one bend of every unit, rad."""

    def __post_init__(self):
        config = load_folder(Config, PROJECT / "conf/teleop")
        robot = PandaRobot("panda", config.mount_offset, 1.5, 0.0, READY)
        self.model = compose(rubbing_arm(spiral_chain(**SIZE), 8), robot).compile()
        self.data, self.drawn = mujoco.MjData(self.model), drawn(self.model)
        self.rigid = self.model.jnt_qposadr[panda_joints(self.model)]
        names = [self.model.joint(n).name for n in range(self.model.njnt)]
        self.soft = np.array([self.model.jnt_qposadr[n] for n, name in enumerate(names) if name.startswith("unit_")])

    def rows(self, joints: np.ndarray, bend: float) -> np.ndarray:
        """Poses of what is drawn. Shape (B, 7)."""
        self.data.qpos[self.rigid], self.data.qpos[self.soft] = joints, bend
        mujoco.mj_kinematics(self.model, self.data)
        return np.column_stack([self.data.xpos[self.drawn.ids], self.data.xquat[self.drawn.ids]])

    def bend(self, joints: np.ndarray, tip: tuple) -> float:
        """That which brings the tip nearest to where it shall be."""
        tries = np.linspace(-0.2, 0.2, 41)
        away = [np.linalg.norm(self.rows(joints, bend)[-1, :3] - tip) for bend in tries]
        return float(tries[int(np.argmin(away))])


class Server:
    def __init__(self) -> None:
        self.config, self.body = load_folder(Config, PROJECT / "conf/teleop"), Body()
        self.core = Teleoperation(self.config.core, Balls(), PACKAGE, self.config.mount_offset)
        self.ik = RigidIK(self.config.mount_offset)
        self.joints, self.bend, self.way = np.array(READY), 0.02, None
        self.clients: dict[str, web.WebSocketResponse] = {}
        self.holder, self.silent, self.count = "", False, 0
        self.log: list[str] = []
        self.clear()

    def clear(self) -> None:
        """As before the first input."""
        self.state, self.intent, self.plan, self.shown = self.core.start(), None, None, ""
        self.executor, self.began, self.alignment = messages.ExecutorReport(), 0.0, None
        self.heard: wire.Received | None = None

    # --- what comes in

    async def connect(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(max_msg_size=1 << 16)
        await socket.prepare(request)
        name = ""
        async for message in socket:
            if message.type == WSMsgType.TEXT:
                said = talk.hear(message.data)
                self.log.append(said.type if said.type != "lease" else f"lease {said.action}")
                if isinstance(said, talk.Hello):
                    if said.token != TOKEN and said.code != CODE:
                        await socket.send_str(talk.tell(talk.Refusal("the token is not that of this server", True)))
                        break
                    name = said.id or f"client-{len(self.log)}"
                    self.clients[name], self.space = socket, said.space
                    await socket.send_str(talk.tell(talk.Welcome(name, TOKEN, PACKAGE, RATE)))
                    await socket.send_str(talk.tell(talk.Around(WORLD)))
                    await socket.send_str(talk.tell(talk.Ping(1)))
                elif isinstance(said, talk.Pong):
                    await socket.send_str(talk.tell(talk.Clock(time.monotonic() - said.stamp, 0.001)))
                elif isinstance(said, talk.LeaseWish):
                    self.holder = name if said.action == "ask" else ""
                    self.clear()
                    if self.space == "base":
                        self.alignment = messages.Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
                elif isinstance(said, talk.Alignment):
                    self.alignment = said.pose
                elif isinstance(said, talk.Shown):
                    self.shown = said.digest
                if not isinstance(said, talk.Pong):
                    await self.tell_lease()
            elif message.type == WSMsgType.BINARY:
                received = wire.read(message.data)
                if received.kind == "input" and name == self.holder:
                    self.heard = received
                elif received.kind == "stop":
                    self.log.append("stop")
                    self.state = replace(self.state, mode="stopped")
        if self.clients.get(name) is socket:
            del self.clients[name]
            self.holder = "" if self.holder == name else self.holder
        return socket

    async def tell_lease(self) -> None:
        people = tuple(talk.Person(name, name) for name in self.clients)
        await self.send(talk.tell(talk.Lease(self.holder, (), people)))

    async def send(self, message: str | bytes) -> None:
        for socket in list(self.clients.values()):
            if not socket.closed:
                await (socket.send_str(message) if isinstance(message, str) else socket.send_bytes(message))

    # --- what goes out

    async def run(self) -> None:
        before, told = time.monotonic(), ""
        while True:
            await asyncio.sleep(max(0.0, before + STEP - time.monotonic()))
            now = time.monotonic()
            if self.heard is not None:
                self.step(now, now - before)
            before = now
            self.move(now)
            if self.silent:
                continue
            state = talk.tell(self.as_state())
            if state != told and (self.count % 7 == 0 or self.as_state().mode not in told):
                await self.send(told := state)
            await self.send(self.frame(now))
            if self.plan is not None and not self.plan["sent"]:
                self.plan["sent"] = True
                await self.preview()

    def step(self, now: float, dt: float) -> None:
        """The core at what was heard last."""
        hands = []
        for side, numbers in zip(wire.HANDS, self.heard.hands, strict=True):
            values = dict(zip(wire.HAND, numbers, strict=True))
            hands.append(messages.Controller(
                tuple(numbers[:3]), tuple(numbers[3:7]),
                f"{side}_tracked" in self.heard.flags and "visible" in self.heard.flags,
                *(values[name] > 0.5 for name in ("trigger", "grip")), (values["stick_x"], values["stick_y"]),
                *(values[name] > 0.5 for name in ("stick_pressed", "primary", "secondary"))))  # fmt: skip
        given = messages.Input(
            self.heard.stamp, hands[0], hands[1], self.alignment, tuple(self.joints), WORLD, PACKAGE,
            self.plan["report"] if self.plan else None, self.shown, self.executor)  # fmt: skip
        mode = self.state.mode
        self.state, self.intent = self.core.step(self.state, given, dt)
        if self.state.mode != mode:
            self.log.append(f"mode {self.state.mode}")
        request = self.intent.request
        if request is not None and (self.plan is None or self.plan["report"].serial != request.serial):
            self.make_plan(request)
        if self.intent.motion == "execute" and self.executor.mode != "running":
            self.executor, self.began = messages.ExecutorReport("running", self.intent.execute), now
            self.way = (self.joints.copy(), self.bend)
        elif self.intent.motion == "hold" and self.executor.mode == "running":
            self.executor, self.way = messages.ExecutorReport(), None

    def make_plan(self, request: messages.Request) -> None:
        targets = request.targets
        digest = f"{request.serial:064x}"
        try:
            joints = self.ik.solve(self.joints, targets.rigid.position, targets.pointing, targets.heading)
            report = messages.PlanReport(request.serial, digest, "", request.package, request.world)
            self.plan = {"report": report, "sent": False, "to": (joints, self.body.bend(joints, targets.tip.position))}
        except InputError as error:
            report = messages.PlanReport(request.serial, "", str(error), request.package, request.world)
            self.plan = {"report": report, "sent": True}

    def at(self, begin: tuple, end: tuple, share: float) -> tuple[np.ndarray, float]:
        s = min(max(share, 0.0), 1.0)
        s = s * s * (3 - 2 * s)
        return begin[0] + s * (end[0] - begin[0]), begin[1] + s * (end[1] - begin[1])

    def move(self, now: float) -> None:
        if self.way is None or self.executor.mode != "running":
            return
        share = (now - self.began) / DURATION
        self.joints, self.bend = self.at(self.way, self.plan["to"], share)
        if share >= 1:
            self.executor, self.way = replace(self.executor, mode="done"), None

    async def preview(self) -> None:
        frames = round(DURATION / STEP)
        here, digest = (self.joints.copy(), self.bend), self.plan["report"].digest
        rows = np.stack([self.body.rows(*self.at(here, self.plan["to"], k / (frames - 1))) for k in range(frames)])
        await self.send(talk.tell(talk.Preview(digest, STEP, DURATION, 0.0, (("approach", 0.0), ("curl", 1.2)))))
        for first in range(0, frames, 18):
            piece = rows[first : first + 18]
            flags = {"last"} if first + 18 >= frames else set()
            await self.send(wire.frame("preview", flags, rows.shape[1], first, first * STEP, piece))
        tips = rows[::9, -1, :3]
        spread = tuple(0.005 + 0.02 * k / len(tips) for k in range(len(tips)))
        times = tuple(9 * STEP * k for k in range(len(tips)))
        tip = tuple(tuple(float(x) for x in one) for one in tips)
        await self.send(talk.tell(talk.Foreseen(digest, 0.84, 0.68, 0.93, times, tip, spread, 0.9, 32)))

    def frame(self, now: float) -> bytes:
        self.count += 1
        lost = (np.nan,) * 7
        markers = [lost, lost, lost, lost]
        if self.intent is not None:
            for index, end in enumerate(self.intent.rays):
                markers[index] = lost if end is None else (*end, 1, 0, 0, 0)
            if (targets := self.intent.targets) is not None:
                turn = base_quaternion(targets.pointing, targets.heading)
                markers[2], markers[3] = (*targets.rigid.position, *turn), (*targets.tip.position, *turn)
        rows = np.vstack([self.body.rows(self.joints, self.bend), markers])
        flags = {"moving"} if self.executor.mode == "running" else set()
        return wire.frame("robot", flags, len(rows), self.count, now, rows)

    def as_state(self) -> talk.State:
        mode, intent = self.state.mode, self.intent
        following = {
            "hold": "Let go of grips and triggers.", "aim": "Set both targets, then ask for a plan.",
            "plan": "Wait for the plan.", "preview": "Look at the preview.", "ready": "Hold a grip and confirm.",
            "delay": "Hold the grip.", "execute": "Hold the grip until it has arrived.",
            "follow": "Hold the grip.", "stopped": "Primary button goes on.",
        }  # fmt: skip
        return talk.State(
            mode, intent.motion if intent else "hold", intent.notice if intent else "", following[mode],
            intent.countdown if intent else 0.0, intent.preview if intent else "", intent.execute if intent else "",
            intent.targets if intent else None, self.executor.mode, self.executor.fault)  # fmt: skip

    # --- the rest

    async def scene(self, request: web.Request) -> web.Response:
        if request.headers.get("Authorization") != f"Bearer {TOKEN}":
            raise web.HTTPForbidden
        reach = icosphere(subdivisions=3, radius=REACH).apply_translation(CENTRE)
        return web.json_response({
            **self.body.drawn.scene, "markers": list(wire.MARKERS), "shell": {"around": AROUND, "along": ALONG},
            "reach": {"vertices": reach.vertices.ravel().tolist(), "faces": reach.faces.ravel().tolist()},
            "arm": {"length": LENGTH, "units": 24}})  # fmt: skip

    async def shell(self) -> None:
        """A bowl below the mount, again and again for who comes later."""
        angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)[:, None]
        polar = np.linspace(0.02, 2.0, ALONG)[None]
        points = 0.8 * LENGTH * np.stack([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle),
                                          -np.cos(polar) + 0 * angle], axis=-1)  # fmt: skip
        while True:
            await self.send(wire.frame("shell", set(), AROUND * ALONG, 1, time.monotonic(), points))
            await asyncio.sleep(0.5)

    async def obey(self) -> None:
        """The test's lines; the log goes out for each."""
        loop = asyncio.get_running_loop()
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            word = line.strip()
            self.silent = word == "silent" or (self.silent and word != "speak")
            if word == "drop":
                for socket in list(self.clients.values()):
                    await socket.close()
            if word == "fault":
                self.executor, self.way = messages.ExecutorReport("fault", "", "joint 4: torque"), None
            if word == "clear":
                self.executor = messages.ExecutorReport()
            print("log " + ",".join(self.log), flush=True)


@web.middleware
async def strict(request: web.Request, handler) -> web.StreamResponse:
    response = await handler(request)
    if not response.prepared:
        response.headers["Content-Security-Policy"] = POLICY
        response.headers["Permissions-Policy"] = "xr-spatial-tracking=(self)"
        response.headers["Referrer-Policy"] = "no-referrer"
    return response


async def serve(port: int) -> None:
    server, page = Server(), PROJECT / "trunkline/live/page"
    app = web.Application(middlewares=[strict])

    async def files(request: web.Request) -> web.FileResponse:
        name = request.match_info.get("name") or "index.html"
        if name not in ("index.html", "app.js"):
            raise web.HTTPNotFound
        return web.FileResponse(page / name)

    app.add_routes([
        web.get("/", files), web.get("/ws", server.connect), web.get("/scene.json", server.scene),
        web.get("/{name}", files),
    ])  # fmt: skip
    runner = web.AppRunner(app)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", port)
    await site.start()
    print(f"ready {site._server.sockets[0].getsockname()[1]} {TOKEN} {CODE}", flush=True)
    tasks = [asyncio.create_task(one) for one in (server.run(), server.shell(), server.obey())]
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        task.done() and task.result()  # what went wrong, if anything did


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1])))
