"""The twin that plans are tried on: the identified arm on the Panda, the world as the client believes it, an object."""

from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.hybrid.compose import Placed, compose, panda_joints
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin
from trunkline.ar.hybrid.string import hang
from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment, Hanging, TipShift, TipUncertainty, TipUnknown
from trunkline.ar.hybrid.uncertainty import Contact, GraspUncertainty
from trunkline.ar.hybrid.worlds import SupportSurface
from trunkline.ar.hybrid.worlds import WorldGeometry as Room
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Obstacle, World, WorldObject
from trunkline.ar.teleop.vectors import Quaternion, unit
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, tilt_of_gravity, wxyz_from_rotation
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import settle
from trunkline.report.certificate.arms import StaticArm, arm_of
from trunkline.report.certificate.poses import StaticPoses
from trunkline.twin import package
from trunkline.twin.discrepancy import Lacking
from trunkline.twin.twin import Twin

GRAVITY = np.array([[0.0, 0.0, -STANDARD_GRAVITY]])  # m/s², where the arm hangs straight down

LEANS = 4  # times that it is corrected: each leaves a tenth or less
UNPULLED = 1e-6  # m of all pulls, up to which an arm is not pulled
SHIFTED = 0.2  # s between the places along a plan at which the residual map is asked
CREEP = 0.01  # share of the way to rest that may be left


@dataclass(frozen=True)
class RobotModel:
    """What the package says. uncertainty: about the arm's parameters, contacts and places. alignment: of the frame in
    which it is shown. lacking: what the model lacks beside them, None where nobody knows."""

    arm: mujoco.MjSpec
    uncertainty: GraspUncertainty
    robot: PandaRobot
    alignment: BaseAlignment
    lacking: Lacking | None = None

    @cached_property
    def rest_time(self) -> float:
        """Time, s, in which the arm creeps to rest but for a hundredth of the way: its slowest branch's."""
        model = self.arm.copy().compile()
        times = [model.dof_damping[part.branch] / model.tendon_stiffness[part.tendon]
                 for part in ArmModel(model).branches]  # fmt: skip
        return float(-np.log(CREEP) * np.max([time.max(initial=0.0) for time in times], initial=0.0))

    def tip_uncertainty(
        self,
        trajectory: CommandTrajectory,
        hangs: np.ndarray | None,
        session: ResidualMap | None = None,
        hysteresis: np.ndarray | None = None,
    ) -> TipUncertainty | TipUnknown:
        """By how far its tip may be elsewhere, at rest without a load where a trajectory ends; or why that is unknown.
        Cables that rub hold a future's tip where its way leaves it, within the friction band: it counts only without.
        hangs: where the straight arm's tip was seen where the trajectory begins, in the base frame, (3,), m. session:
        what is learnt of the arm, with what was measured in this session; it moves the tip and makes it no surer.
        hysteresis: by how far friction holds the twin's tip at the end, m (3,), world; what is learnt has that too."""
        if self.lacking is None:
            return TipUnknown("no trial at rest was held out, or the package is of an earlier release")
        places, bases = base_frames(trajectory.joints[[0, -1]], self.robot.mount_offset)
        base, commands = bases[-1], trajectory.commands[-1]
        gravity = base.T @ GRAVITY[0]
        arm = arm_of(self.arm.copy().compile())
        model = ArmModel(arm.model)
        order = model.actuators
        pulls = np.maximum(arm.chain.straight_lengths - commands[order], 0)
        learnt = self.lacking.residual_map
        shifted = session or learnt
        shift = None if shifted is None else self._shift(trajectory, arm, order, shifted, hysteresis)
        if beyond := self.lacking.beyond(pulls, float(np.degrees(tilt_of_gravity(gravity)))):
            return TipUnknown(beyond, shift)
        pose = StaticPoses(gravity[None], commands[None][:, order])
        ways, friction = arm.ways(pose)[0], np.zeros(3) if model.rubs else base @ arm.friction(pose)[0]
        if not np.isfinite(ways).all():
            return TipUnknown("the twin does not come to rest there", shift)
        hanging = None if hangs is None else Hanging(hangs, places[0], bases[0])
        uncertainty = TipUncertainty(self.lacking.discrepancy, ways, friction, self.alignment, base, hanging)
        if learnt is None:
            return replace(uncertainty, shift=shift)
        unknown = float(learnt.unknown(arm.resting(pose))[0])
        return replace(uncertainty, shift=shift, unknown=unknown, left=self.lacking.left)

    def _shift(
        self, trajectory: CommandTrajectory, arm: StaticArm, order: np.ndarray, learnt: ResidualMap,
        hysteresis: np.ndarray | None,
    ) -> TipShift:  # fmt: skip
        """By how far the tip rests beside that of `arm` along a trajectory, its cables in that `order` (K,), less what
        friction holds of it where poses tell: `hysteresis` at the end, before that in proportion to the pulls. Where
        the twin finds no rest, as before and after."""
        times = np.linspace(0, trajectory.duration, max(round(trajectory.duration / SHIFTED), 1) + 1)
        rows = trajectory.at(times)
        joints, commands = np.split(rows, [trajectory.joints.shape[1]], axis=1)
        bases = base_frames(joints, self.robot.mount_offset)[1]
        poses = StaticPoses(np.einsum("nji,j->ni", bases, GRAVITY[0]), commands[:, order])
        shifts = np.einsum("nij,nj->ni", bases, arm.shift(learnt, poses))
        rested = np.isfinite(shifts).all(axis=1)
        if hysteresis is not None and np.isfinite(hysteresis).all() and rested[-1]:
            resting = arm.resting(poses)
            pulled = np.linalg.norm(np.maximum(resting.pulls, 0), axis=1)
            share = np.clip(pulled / max(pulled[-1], UNPULLED), 0, 1)
            shifts = shifts - (share * (1 - learnt.unknown(resting)))[:, None] * hysteresis
        return TipShift(times[rested], shifts[rested]) if rested.any() else TipShift(times, np.zeros_like(shifts))

    def lean(self, hangs: np.ndarray | None) -> Rotation | None:
        """How the arm is turned on its mount, by the least turns, so that its tip, straight down, comes to rest in the
        direction of `hangs` (3,), m, in the base frame: what leans sags back a little. None where that is not seen."""
        if hangs is None:
            return None
        arm = self.arm.copy().compile()
        straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
        rotation = Rotation.identity()
        for _ in range(LEANS):
            tip = settle(arm, straight[None], rotation.inv().apply(GRAVITY)).position
            rotation = Rotation.align_vectors(hangs[None], rotation.apply(tip))[0] * rotation  # of one pair the least
        return rotation


def robot_model_of(settings: Previewing, files: dict[str, bytes]) -> RobotModel:
    """Out of the files of a package.

    Raises:
        InputError: it has nothing to preview with, or holds the arm by another robot.
    """
    x, y, z = settings.place
    contact = Contact(settings.friction, (x, y, z), float(np.radians(settings.turn_deg)))
    robot = package.robot_of(files)
    if not isinstance(robot, PandaRobot):
        raise InputError(f"package: found a robot of kind {robot.kind}, expected panda: plans move that")
    twin = Twin.of_package(files)
    return RobotModel(twin.spec, GraspUncertainty(contact, twin.posterior), robot, settings.alignment, twin.lacking)


def compose_twin(
    robot_model: RobotModel,
    world: World,
    object: WorldObject | None,
    joints: np.ndarray,
    commands: np.ndarray,
    settings: Previewing,
    lean: Rotation | None = None,
    left: np.ndarray | None = None,
) -> ComposedTwin:
    """The twin at rest at `joints` (7,), rad, its motors at `commands` (K,), m, beside an object that hangs or stands;
    `lean` is how its arm is turned on its mount, None where nobody has seen that. With an object in the arm all is as
    an earlier preview `left` it: the pose (nq,) at its end, of a model with a string or without."""
    robot = replace(robot_model.robot, ready=joints.tolist())
    boards, placed = {obstacle.name: _surface(obstacle) for obstacle in world.obstacles}, None
    if object is not None:
        place, turn = np.array(object.position), object.quaternion
        sizes = object.shape, object.diameter, object.height, object.mass
        shaped = GraspObject(*sizes, settings.material, basket=object.basket)
        if object.support == "standing":
            turn = _upright(turn)
            _stand(place, shaped.half_height, list(boards.values()))
        placed = Placed(shaped, place, turn)
    spec = compose(robot_model.arm, robot, Room(None, boards, None), placed)
    lean = lean or Rotation.identity()
    spec.body("base").quat = wxyz_from_rotation(lean)
    if object is not None and object.support == "hanging":
        hang(spec, np.array(object.position), object.diameter / 2, settings.string)
    twin = ComposedTwin(spec.compile(), robot_model.arm.copy().compile()).stepped(settings.step)
    if left is None:
        return at_rest(twin, joints, commands, robot.mount_offset, lean)
    return replace(twin, start=left[: twin.model.nq].copy())  # a string, which comes last, is left out


def at_rest(
    twin: ComposedTwin, joints: np.ndarray, commands: np.ndarray, mount_offset: float, lean: Rotation | None = None
) -> ComposedTwin:
    """The same twin, its arm at rest at other `joints` (7,), rad, and `commands` (K,), m."""
    start = _start(twin.model, twin.arm, joints, commands, mount_offset, lean or Rotation.identity())
    return replace(twin, start=start)


def _start(
    model: mujoco.MjModel,
    arm: mujoco.MjModel,
    joints: np.ndarray,
    commands: np.ndarray,
    mount_offset: float,
    lean: Rotation,
) -> np.ndarray:
    """The composed model's pose (nq,) with the arm at rest."""
    base = base_frames(joints, mount_offset)[1]
    gravity = lean.inv().apply(base.T @ GRAVITY[0])
    rest = settle(arm, commands[None], gravity).qpos[0]
    pose = model.qpos0.copy()
    pose[model.jnt_qposadr[panda_joints(model)]] = joints
    for number in range(arm.njnt):
        name = arm.joint(number).name
        if name:
            pose[model.joint(name).qposadr[0]] = rest[arm.jnt_qposadr[number]]
    return pose


def _upright(quaternion: Quaternion) -> Quaternion:
    """Its turn about the vertical alone."""
    w, _, _, z = quaternion
    return unit((w, 0.0, 0.0, z))


def _stand(place: np.ndarray, half_height: float, surfaces: list[SupportSurface]) -> None:
    """Put the board under `place` (3,), m, to where what stands there says that it is: both are seen not quite true."""
    under = [board for board in surfaces if (np.abs(place[:2] - board.top[:2]) <= np.array(board.size[:2]) / 2).all()]
    if under:
        highest = max((board for board in under if board.top[2] < place[2]), key=lambda board: board.top[2])
        highest.top[2] = float(place[2] - half_height)


def _surface(obstacle: Obstacle) -> SupportSurface:
    low, high = np.array(obstacle.low), np.array(obstacle.high)
    return SupportSurface([*((low + high) / 2)[:2].tolist(), float(high[2])], (high - low).tolist(), "wood")
