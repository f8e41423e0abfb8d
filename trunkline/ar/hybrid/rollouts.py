"""Futures of a plan: composed models, each with its own parameters, friction and place of the object, in one batch.

The identified parameters are written into the arm's own model, which has the places that they know, and carried over
to the composed model by the names of joints, tendons, actuators and numbers, as there all have other places.

Most of the cost is the contact solver's, so contacts are as few and as soft as outcomes allow: `eased`.
"""

import copy
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.spatial.transform import Rotation

from trunkline.ar.hybrid.compose import panda_joints
from trunkline.ar.hybrid.objects import GRIP, object_geoms
from trunkline.ar.hybrid.string import EYE, STRING
from trunkline.ar.hybrid.torques import joint_torques, servo_commands
from trunkline.ar.hybrid.uncertainty import PosteriorSamples
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.identification.parameters.parameters import DERIVED_FROM, candidate_fields
from trunkline.identification.parameters.saving import ELEMENTS
from trunkline.kinematics.panda.maker_model import JOINTS
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.model.simulation.winch import Winches

FRAME = 1 / 60  # s, about, between frames of a motion
FRAMES = 15  # of a piece: 0.25 s
BESIDE = 0.004  # s to both sides, of what tells how fast a plan goes
EASED_IMPRATIO = 10.0  # friction over normal impedance: what is held creeps more, but far less than counts as a slip
UNIT_CENTER = re.compile(r"unit_\d+_center")
RECORD = ("qpos", "site_xpos", "xpos", "xquat")


@dataclass(frozen=True)
class CommandTrajectory:
    """Rows every `step` s of what is commanded: `joints` of the Panda (T, 7), rad, or (T, 0) on a fixed mount, and
    `commands` of the motors (T, K), m. `let_go`: s after which what hangs is let go, None for never."""

    step: float
    joints: np.ndarray
    commands: np.ndarray
    let_go: float | None = None

    @property
    def duration(self) -> float:
        """s."""
        return self.step * (len(self.commands) - 1)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Joints and commands at `time` (n,), s, linear between rows; the ends are held. Shape (n, 7 + K)."""
        rows = np.column_stack([self.joints, self.commands])
        place = np.clip(time / self.step, 0, len(rows) - 1)
        before = place.astype(int)
        after, share = np.minimum(before + 1, len(rows) - 1), (place - before)[:, None]
        return (1 - share) * rows[before] + share * rows[after]


@dataclass(frozen=True)
class ComposedTwin:
    """A composed `model`, and the `arm` in it by itself, both compiled of the same spec. The model has the state in
    which all begins as `start` (nq,), the arm straight by default."""

    model: mujoco.MjModel
    arm: mujoco.MjModel
    start: np.ndarray | None = None

    def stepped(self, timestep: float) -> "ComposedTwin":
        """The same with another time step, s: a coarser one costs less."""
        model = copy.copy(self.model)
        model.opt.timestep = timestep
        return ComposedTwin(model, self.arm, self.start)

    @cached_property
    def centers(self) -> list[int]:
        """Numbers of the sites in the units' centres."""
        model = self.model
        return [site for site in range(model.nsite) if UNIT_CENTER.fullmatch(model.site(site).name)]


@dataclass(frozen=True)
class Piece:
    """F frames of B futures, F of FRAMES or fewer, positions in the world, m.

    Attributes:
        time: of each frame, s. Shape (F,).
        qpos: of the composed model. Shape (B, F, nq).
        tip, mount: of the arm. Shape (B, F, 3).
        object: position and quaternion of what is grasped. Shape (B, F, 7); NaN where there is none.
        grip: the middle of what the arm wraps of it, likewise. Shape (B, F, 3).
        away: from there to the centre of the nearest unit, m. Shape (B, F).
        sound: whether MuJoCo has not warned. A future that is not sound stands still. Shape (B,).
    """

    time: np.ndarray
    qpos: np.ndarray
    tip: np.ndarray
    mount: np.ndarray
    object: np.ndarray
    grip: np.ndarray
    away: np.ndarray
    sound: np.ndarray


def rollouts(twin: ComposedTwin, trajectory: CommandTrajectory, samples: PosteriorSamples) -> Iterator[Piece]:
    """Simulate the futures, piece by piece, each as soon as it is done.

    Raises:
        InputError: the plan has another number of joints or cables than the model.
    """
    model, count = twin.model, len(samples)
    joints, motors = panda_joints(model), ArmModel(model).actuators
    if trajectory.joints.shape[1:] != (len(joints),) or trajectory.commands.shape[1:] != (len(motors),):
        raise InputError(
            f"plan: found {trajectory.joints.shape[1]} joints and {trajectory.commands.shape[1]} cables, "
            f"expected {len(joints)} and {len(motors)}"
        )
    ties = [tie for name in ("hanging", EYE) if (tie := _number(model, mujoco.mjtObj.mjOBJ_EQUALITY, name)) >= 0]
    batch = batch_of(eased(model, bool(ties)), count)
    _set_parameters(batch, twin, samples)
    _place(batch, model, twin.start, trajectory, samples)
    timestep = model.opt.timestep
    every = max(round(FRAME / timestep), 1)
    frames = max(round(trajectory.duration / (every * timestep)), 1)
    servos = _servos(model, trajectory, twin.start)
    first = np.zeros((count, model.nu))
    first[:, motors] = trajectory.commands[0]
    first[:, servos.motors] = servos.at(np.zeros(1), trajectory.joints[:1])
    hold(batch, model, first)
    winches, simulations = Winches(batch, first[:, motors]), np.arange(count, dtype=np.int32)
    for begin in range(0, frames, FRAMES):
        number = min(FRAMES, frames - begin)
        time = timestep * (begin * every + np.arange(number * every))
        if ties and trajectory.let_go is not None and time[0] >= trajectory.let_go - timestep / 2:
            batch.bind("eq_active")[:, ties] = 0
        rows = trajectory.at(time)
        controls = np.zeros((count, len(time), model.nu))
        controls[:, :, servos.motors] = servos.at(time, rows[:, : len(joints)])
        sent = np.repeat(rows[None, :, len(joints) :], count, axis=0)
        controls[:, :, motors] = winches.deliver(sent, simulations)
        recorded = move(batch, controls, RECORD, every, every - 1)
        yield _piece(twin, batch, time[every - 1 :: every], recorded)


def eased(model: mujoco.MjModel, hanging: bool) -> mujoco.MjModel:
    """A copy with contacts that cost less: of less stiff friction, and of what hangs, one point for each unit of the
    arm that touches it, round as both are. What stands needs several, or it would rock."""
    model = copy.copy(model)
    model.opt.impratio = min(EASED_IMPRATIO, model.opt.impratio)
    if hanging:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
    return model


@dataclass(frozen=True)
class _Servos:
    """By how much the servos `motors` are sent `beyond` (N, 7), rad, where the plan says, at `times` (N,), s; none on a
    fixed mount."""

    motors: list[int]
    times: np.ndarray
    beyond: np.ndarray

    def at(self, time: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """What they are sent at `time` (n,), s, so that they stand at `angles` (n, 7), rad. Shape (n, 7)."""
        columns = [np.interp(time, self.times, column) for column in self.beyond.T]
        return angles + (np.column_stack(columns) if columns else 0.0)


def _servos(model: mujoco.MjModel, trajectory: CommandTrajectory, start: np.ndarray | None) -> _Servos:
    """What the Panda's servos are sent so that they stand where the plan says, bearing the arm as it is at first.

    A servo's torque is k_p (u - q) - k_v q̇, so u = q + (k_v q̇ + τ) / k_p.
    """
    joints = panda_joints(model)
    times = FRAME * np.arange(int(np.ceil(trajectory.duration / FRAME)) + 1)
    if not len(joints):
        return _Servos([], times, np.zeros((len(times), 0)))
    motors = [model.actuator(f"{name}_position").id for name in JOINTS]
    before, angles, after = (trajectory.at(times + part * BESIDE)[:, : len(joints)] for part in (-1, 0, 1))
    speeds, gains = (after - before) / (2 * BESIDE), (after - 2 * angles + before) / BESIDE**2
    qpos = np.tile(model.qpos0 if start is None else start, (len(times), 1))
    qvel, qacc = np.zeros((2, len(times), model.nv))
    qpos[:, model.jnt_qposadr[joints]] = angles
    qvel[:, model.jnt_dofadr[joints]], qacc[:, model.jnt_dofadr[joints]] = speeds, gains
    stand = servo_commands(model, angles, joint_torques(model, qpos, qvel, qacc))
    ratio = -model.actuator_biasprm[motors, 2] / model.actuator_gainprm[motors, 0]
    return _Servos(motors, times, stand - angles + ratio * speeds)


def _set_parameters(batch: Batch, twin: ComposedTwin, samples: PosteriorSamples) -> None:
    """Give each future its own parameters."""
    if not samples.values:
        return
    fields = candidate_fields(twin.arm, samples.values)
    for name, values in fields.items():
        batch.expand(name)[:, rows_of(name, twin.model, twin.arm)] = values[:, rows_of(name, twin.arm, twin.arm)]
    if DERIVED_FROM & fields.keys():
        batch.set_const()


def rows_of(field: str, model: mujoco.MjModel, arm: mujoco.MjModel) -> np.ndarray:
    """Where in `field` of `model` the elements of `arm` have their values, in the arm's order.

    Of numbers, of joints with one angle, and of elements with names; nameless ones are left out, and where masses are
    concerned the mount, which is the robot's.
    """
    kind, row_of = ELEMENTS[field.partition("_")[0]]
    counts = {"joint": arm.njnt, "body": arm.nbody, "geom": arm.ngeom, "site": arm.nsite, "tendon": arm.ntendon,
              "actuator": arm.nu, "numeric": arm.nnumeric}  # fmt: skip
    names = [getattr(arm, kind)(number).name for number in range(counts[kind])]
    if field in ("body_mass", "body_inertia"):
        names = [name for name in names if name != "base"]
    rows = [np.atleast_1d(row_of(model, getattr(model, kind)(name).id)) for name in names if name]
    return np.concatenate(rows) if rows else np.zeros(0, dtype=int)


def _place(
    batch: Batch,
    model: mujoco.MjModel,
    start: np.ndarray | None,
    trajectory: CommandTrajectory,
    samples: PosteriorSamples,
) -> None:
    """Put robot and object where they begin, and give the object its friction."""
    places = batch.bind("qpos")
    if start is not None:
        places[:] = start
    else:
        places[:, model.jnt_qposadr[panda_joints(model)]] = trajectory.joints[0]
        ArmModel(model).unload_branches(places)
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "object")
    if joint < 0:
        return
    address = model.jnt_qposadr[joint]
    pose = places[:, address : address + 7]
    turned = Rotation.from_rotvec(np.outer(samples.turns, [0, 0, 1])) * rotation_from_wxyz(pose[:, 3:])
    pose[:, 3:] = np.where(samples.turns[:, None] != 0, wxyz_from_rotation(turned), pose[:, 3:])
    pose[:, :3] += samples.offsets
    friction = batch.expand("geom_friction")
    for geom in object_geoms(model):
        friction[:, geom, :2] *= samples.friction[:, None]
    tie = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_EQUALITY, "hanging")
    if (string := _number(model, mujoco.mjtObj.mjOBJ_BODY, STRING)) >= 0:  # its hook moves along
        batch.expand("body_pos")[:, string] += samples.offsets
    if tie >= 0:  # the hook moves along
        arms = rotation_from_wxyz(pose[:, 3:]).apply(model.eq_data[tie, :3])
        batch.expand("eq_data")[:, tie, 3:6] = pose[:, :3] + arms
    if string < 0 and tie < 0:  # what it stands on moves along
        batch.expand("geom_pos")[:, model.geom_bodyid == 0] += samples.offsets[:, None]


def _number(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Of what is called so, -1 where there is none."""
    return mujoco.mj_name2id(model, kind, name)


def _piece(twin: ComposedTwin, batch: Batch, time: np.ndarray, recorded: dict[str, np.ndarray]) -> Piece:
    model = twin.model
    tip, mount = model.site("tip").id, model.body("base").id
    count, number = recorded["qpos"].shape[:2]
    object = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "object")
    pose, away = np.full((count, number, 7), np.nan), np.full((count, number), np.nan)
    grip = pose[:, :, :3]
    if object >= 0:
        pose = np.concatenate([recorded["xpos"][:, :, object], recorded["xquat"][:, :, object]], axis=2)
        sites = recorded["site_xpos"]
        grip = sites[:, :, model.site(GRIP).id]
        gaps = sites[:, :, twin.centers] - grip[:, :, None]
        away = np.linalg.norm(gaps, axis=3).min(axis=2)
    sound = ~batch.warning.any(axis=(1, 2))
    tips, mounts = recorded["site_xpos"][:, :, tip], recorded["xpos"][:, :, mount]
    return Piece(time, recorded["qpos"], tips, mounts, pose, grip, away, sound)
