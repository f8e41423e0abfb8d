"""One session at the stand-in robot, by the session controller of a live session, on a made clock.

It is what a client does, without a headset: it shows each plan as where the twin's tip comes to rest, or what may come
of a grasp, tells the controller when it has been shown, and lets the robot move. What differs from a live session: the
robot, plans and previews in line, and that nothing waits for the batch of a plan that grasps nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rehearsal.operator.hands import RayHand
from rehearsal.robot.stand_in import StandInRobot
from trunkline.ar.preview.grasp_preview import GraspPreviewer, PlanPrediction
from trunkline.ar.preview.package import Package
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.previewer import InlinePreviewer, PreviewPlanner
from trunkline.ar.session.robot_process import DEAD_MAN, RobotState
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.messages import ExecutorReport, Intent, Offer, Pose, Request, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import MotionLimits
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose

RATE = 60.0  # Hz, of a headset's frames
TICKS = 2  # in which the robot is commanded a frame
TICK = 1 / RATE / TICKS  # s
REFERENCE = Pose((1.3, 0.0, 0.6), (0.5, 0.5, 0.5, 0.5))  # where the operator stands: y up, looking along the base's -x

Place = Callable[[float], np.ndarray]  # true position (3,), m, of the object in the Panda's base frame at a time, s


@dataclass
class View:
    """What the operator sees at a frame, in the frame that the client takes for the Panda's base.

    object, tip (3,): m, of the object and of the robot's tip. previewed: m, where the shown plan's tip comes to rest.
    world: as the client believes it. probability: that the shown plan's grasp holds. offer: the assistant's.
    """

    now: float
    intent: Intent
    object: np.ndarray
    tip: np.ndarray
    previewed: np.ndarray | None
    world: World
    probability: float | None = None
    offer: Offer | None = None


class RehearsedRobot:
    """The stand-in as a session controller has any robot: it goes where it is sent as long as it is permitted to. At
    rest at first, and left alone until it moves."""

    def __init__(self, robot: StandInRobot, package: Package, limits: MotionLimits, mount_offset: float) -> None:
        self.robot, self._straight, self._mount_offset = robot, package.straight, mount_offset
        self.axes = PlanFollower(robot.joints[0], package.straight, limits, package.digest, self._send)
        self.start, self.hear, self.stop = self.axes.start, self.axes.hear, self.axes.stop
        self.moved, self._fault, self._unpermitted = False, "", 0.0
        self._hangs: list[np.ndarray] = []  # m, readings of the straight arm's tip in its base frame, (3,) each

    def follow(self, following: Following) -> str:
        return self.axes.follow(following, TICK)

    def permit(self, waits: bool = False) -> None:
        self._unpermitted, self.moved, self.axes.waits = 0.0, True, waits

    def state(self) -> ExecutorReport:
        report = self.axes.state()
        return ExecutorReport("fault", report.digest, self._fault) if self._fault else report

    @property
    def hangs(self) -> np.ndarray | None:
        """Where the straight arm's tip was seen before the robot moved, in the frame of the arm's base, m. Shape (3,).
        Its y is how far it is beside the bending plane. None where it was not seen before."""
        return np.mean(self._hangs, axis=0) if self._hangs else None

    def robot_state(self) -> RobotState:
        """As the sensors read it, which every call asks anew; its one body is the arm's tip."""
        readings = self.robot.readings()
        if not self.moved:
            mount, flange = (part[0] for part in mount_pose(readings.joints[None], self._mount_offset))
            self._hangs.append((readings.tip - mount) @ flange * [1, -1, -1])  # y and z are opposite to the flange's
        object = np.append(readings.object, readings.object_quaternion)
        tip, lengths = np.append(readings.tip, readings.tip_quaternion)[None], self._straight - readings.wound
        here = self.axes.joints, self.axes.commands
        return RobotState(self.robot.time, 0.0, *here, object, tip, readings.joints, lengths, self.hangs)

    def advance(self) -> None:
        """Let a frame pass."""
        if not self.moved:
            return
        self._unpermitted += 1 / RATE
        if self._unpermitted > DEAD_MAN:
            self.stop()
        for _ in range(TICKS):
            self.axes.advance(TICK)

    def _send(self, joints: np.ndarray, commands: np.ndarray, dt: float) -> None:
        try:
            self.robot.send(joints, self._straight - commands)
        except InputError as error:
            self._fault = self._fault or str(error)
            self.stop()
        self.robot.advance(dt)


class RehearsedSession:
    """From the robot at rest with its arm straight. `place` says where the object truly is; `foresight` previews
    grasps, where the operator is `judged` by previews."""

    def __init__(
        self,
        package: Package,
        config: TeleoperationConfig,
        robot: StandInRobot,
        hands: tuple[RayHand, RayHand],
        world: World,
        place: Place,
        foresight: GraspPreviewer,
        judged: bool = True,
    ) -> None:
        self.package, self.config, self.robot, self.hands, self.place = package, config, robot, hands, place
        self.planner = PreviewPlanner(package.planner(config), foresight, ())
        self.previewer, self.judged = InlinePreviewer(self.planner.answers), judged
        self.executor = RehearsedRobot(robot, package, self.planner.planner.limits, config.mount_offset)
        core = Teleoperation(config.core, package.reach, package.digest, config.mount_offset)
        lift, period = config.handling.least_lift, package.period
        self.controller = SessionController(core, self.executor, self.previewer, world, lift, period=period)
        self.controller.control(REFERENCE)
        self.previewed: np.ndarray | None = None
        self.request: Request | None = None  # for the newest plan
        self.now, self.rays = 0.0, (None, None)
        self._executed, self._began = "", 0.0
        self.tips: list[tuple[float, np.ndarray]] = []  # s since a plan began, and where its tip is seen, m
        self.refusals: list[tuple[float, str]] = []  # times at which targets were not followed, and why

    def in_client_frame(self, place: np.ndarray) -> np.ndarray:
        """A true place (3,), m, in the frame that the client takes for the Panda's base."""
        return self.robot.instruments.turn.apply(place) + self.robot.instruments.shift

    @property
    def moved(self) -> bool:
        """Whether the robot has ever been let move."""
        return self.executor.moved

    @property
    def prediction(self) -> PlanPrediction | None:
        """Of the newest plan, where its batch has been rolled out."""
        return self.planner.prediction

    def frame(self) -> View:
        """Let a frame pass."""
        self.now += 1 / RATE
        controller, before = self.controller, self.controller.plan
        left, right = (hand.controller(self.now, end) for hand, end in zip(self.hands, self.rays, strict=True))
        controller.hear(self.now, left, right, drawn=True)  # its operator sees each frame
        intent = controller.tick(1 / RATE)
        controller.poll(self.now)
        self.rays = intent.rays
        if controller.plan is not before:
            self.previewed = self._end(controller.plan, intent)
            self.request = intent.request
        if intent.mode == "preview":
            controller.preview_shown(intent.preview, self.now)  # which counts once it has lasted long enough
        if intent.execute and intent.execute != self._executed:
            self._executed, self.tips = intent.execute, []
            self._began = self.now - 1 / RATE  # `now` is the end of a frame, in which the plan runs already
        self.executor.advance()
        if intent.mode == "follow" and controller.refused:
            self.refusals.append((self.now, controller.refused))
        tip = self.in_client_frame(self.robot.truth().tip)
        if intent.motion == "execute":
            self.tips.append((self.now - self._began, tip))
        view = View(self.now, intent, self.in_client_frame(self.place(self.now)), tip, None, controller.world)
        if intent.mode in ("preview", "ready", "delay"):
            if controller.prediction is not None and self.previewed is not None:
                self.previewed = np.array(controller.prediction.tip[-1])
            view.previewed = self.previewed
            if controller.prediction is not None and self.judged:
                view.probability, view.offer = controller.prediction.probability, controller.prediction.offer
        return view

    def _end(self, plan: Plan | None, intent: Intent) -> np.ndarray | None:
        """Where the twin's tip comes to rest, without friction, at the end of a plan that grasps nothing, m (3,)."""
        if plan is None or intent.request is None or intent.request.targets.object:
            return None
        x, y, z = (float(value) for value in mount_pose(plan.joints[-1:], self.config.mount_offset)[0][0])
        return self.package.tip((x, y, z), intent.request.targets, plan.commands[-1])
