"""Grasps tried in a batch: the arm closes on an object, which then loses its support, and the mount shakes.

The mount stands still. To lift is to take the support away: the hook lets go, and tables sink at the speed at which the
arm would rise. To shake the mount with acceleration a is to shake gravity, g - a, in its frame: an object that the arm
holds cannot tell, and what stands below is gone by then.
"""

import re
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.elements import actuators, give_way
from trunkline.frames import STANDARD_GRAVITY
from trunkline.simulation.motion import batch_of, hold, move
from trunkline.simulation.winch import Winches

Seconds = Annotated[float, Field(gt=0, le=60)]
BLOCK = 0.025  # s in which gravity and supports stand still
PAID_OUT = 0.2  # m, of a cable that does not pull: out of the way of any bend
PAY_TIME = 0.3  # s, in which it is paid out
UNIT_CENTER = re.compile(r"unit_\d+_center")
RECORD = ("qpos", "site_xpos")


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
class Tried:
    """B grasps.

    Attributes:
        path: of the object's centre in the world, every BLOCK s, m. Shape (B, F, 3). NaN once MuJoCo has warned.
        distance: from there to the centre of the nearest unit, m. Shape (B, F).
        let_go: the row from which the object had no support.
        tensions: of the cables when the object was let go, N. Shape (B, K).
    """

    path: np.ndarray
    distance: np.ndarray
    let_go: int
    tensions: np.ndarray

    @property
    def dropped(self) -> np.ndarray:
        """How far the object came from where it was let go, at last, m. Shape (B,)."""
        return np.linalg.norm(self.path[:, -1] - self.path[:, self.let_go], axis=1)

    def held(self, sag: float, slip: float) -> np.ndarray:
        """Whether the object ended within `sag` m of where it was let go, and no further than `slip` m more from the
        arm's nearest unit. The arm itself may swing. Shape (B,)."""
        with np.errstate(invalid="ignore"):
            return (self.dropped < sag) & (self.distance[:, -1] < self.distance[:, self.let_go] + slip)


def try_grasps(
    model: mujoco.MjModel,
    poses: np.ndarray,
    masses: np.ndarray,
    pulls: np.ndarray,
    schedule: Schedule,
    surfaces: tuple[str, ...] = (),
    friction: np.ndarray | None = None,
) -> Tried:
    """Try B grasps, which begin with the arm hanging straight.

    Args:
        model: composed on a fixed mount, with a body `object`, which may hang by equality `hanging`.
        poses: of the object at first, position, m, and quaternion. Shape (B, 7). A hook moves along with it.
        masses: kg. Shape (B,).
        pulls: how much shorter than in the straight arm each cable is commanded, m; one of 0 is paid out. Shape (B, K).
        surfaces: geoms that sink.
        friction: sliding coefficients of the objects, in place of the model's. Shape (B,).
    """
    count, timestep = len(poses), model.opt.timestep
    batch = batch_of(model, count)
    _weigh(batch, model, masses)
    if friction is not None:
        geom = model.geom("object_geom").id
        own = model.geom_friction[geom]
        batch.expand("geom_friction")[:, geom, :2] = np.outer(friction, [1, own[1] / own[0]])
    address = model.jnt_qposadr[model.joint("object").id]
    place, gravity = batch.bind("qpos"), batch.expand("opt.gravity")
    give_way(model, place)
    place[:, address : address + 7] = poses
    tie = _hang(batch, model, poses)
    tables = [model.geom(name).id for name in surfaces]
    heights = batch.expand("geom_pos") if tables else None

    steps, own = round(BLOCK / timestep), np.arange(count, dtype=np.int32)
    straight = model.tendon_length0[model.actuator_trnid[actuators(model), 0]]
    held = np.tile(straight, (count, 1))
    hold(batch, model, held)
    winches = Winches(batch, held)
    blocks = round(schedule.length / BLOCK)
    centers = [site for site in range(model.nsite) if UNIT_CENTER.fullmatch(model.site(site).name)]
    distance = np.full((count, blocks), np.nan)
    path, tensions = np.full((count, blocks, 3), np.nan), np.full((count, len(straight)), np.nan)
    moving, let_go = own, round(schedule.let_go / BLOCK)
    for block in range(blocks):
        time = block * BLOCK
        gravity[:] = model.opt.gravity - schedule.acceleration(time)
        if block == let_go:
            tensions[moving] = -batch.bind("actuator_force")[moving][:, actuators(model)]
            if tie is not None:
                batch.bind("eq_active")[:, tie] = 0
        if block >= let_go and heights is not None:
            heights[:, tables, 2] -= schedule.sink * BLOCK
        commands = straight + _drawn(pulls[moving], time + timestep * np.arange(steps), schedule.close)
        found = move(batch, winches.deliver(commands, moving), RECORD, steps, steps - 1, ids=moving)
        path[moving, block] = found["qpos"][:, 0, address : address + 3]
        away = found["site_xpos"][:, 0, centers] - path[moving, block, None]
        distance[moving, block] = np.linalg.norm(away, axis=2).min(axis=1)
        moving = moving[~batch.warning[moving].any(axis=(1, 2))]
        if not len(moving):
            break
    path[batch.warning.any(axis=(1, 2)), -1] = np.nan
    return Tried(path, distance, let_go, tensions)


def _drawn(pulls: np.ndarray, time: np.ndarray, close: float) -> np.ndarray:
    """Commands at `time` (T,), less the straight arm's, m. Shape (B, T, K)."""
    drawn, paid = np.minimum(time / close, 1)[:, None], np.minimum(time / PAY_TIME, 1)[:, None]
    return np.where(pulls[:, None] > 0, -pulls[:, None] * drawn, PAID_OUT * paid)


def _weigh(batch, model: mujoco.MjModel, masses: np.ndarray) -> None:
    """Give each object its mass, its inertia in proportion."""
    body = model.body("object").id
    batch.expand("body_mass")[:, body] = masses
    batch.expand("body_inertia")[:, body] = model.body_inertia[body] * (masses / model.body_mass[body])[:, None]
    batch.set_const()


def _hang(batch, model: mujoco.MjModel, poses: np.ndarray) -> int | None:
    """Put each hook where the object's own pose asks for it; the number of the equality, None where nothing hangs."""
    tie = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_EQUALITY, "hanging")
    if tie < 0:
        return None
    anchors = batch.expand("eq_data")
    for row, pose in enumerate(poses):
        above = np.zeros(3)
        mujoco.mju_rotVecQuat(above, model.eq_data[tie, :3], pose[3:])
        anchors[row, tie, 3:6] = pose[:3] + above
    return tie
