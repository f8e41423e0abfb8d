"""Grasps tried in a batch: the arm closes on an object, which then loses its support, and the mount shakes.

The mount stands still at the origin. To lift is to take the support away: the hook lets go, and tables sink at the
speed at which the arm would rise. To shake the mount with acceleration a is to shake gravity, g - a: an object that the
arm holds cannot tell, and what stands below is gone by then.
"""

import re
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
from mujoco.batch import Batch
from pydantic import Field

from trunkline.ar.hybrid.objects import GRIP, object_geoms
from trunkline.ar.hybrid.outcomes import stays
from trunkline.ar.hybrid.worlds import HOOK_LENGTH
from trunkline.frames import STANDARD_GRAVITY, rotation_from_wxyz
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.model.simulation.winch import Winches

Seconds = Annotated[float, Field(gt=0, le=60)]
BLOCK = 0.025  # s in which gravity and supports stand still
PAID_OUT = 0.2  # m, of a cable that does not pull: out of the way of any bend
PAY_TIME = 0.3  # s, in which it is paid out
UNIT_CENTER = re.compile(r"unit_\d+_center")
RECORD = ("site_xpos",)


@dataclass
class Schedule:
    """close: s in which cables are drawn in. settle: s until the object is let go. lift: s. sink: m/s, of a support.

    shake: m/s², amplitude, along x, y and z in turn, each for `shakes` periods of `period` s. hold: s afterwards.
    """

    close: Seconds = 1.0
    settle: Seconds = 0.75
    lift: Seconds = 0.75
    sink: Annotated[float, Field(gt=0, le=2)] = 0.2
    shake: Annotated[float, Field(ge=0, le=50)] = 0.2 * STANDARD_GRAVITY
    period: Seconds = 0.5
    shakes: Annotated[int, Field(ge=0, le=100)] = 1
    hold: Seconds = 0.5

    @property
    def let_go(self) -> float:
        """When the object loses its support, s."""
        return self.close + self.settle

    @property
    def length(self) -> float:
        """s."""
        return self.let_go + self.lift + 3 * self.period * self.shakes + self.hold

    def acceleration(self, time: float) -> np.ndarray:
        """Of the mount at `time`, s, in the world, m/s². Shape (3,)."""
        begun = time - self.let_go - self.lift
        axis = int(begun // (self.period * self.shakes)) if begun >= 0 and self.shakes else 3
        if axis > 2:
            return np.zeros(3)
        return self.shake * np.sin(2 * np.pi * begun / self.period) * np.eye(3)[axis]


@dataclass
class Tries:
    """B grasps to be tried.

    Attributes:
        poses: of the objects in the base frame at first, position, m, and quaternion. Shape (B, 7). A hook moves along.
        masses: kg. Shape (B,).
        pulls: how much shorter than in the straight arm each cable is commanded, m; one of 0 is paid out. Shape (B, K).
        friction: sliding coefficients of the objects. Shape (B,).
    """

    poses: np.ndarray
    masses: np.ndarray
    pulls: np.ndarray
    friction: np.ndarray

    def __len__(self) -> int:
        return len(self.poses)


@dataclass
class Tried:
    """B grasps.

    Attributes:
        path: of the middle of what the arm wraps of the object, in the base frame, every BLOCK s, m. Shape (B, F, 3).
            NaN once MuJoCo has warned.
        distance: from there to the centre of the nearest unit, m. Shape (B, F).
        let_go: the row from which the object had no support.
    """

    path: np.ndarray
    distance: np.ndarray
    let_go: int

    @property
    def dropped(self) -> np.ndarray:
        """How far the object came from where it was let go, at last, m. Shape (B,)."""
        return np.linalg.norm(self.path[:, -1] - self.path[:, self.let_go], axis=1)

    def success(self, sag: float, slip: float) -> np.ndarray:
        """Whether the object ended within `sag` m of where it was let go, and no further than `slip` m more from the
        arm's nearest unit. The arm itself may swing. Shape (B,)."""
        with np.errstate(invalid="ignore"):
            return stays(self.dropped, self.distance[:, self.let_go], self.distance[:, -1], sag, slip)


def try_grasps(model: mujoco.MjModel, tries: Tries, schedule: Schedule, surfaces: tuple[str, ...] = ()) -> Tried:
    """Try B grasps, the arm straight at first.

    Args:
        model: composed on a fixed mount at the origin, with a body `object`, which may hang by equality `hanging`.
        surfaces: geoms that sink.
    """
    count, timestep, address = len(tries), model.opt.timestep, model.jnt_qposadr[model.joint("object").id]
    batch = batch_of(model, count)
    _set_up(batch, model, tries)
    place, gravity, geoms = batch.bind("qpos"), batch.expand("opt.gravity"), batch.expand("geom_pos")
    arm = ArmModel(model)
    straight = model.tendon_length0[model.actuator_trnid[arm.actuators, 0]]
    initial = np.tile(straight, (count, 1))
    place[:, address : address + 7] = tries.poses
    arm.unload_branches(place)
    tie = _hang(batch, model, tries.poses)

    steps, simulations = round(BLOCK / timestep), np.arange(count, dtype=np.int32)
    hold(batch, model, initial)
    winches = Winches(batch, initial)
    blocks = round(schedule.length / BLOCK)
    centers = [site for site in range(model.nsite) if UNIT_CENTER.fullmatch(model.site(site).name)]
    distance, path = np.full((count, blocks), np.nan), np.full((count, blocks, 3), np.nan)
    grip, sinking = model.site(GRIP).id, [model.geom(name).id for name in surfaces]
    moving, let_go = simulations, round(schedule.let_go / BLOCK)
    for block in range(blocks):
        time = block * BLOCK
        gravity[:] = model.opt.gravity - schedule.acceleration(time)
        if block == let_go and tie is not None:
            batch.bind("eq_active")[:, tie] = 0
        if block >= let_go:
            geoms[:, sinking, 2] -= schedule.sink * BLOCK
        times = time + timestep * np.arange(steps)
        commands = straight + _drawn(tries.pulls[moving], times, schedule.close)
        recorded = move(batch, winches.deliver(commands, moving), RECORD, steps, steps - 1, ids=moving)
        path[moving, block] = recorded["site_xpos"][:, 0, grip]
        away = recorded["site_xpos"][:, 0, centers] - path[moving, block, None]
        distance[moving, block] = np.linalg.norm(away, axis=2).min(axis=1)
        moving = moving[~batch.warning[moving].any(axis=(1, 2))]
        if not len(moving):
            break
    path[batch.warning.any(axis=(1, 2)), -1] = np.nan
    return Tried(path, distance, let_go)


def _drawn(pulls: np.ndarray, time: np.ndarray, close: float) -> np.ndarray:
    """Commands at `time` (T,), less the straight arm's, m, from straight to `pulls` (B, K). Shape (B, T, K)."""
    drawn, paid = np.minimum(time / close, 1)[:, None], np.minimum(time / PAY_TIME, 1)[:, None]
    pulls = pulls[:, None]
    return np.where(pulls > 0, -drawn * pulls, paid * PAID_OUT)


def _set_up(batch: Batch, model: mujoco.MjModel, tries: Tries) -> None:
    """Give each simulation the friction and the mass of its object."""
    body = model.body("object").id
    for geom in object_geoms(model):
        friction = model.geom_friction[geom]
        batch.expand("geom_friction")[:, geom, :2] = np.outer(tries.friction, [1, friction[1] / friction[0]])
    batch.expand("body_mass")[:, body] = tries.masses
    batch.expand("body_inertia")[:, body] = model.body_inertia[body] * (tries.masses / model.body_mass[body])[:, None]
    batch.set_const()


def _hang(batch: Batch, model: mujoco.MjModel, poses: np.ndarray) -> int | None:
    """Put each hook where the object's own pose asks for it; the number of the equality, None where nothing hangs."""
    tie = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_EQUALITY, "hanging")
    if tie < 0:
        return None
    ends = poses[:, :3] + rotation_from_wxyz(poses[:, 3:]).apply(model.eq_data[tie, :3])
    batch.expand("eq_data")[:, tie, 3:6] = ends
    batch.expand("geom_pos")[:, model.geom("hook").id] = ends + [0, 0, HOOK_LENGTH / 2]
    return tie
