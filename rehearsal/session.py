"""One session at the stand-in robot: controllers in, the core's intents, plans, their preview, and the robot's motion.

It is what a client does, without a headset: it asks for plans when the core does, shows each as where the twin's tip
comes to rest, or what may come of a grasp, runs what the core says, and holds otherwise. Between plans it looks where
things are.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rehearsal.operator.hands import RayHand
from rehearsal.robot.sensors import Seen
from rehearsal.robot.stand_in import StandInRobot
from trunkline.ar.preview.grasp_preview import GraspPreviewer, PlanPrediction
from trunkline.ar.preview.package import Package
from trunkline.ar.preview.world_model import update_world
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import SimulatedRobot
from trunkline.ar.teleop.following import Follower, Following, sought
from trunkline.ar.teleop.messages import ExecutorReport, Input, Intent, Joints, Offer, PlanReport, Pose, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.targets import why_not
from trunkline.ar.teleop.trajectory import JOINTS
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose

RATE = 60.0  # Hz, of a headset's frames
TICKS = 2  # in which the robot is commanded a frame
REFERENCE = Pose((1.3, 0.0, 0.6), (0.5, 0.5, 0.5, 0.5))  # where the operator stands: y up, looking along the base's -x

Place = Callable[[float], np.ndarray]  # true position (3,), m, of the object in the Panda's base frame at a time, s


@dataclass
class View:
    """What the operator sees at a frame, in the frame that the client takes for the Panda's base.

    thing, tip (3,): m, of the object and of the robot's tip. previewed: m, where the shown plan's tip comes to rest.
    world: as the client believes it. probability: that the shown plan's grasp holds. offer: the assistant's.
    """

    now: float
    intent: Intent
    thing: np.ndarray
    tip: np.ndarray
    previewed: np.ndarray | None
    world: World
    probability: float | None = None
    offer: Offer | None = None


class Session:
    """From the robot at rest with its arm straight. `place` says where the object truly is; `foresight` previews
    grasps."""

    def __init__(
        self,
        package: Package,
        config: TeleoperationConfig,
        robot: StandInRobot,
        hands: tuple[RayHand, RayHand],
        world: World,
        place: Place,
        foresight: GraspPreviewer | None = None,
    ) -> None:
        self.package, self.config, self.robot, self.hands = package, config, robot, hands
        self.world, self.place, self.foresight = world, place, foresight
        self.core = Teleoperation(config.core, package.reach, package.digest, config.mount_offset)
        self.state, self.planner = self.core.start(), package.planner(config)
        self.executor = SimulatedRobot(
            robot.joints[0], package.straight, self.planner.limits, package.digest, self._move
        )
        self.follower: Follower | None = None
        self.refused = ""  # why the newest targets are not followed, "" where they are
        self.plan: Plan | None = None
        self.report: PlanReport | None = None
        self.fault, self.shown, self.showing, self.since = "", "", "", 0.0
        self.previewed: np.ndarray | None = None
        self.now, self.rays, self.moved, self.began = 0.0, (None, None), False, 0.0
        self.foreseen: PlanPrediction | None = None
        self.grasped: PlanPrediction | None = None  # of the grasp of what the arm holds
        self.straight: list[np.ndarray] = []  # m, readings of the straight arm's tip in its base frame, (3,) each
        self.believed = ""  # digest of the newest plan of whose end the world tells
        self.tips: list[tuple[float, np.ndarray]] = []  # s since a plan began, and where its tip is seen, m
        self.refusals: list[tuple[float, str]] = []  # times at which targets were not followed, and why

    def seen(self, place: np.ndarray) -> np.ndarray:
        """A true place (3,), m, in the frame that the client takes for the Panda's base."""
        return self.robot.instruments.turn.apply(place) + self.robot.instruments.shift

    @property
    def hangs(self) -> np.ndarray:
        """Where the straight arm's tip was seen before the robot moved, in the frame of the arm's base, m. Shape (3,).
        Its y is how far it is beside the bending plane."""
        return np.mean(self.straight, axis=0)

    def foresee(self) -> PlanPrediction | None:
        """What a page tells of where the tip of the newest plan goes, which grasps nothing; None without `foresight`.
        Nothing here waits for it, so it is computed when it is asked for."""
        if self.foresight is None or self.plan is None or self.report is None:
            return None
        return self.foresight.reach(self.plan, self.world, self.report.serial)

    def frame(self) -> View:
        """Let a frame pass."""
        self.now += 1 / RATE
        left, right = (hand.controller(self.now, end) for hand, end in zip(self.hands, self.rays, strict=True))
        executor = ExecutorReport("fault", "", self.fault) if self.fault else self.executor.state()
        seen = self.robot.seen()
        joints: Joints = tuple(float(q) for q in seen.joints)  # type: ignore[assignment]
        if self.state.mode in ("hold", "aim"):
            self._believe(seen)
        if not self.moved:
            mount, flange = (found[0] for found in mount_pose(seen.joints[None], self.config.mount_offset))
            self.straight.append((seen.tip - mount) @ flange * [1, -1, -1])  # y and z are opposite to the flange's
        given = Input(
            self.now, left, right, REFERENCE, joints, self.world, self.package.digest, self.report, self.shown,
            executor, self.foreseen.offer if self.foreseen is not None else None,
        )  # fmt: skip
        self.state, intent = self.core.step(self.state, given, 1 / RATE)
        self.rays = intent.rays
        if intent.request is not None and (self.report is None or self.report.serial != intent.request.serial):
            self._plan(intent)
        self._show(intent)
        self._drive(intent)
        tip = self.seen(self.robot.truth().tip)
        if intent.motion == "execute":
            self.tips.append((self.now - self.began, tip))
        found = View(self.now, intent, self.seen(self.place(self.now)), tip, None, self.world)
        if intent.mode in ("preview", "ready", "delay"):
            found.previewed = self.previewed
            if self.foreseen is not None:
                found.probability, found.offer = self.foreseen.probability, self.foreseen.offer
        return found

    def _believe(self, seen: Seen) -> None:
        """The world as it is seen: where things are, and what holds them after a plan has been run."""
        report, phases = self.executor.state(), ()
        if report.mode == "done" and report.digest != self.believed and self.plan is not None:
            self.believed, phases = report.digest, tuple(dict(self.plan.phases))
        pose = np.append(seen.thing, seen.thing_quaternion)
        self.world = update_world(self.world, pose, phases, self.config.handling.lift)

    def _plan(self, intent: Intent) -> None:
        request = intent.request
        assert request is not None
        before, self.foreseen, self.previewed = self.foreseen, None, None
        try:
            here = self.executor.joints, self.executor.commands
            self.plan = self.planner.plan(request, self.world, *here, float(self.hangs[1]))
        except InputError as error:
            self.report = PlanReport(request.serial, refused=str(error))
            return
        plan = self.plan
        self.report = PlanReport(request.serial, plan.digest(), "", plan.package, plan.world)
        if request.targets.thing:
            thing = self.world.thing(request.targets.thing)
            if self.foresight is not None and thing.support == "held":
                self.grasped = self.grasped or before
                assert self.grasped is not None
                self.foreseen = self.foresight.bring(
                    plan, request.targets, thing, self.world, self.hangs, self.grasped, request.serial
                )
            elif self.foresight is not None:
                self.grasped = None
                *_, self.foreseen = self.foresight.grasp(
                    plan, request.targets, thing, self.world, self.hangs, request.serial
                )
            return
        mount, _ = mount_pose(plan.joints[-1:], self.config.mount_offset)
        x, y, z = (float(value) for value in mount[0])
        self.previewed = self.package.tip((x, y, z), request.targets, plan.commands[-1])

    def _show(self, intent: Intent) -> None:
        """The preview lasts as long as what it shows."""
        if intent.preview != self.showing:
            self.showing, self.since, self.shown = intent.preview, self.now, ""
        if self.showing and self.plan is not None and self.now - self.since >= self.plan.duration:
            self.shown = self.showing

    def _drive(self, intent: Intent) -> None:
        running = self.executor.state()
        if intent.motion == "execute" and running.digest != intent.execute and self.plan is not None:
            self.fault, self.tips = self.executor.start(self.plan, intent.execute), []
            self.began = self.now - 1 / RATE  # `now` is the end of a frame, in which the plan runs already
        if intent.motion == "hold" and running.mode == "running":
            self.executor.stop()
        self._hear(intent)
        self.moved = self.moved or intent.motion != "hold"
        if not self.moved:
            return  # a robot at rest stays as it is
        for tick in range(TICKS):
            if self.follower is not None and intent.motion == "follow":
                try:
                    now = self.now + tick / RATE / TICKS
                    self.executor.joints, self.executor.commands = self.follower.tick(now)
                    self.fault = self.fault or self.follower.refused
                except InputError as error:
                    self.fault, self.follower = str(error), None
            self.executor.advance(1 / RATE / TICKS)
        if self.follower is not None and self.refused:
            self.refusals.append((self.now, self.refused))

    def _hear(self, intent: Intent) -> None:
        """While it follows, the robot hears the newest targets, those that can be followed, and does them later."""
        if intent.mode != "follow":
            self.follower, self.refused = None, ""
            return
        if self.follower is None:
            here = self.executor.joints, self.executor.commands
            following = Following(self.config.core.follow_delay, self.package.period, self.config.mount_offset)
            self.follower = Follower(self.planner.limits, following, *here, 1 / RATE / TICKS)
        if not self.follower.due(self.now):
            return
        goal = None
        if not why_not(intent.targets):
            goal, self.refused = sought(self.planner, intent.targets, self.follower.goal[:JOINTS], self.world)
        self.follower.hear(self.now, goal)

    def _move(self, joints: np.ndarray, commands: np.ndarray, dt: float) -> None:
        try:
            self.robot.send(joints, self.package.straight - commands)
        except InputError as error:
            self.fault = str(error)
        self.robot.advance(dt)
