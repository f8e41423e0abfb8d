"""What forbids a plan: the rigid robot's range, the robot in its own way, an obstacle in its way or the arm's.

The arm is taken to be where it rests under what its motors are sent at that instant: what swings is not seen here, nor
what a cable's friction holds back. Of an object, the arm's way is looked at until it closes about it; what comes then
is for the preview to show.
"""

import numpy as np

from trunkline.ar.teleop.messages import World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.kinematics import FLANGE, Q_MAX, Q_MIN, joint_frames, mount_pose
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import actuated
from trunkline.model.statics.placement import joint_positions

LINK_RADIUS = 0.08  # m, about the joints' centres and the mount, that no obstacle may come into
EVERY = 0.04  # s between poses of the arm that are looked at


def check_plan(plan: Plan, world: World, mount_offset: float, chain: Chain | None = None) -> None:
    """Refuse a plan whose way is not free, of the arm only where its statics are known: the `chain`.

    A plan may be of one row.

    Raises:
        InputError: a joint beyond its limits, the robot touching itself, or one of its joints or the arm's axis in an
            obstacle.
    """
    for joint in range(JOINTS):
        angles = plan.joints[:, joint]
        if angles.min() < Q_MIN[joint] or angles.max() > Q_MAX[joint]:
            raise InputError(f"limit: joint {joint + 1} of the rigid robot would leave its range on the way")
    gaps = clearance(plan.joints, mount_offset)
    if gaps.min() <= 0:
        when = _when(plan, int(np.argmin(gaps)))
        raise InputError(f"self-collision: the robot would touch itself{when}, by {-1e3 * gaps.min():.0f} mm")
    frames, every = joint_frames(plan.joints), np.arange(len(plan.joints))
    mount = frames[-1].p + (FLANGE + mount_offset) * frames[-1].z
    moving = [
        (f"joint {i + 1} of the rigid robot", frame.p.T[:, None], every, LINK_RADIUS)
        for i, frame in enumerate(frames)
        if i >= 2
    ]
    moving.append(("mount of the rigid robot", mount.T[:, None], every, LINK_RADIUS))
    if chain is not None and (end := _closes(plan)):
        rows = np.unique(np.append(every[: end : max(round(EVERY / plan.step), 1)], end - 1))
        moving.append(("the arm", _arm(plan, rows, mount_offset, chain), rows, 0.0))
    for obstacle in world.obstacles:
        for name, places, rows, radius in moving:
            away = np.linalg.norm(np.maximum(np.maximum(obstacle.low - places, places - obstacle.high), 0.0), axis=2)
            inside = np.flatnonzero((away <= radius).any(axis=1))
            if len(inside):
                raise InputError(f"world: {name} would come into {obstacle.name}{_when(plan, int(rows[inside[0]]))}")


def _when(plan: Plan, row: int) -> str:
    return f" after {plan.step * row:.2f} s" if len(plan.joints) > 1 else ""


def _closes(plan: Plan) -> int:
    """The row from which on the arm holds an object, or closes about one."""
    phases = dict(plan.phases)
    if "transfer" in phases:
        return 0
    return phases["curl"] if "lift" in phases else len(plan.joints)


def _arm(plan: Plan, rows: np.ndarray, mount_offset: float, chain: Chain) -> np.ndarray:
    """Joints and tip of the arm at rest at `rows` (N,), (N, P, 3), m. Where it finds no rest it is left out: NaN."""
    mount, flange = mount_pose(plan.joints[rows], mount_offset)
    turn = flange * [1, -1, -1]  # the soft base: half a turn about the flange's x
    rest = actuated(chain, plan.commands[rows], -STANDARD_GRAVITY * turn[:, 2])
    places = joint_positions(chain, rest.qpos)
    places[~rest.converged] = np.nan
    return mount[:, None] + np.einsum("nij,npj->npi", turn, places)
