"""A live session of the small arm whose time passes as fast as it is computed: the controller, the true planner and
previews, the simulated robot's plant, and the lab's simulated cameras."""

from dataclasses import replace
from functools import cache

import numpy as np

from tests.ar.session.test_controller import BASE, TRACKED, UP
from tests.ar.session.test_correction_steps import BEYOND, PLANNER
from tests.ar.session.test_preview_process import made
from tests.ar.session.test_robot_process import simulation
from tests.ar.session.written import Written
from tests.ar.teleop.test_plan import OFFSET
from tests.support.live import live, patient
from tests.support.operator import PACKAGE, Everywhere, config
from tests.support.small_arm import small_spec
from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.preview.preview_twin import compose_twin
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session.arm_cameras import SimulatedArmCameras
from trunkline.ar.session.binary import HAND, Received
from trunkline.ar.session.composition import measured_subject, subject_of
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.controller_input import controllers
from trunkline.ar.session.previewer import InlinePreviewer, PreviewPlanner
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.session.simulated import TwinPlant
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.vibration import shaper_for
from trunkline.ar.tracking.simulated_cameras import EPOCH, SimulatedCameras
from trunkline.ar.tracking.tracker import TrackedPoses

RATE, BEGIN = 72.0, 100.0  # Hz, s
DAMPED = 6.0  # times the small arm's damping, so that it soon comes to rest
RESTS = 4.0  # s that it then takes


@cache
def damped_spec():
    spec = small_spec()
    for joint in spec.joints:
        joint.damping = DAMPED * joint.damping
    return spec


@cache
def damped(bent=0.0):
    """The simulated robot, each joint of its arm bent by `bent`, rad, at rest, in the plane of the first tendon."""
    s = simulation()
    twin = compose_twin(robot_model(), make_world(()), None, s.joints, s.commands, live().preview)
    model = twin.model
    for joint in range(model.njnt):
        if model.body(model.jnt_bodyid[joint]).name.startswith("unit_") and abs(model.jnt_axis[joint][1]) > 0.9:
            model.qpos_spring[model.jnt_qposadr[joint]] += bent
    return replace(s, twin=twin)


def robot_model():
    return replace(made().foresight.robot_model, arm=damped_spec(), lacking=BEYOND)


class PlantRobot:
    """The simulated robot, whose time passes by `advance`."""

    def __init__(self, s):
        self.plant = TwinPlant(s)
        self.follower = PlanFollower(
            s.joints,
            s.commands,
            s.limits,
            s.package,
            lambda joints, commands, _: self.plant.move(joints, commands, True),
        )
        self.start, self.stop, self.state = self.follower.start, self.follower.stop, self.follower.state
        self.now = BEGIN

    def permit(self, waits=False):
        """It goes on without."""

    def hear(self, age, axes):
        raise AssertionError("nothing is followed")

    def advance(self, until):
        while self.now + self.plant.tick <= until:
            self.follower.advance(self.plant.tick)
            self.now += self.plant.tick

    def robot_state(self):
        poses, plant = self.plant.poses(), self.plant
        return RobotState(self.now, 0.0, self.follower.joints, self.follower.commands, np.full(7, np.nan), poses,
                          plant.measured(), plant.lengths())  # fmt: skip


class LabCameras(SimulatedArmCameras):
    """See at once, by the clock of `robot`; `fault`: of the stream, `off`: m by which their frame is elsewhere than it
    is set."""

    def __init__(self, s, robot, off=(0.0, 0.0, 0.0), **settings):
        cameras = replace(live().cameras.simulated, swaps=0.0, outliers=0.0, **settings)
        super().__init__(s, subject_of(s).tip, replace(live().cameras, simulated=cameras))
        self._robot, self.fault, self._origin = robot, "", self._origin + np.array(off)
        self._lab = SimulatedCameras(cameras, self, self.names)
        self._tracker = self

    def show(self, bodies):
        self._shown = np.concatenate([self._markers(bodies).ravel(), bodies[self._rows, 3:].ravel()])

    def hear(self):
        return self._shown, ""

    def latest(self):
        frame = self._lab._exposed(self._robot.now)
        visible = frame.tracked[:, None]
        positions, quaternions = (np.where(visible, part, np.nan) for part in (frame.positions, frame.quaternions))
        tracked = TrackedPoses(self.names, frame.stamp - EPOCH, positions, quaternions, 0.01, RATE, 0.0, self.fault)
        self._tracker = type("Frame", (), {"latest": lambda _: tracked})()
        return super().latest()

    def close(self):
        """There is no process."""


class CameraSession:
    """An operator who points, confirms and lets the robot move. path: of the log."""

    def __init__(self, path, s=None, cameras=True, off=(0.0, 0.0, 0.0), **noise):
        s = s or damped()
        self.robot = PlantRobot(s)
        self.cameras = LabCameras(s, self.robot, off, **noise) if cameras else None
        subject = measured_subject(subject_of(s), self.cameras, s) if cameras else subject_of(s)
        self.log = Written(path, subject)
        self.log.time = BEGIN
        settings = replace(made().foresight.settings, hold=RESTS)
        foresight = replace(made().foresight, robot_model=robot_model(), settings=settings)
        shaper = shaper_for(damped_spec().compile(), config().shaping)
        planning = PreviewPlanner(replace(PLANNER, shaper=shaper), foresight, s.bodies)
        core = Teleoperation(patient(silence=5.0), Everywhere(), PACKAGE, OFFSET)
        self.controller = SessionController(
            core, self.robot, InlinePreviewer(planning.answers), make_world(()), 0.1, self.log, 0.0, self.cameras,
            CorrectionSettings(),
        )  # fmt: skip
        self.controller.begin(RATE)
        self.controller.control(BASE)
        self.left, self.right, self.places = {}, {}, (np.zeros(3), np.zeros(3))
        self.correct = False

    def tick(self):
        now = self.robot.now + 1 / RATE
        self.robot.advance(now)
        self.log.time = self.robot.now
        rows = [
            [({"qw": 1.0} | dict(zip("xyz", place + UP, strict=True)) | pressed).get(name, 0.0) for name in HAND]
            for place, pressed in zip(self.places, (self.left, self.right), strict=True)
        ]
        hands = controllers(Received("input", frozenset(TRACKED), 0, now, np.array(rows)))
        assert self.controller.hear(now, *hands, True, correct=self.correct) == ""
        self.controller.poll(now)
        return self.controller.tick(1 / RATE)

    def until(self, happens, seconds=60.0):
        end = self.robot.now + seconds
        while not happens(intent := self.tick()):
            assert self.robot.now < end, (intent.mode, intent.notice, self.controller.correction.words)
        return intent

    def wait(self, seconds):
        end = self.robot.now + seconds
        self.until(lambda _: self.robot.now >= end, seconds + 1.0)

    def plan(self, mount, tip, rest=4.0):
        """Point with both rays, preview, confirm, and let the robot go there and `rest`, s."""
        self.places = np.array(mount), np.array(tip)
        self.until(lambda intent: intent.mode == "aim")
        self.left, self.right = {"grip": 1.0}, {"grip": 1.0}
        self.wait(1.0)
        self.right = {"grip": 1.0, "trigger": 1.0}
        self.until(lambda intent: intent.mode == "preview")
        self.right = {"grip": 1.0}
        self.until(lambda _: not self.controller.preview_shown(self.controller.intent.preview, self.robot.now))
        self.until(lambda intent: intent.mode == "ready")
        self.right = {"grip": 1.0, "trigger": 1.0}
        self.until(lambda intent: intent.mode == "execute")
        self.right = {"grip": 1.0}
        self.until(lambda intent: intent.mode == "aim")
        self.left, self.right = {}, {}
        self.wait(rest)

    def close(self):
        self.log.close()
        return self.log.file.name
