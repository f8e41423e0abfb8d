"""What all experiments begin with: robot, hands and operator, drawn by a seed; and how one is run and judged."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.rig import ROOT as LAB
from demo.rig import Config as Lab
from rehearsal import settings
from rehearsal.experiments.result import Result
from rehearsal.operator.hands import HumanOperator, RayHand
from rehearsal.operator.scripts import Ending, Operator, Script, offset_of
from rehearsal.robot.scene import LabScene, SceneObject
from rehearsal.robot.stand_in import StandIn, StandInRobot, TrueState
from rehearsal.session import REFERENCE, Place, RehearsedSession, View
from rehearsal.settings import Free
from rehearsal.settings import previewing as read_previewing
from trunkline.ar.preview.grasp_preview import GraspPreviewer
from trunkline.ar.preview.package import Package, read_package
from trunkline.ar.preview.preview_twin import RobotModel, robot_model_of
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.messages import Obstacle, World
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.vectors import DOWN
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_config, load_folder

ORIGINS = np.array([[-0.2, -0.1, -0.3], [0.2, -0.1, -0.3]])  # m, of the left and right hand in the reference frame
START = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])  # rad, where the search for the ready pose begins
FLOOR = -0.75  # m; the robot stands on a stand
FLOOR_OBSTACLE = Obstacle("the floor", (-3.0, -3.0, -2.0), (3.0, 3.0, FLOOR))
LONGEST = 300.0  # s of a run


@dataclass(frozen=True)
class SharedRun:
    """What all runs have in common: package, settings, arm.

    judged: whether plans are previewed and the operator confirms only one whose preview is good. world_model,
        previewing: what grasps are previewed with.
    """

    package: Package
    config: TeleoperationConfig
    arm: Stranger
    stand_in: StandIn
    person: HumanOperator
    settings: Free
    judged: bool = True
    world_model: RobotModel | None = None
    previewing: Previewing = field(default_factory=read_previewing)

    def place(self, rng: np.random.Generator) -> np.ndarray:
        """A random place of the object, (3,), m: evenly over the area in front of the robot, and over the height."""
        s = self.settings
        radius = np.sqrt(rng.uniform(s.near**2, s.far**2))
        azimuth = np.radians(rng.uniform(-s.side_deg, s.side_deg))
        return np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), rng.uniform(s.low, s.high)])

    def operator(self, rng: np.random.Generator) -> Operator:
        dead_zone = self.config.core.rays.dead_zone
        left, right = (RayHand(origin, REFERENCE, self.person, dead_zone, rng) for origin in ORIGINS)
        offset = offset_of(self.package.reach)
        radius, band = self.settings.diameter / 2, self.settings.band
        return Operator(self.person, (left, right), offset, radius, band, rng, self.judged)

    @property
    def foresight(self) -> GraspPreviewer:
        """What plans are previewed with."""
        assert self.world_model is not None
        return GraspPreviewer(self.world_model, self.package.grips(self.config), self.previewing)

    def session(
        self, operator: Operator, object_center: np.ndarray | None, seed: int, place: Place
    ) -> RehearsedSession:
        """The stand-in at its ready pose; a sphere hangs at `object_center` (3,), m, or there is none."""
        s = self.settings
        x, y, z = s.mount_ready
        ready = RigidIK(self.config.mount_offset).solve(START, (x, y, z), DOWN, 0.0)
        far = [5.0, 5.0, 5.0]
        where = far if object_center is None else object_center.tolist()
        hook = None if object_center is None else [where[0], where[1], where[2] + s.diameter / 2 + s.string]
        hung = SceneObject("sphere", s.diameter, s.diameter, s.mass, where, hanging=object_center is not None)
        robot = StandInRobot(self.arm, LabScene(FLOOR, hung, {}, hook), self.stand_in, ready, seed)
        world = World("floor", (FLOOR_OBSTACLE,))
        hands = operator.left, operator.right
        return RehearsedSession(self.package, self.config, robot, hands, world, place, self.foresight, self.judged)


def bench_of(file: Path) -> SharedRun:
    """With the package at `file`, the lab's arm, and the settings as they are.

    Raises:
        InputError: the lab's arm is no stranger, or there is no package.
    """
    arm = plant_of(load_config(Lab, "record", LAB))
    if not isinstance(arm, Stranger):
        raise InputError(f"{LAB}/params.yaml: record.plant: found another plant, expected stranger: the robot's arm")
    config = load_folder(TeleoperationConfig, PROJECT / "conf/teleop")
    package, previewing = read_package(file), read_previewing()
    world_model = robot_model_of(previewing, package.files)
    return SharedRun(
        package, config, arm, settings.stand_in(), settings.person(), settings.free(), world_model=world_model,
        previewing=previewing,
    )  # fmt: skip


@dataclass
class SessionFrame:
    """A frame of the run as it truly was: time, s, core's mode, the robot's state, the object's place (3,), m, what the
    robot was sent last: joints (7,), rad, and commands (K,), m, and the centres of the arm's units (U, 3), m."""

    now: float
    mode: str
    truth: TrueState
    object: np.ndarray
    joints: np.ndarray
    commands: np.ndarray
    units: np.ndarray


def executed(frames: list[SessionFrame]) -> SessionFrame | None:
    """The first frame after the first execution, None where none came to an end."""
    pairs = zip(frames, frames[1:], strict=False)
    return next((after for frame, after in pairs if frame.mode == "execute" != after.mode), None)


@dataclass
class Staged:
    """An experiment that is ready to be run: where, and what the operator does there. judge: fills in a result of how
    the script ended, the frames from where the robot began to move, and all views, and says why it failed, "" if it did
    not. object_name: what is grasped, in words. watch: fills in what it takes to look on after the script, while
    the robot holds."""

    name: str
    seed: int
    session: RehearsedSession
    script: Script
    judge: Callable[[Result, Ending, list[SessionFrame], list[View]], str]
    object_name: str = ""
    watch: Callable[[Result, Ending, list[SessionFrame]], None] | None = None

    def judged(self, ending: object, frames: list[SessionFrame], views: list[View], seconds: float) -> Result:
        """What a run of `seconds` came to, whose script ended so."""
        result = Result(self.name, self.seed, False, seconds=seconds, object=self.object_name)
        if isinstance(ending, Ending):
            result.cause = self.judge(result, ending, frames, views)
        else:
            result.cause = "stopped: the run did not end"
        result.success = not result.cause
        return result


def perform(staged: Staged) -> tuple[Result, list[SessionFrame]]:
    """One run, and its frames from where the robot began to move."""
    ending, frames, views = rehearse(staged.session, staged.script)
    result = staged.judged(ending, frames, views, staged.session.now)
    if staged.watch is not None and isinstance(ending, Ending):
        staged.watch(result, ending, frames)
    return result, frames


def rehearse(session: RehearsedSession, script: Script) -> tuple[object, list[SessionFrame], list[View]]:
    """Run a script to its end: what it returned, and every frame in which the robot may have moved."""
    frames, views = [], []
    next(script)
    while session.now < LONGEST:
        view = session.frame()
        views.append(view)
        if session.moved:
            truth, sent = session.robot.truth(), session.executor.axes
            object, (units, _) = session.place(session.now), session.robot.links()
            frames.append(SessionFrame(session.now, view.intent.mode, truth, object, sent.joints, sent.commands, units))
        try:
            script.send(view)
        except StopIteration as end:
            return end.value, frames, views
    return None, frames, views
