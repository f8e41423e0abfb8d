"""Spot check of the hybrid map: for a point, a rigid pose and tendon lengths that bring the soft tip there.

The soft arm's base frame is the mount's turned by half a turn about x, so that its z axis points up while the
end effector points down. With the tip at c in that frame and the base turned by yaw about the vertical, the
mount must be at p = x - Rot_z(yaw) c. Pairs (c, yaw) whose p lies deepest inside the rigid map are tried.
"""

from typing import NamedTuple

import numpy as np

from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.panda.inverse import solve
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.panda.labels import beyond_links
from trunkline.kinematics.residual.residual_map import ResidualMap, moved
from trunkline.kinematics.sdf.grid import Lattice
from trunkline.model.statics.chain import FORCE_ROUNDING, Chain
from trunkline.model.statics.equilibria import forward

COARSE_YAWS, FINE_YAWS = 24, 72
COARSE_TIPS = 600
TRIES = 4  # pairs per point that go to inverse kinematics
STARTS = 40
CLOSE = 1e-3  # m, how near its point a tip must come out when a pose is verified
DEEP = -0.01  # m; a pair whose mount lies this deep needs no finer search


class ReachingPoses(NamedTuple):
    """How each of N points is reached.

    `reached` (N,); `q` (N, 7) in rad; `tip` (N,), index of the soft sample; `yaw` (N,) of the soft arm's
    base in rad. Rows that are not reached hold nothing of use.
    """

    reached: np.ndarray
    q: np.ndarray
    tip: np.ndarray
    yaw: np.ndarray


def find_poses(
    points: np.ndarray,
    tips: np.ndarray,
    rigid: np.ndarray,
    lattice: Lattice,
    *,
    seed: int,
    mount_offset: float,
    avoid_collisions: bool,
) -> ReachingPoses:
    """Rigid pose and soft sample for each of `points`.

    Args:
        points: where the soft tip shall be, (N, 3) in m in the Panda's base frame.
        tips: of the soft arm at gravity angle 0, (M, 3) in m in its base frame.
        rigid: signed distance field of the rigid map on `lattice`, in m.
        seed: of the solver's starts and of the choice of tips for the first look.
        mount_offset: from the flange to the mount, in m.
        avoid_collisions: whether poses in which the Panda touches itself count.
    """
    few = np.random.default_rng(seed).permutation(len(tips))[:COARSE_TIPS]
    poses = ReachingPoses(np.zeros(len(points), bool), np.zeros((len(points), 7)), np.zeros(len(points), int),
                  np.zeros(len(points)))
    tip, yaw = np.zeros((len(points), TRIES), int), np.zeros((len(points), TRIES))
    for i, point in enumerate(points):
        index, turn, depth = _deepest(point, tips[few], COARSE_YAWS, rigid, lattice)
        index = few[index]
        if depth[0] > DEEP:
            index, turn, depth = _deepest(point, tips, FINE_YAWS, rigid, lattice)
        tip[i], yaw[i] = index, turn
    for attempt in range(TRIES):
        left = np.flatnonzero(~poses.reached)
        mounts, rotations = mount_for_tips(points[left], tips[tip[left, attempt]], yaw[left, attempt])
        near = ~beyond_links(mounts, mount_offset)
        left, mounts, rotations = left[near], mounts[near], rotations[near]
        result = solve(mounts, rotations, seed=seed + attempt, starts=STARTS, mount_offset=mount_offset,
                       avoid_collisions=avoid_collisions)
        at = left[result.success]
        poses.reached[at], poses.q[at] = True, result.q[result.success]
        poses.tip[at], poses.yaw[at] = tip[at, attempt], yaw[at, attempt]
    return poses


def verified(
    points: np.ndarray,
    poses: ReachingPoses,
    lengths: np.ndarray,
    chain: Chain,
    mount_offset: float,
    weight: bool = True,
    learnt: ResidualMap | None = None,
) -> np.ndarray:
    """Whether joint angles and tendon lengths alone bring the tip to each of `points` (N, 3). Shape (N,).

    The Panda's joint angles say where the mount is and how gravity pulls on the soft arm; the statics say where the
    tip then rests under the lengths.

    Args:
        lengths: of the soft samples, (M, K) in m. weight: whether the soft arm has any. learnt: as for
            `dataset.sampling.sample_at`.
    """
    good = np.zeros(len(points), bool)
    rows = np.flatnonzero(poses.reached)
    if not len(rows):
        return good
    mount, rotation = mount_pose(poses.q[rows], mount_offset)
    base = rotation * np.array([1.0, -1.0, -1.0])  # axes of the soft arm's base frame, in columns
    gravity = -STANDARD_GRAVITY * weight * base[:, 2]
    rest = moved(forward(chain, lengths[poses.tip[rows]], gravity), chain, gravity, learnt)
    tip = mount + np.einsum("nij,nj->ni", base, rest.position)
    pulled = (rest.tensions <= (1 + FORCE_ROUNDING) * chain.max_tension).all(axis=1)
    good[rows] = rest.converged & pulled & (np.linalg.norm(tip - points[rows], axis=1) <= CLOSE)
    return good


def draw_inside_and_outside(
    field: np.ndarray, lattice: Lattice, distance: float, count: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Points uniform inside a map, and points `distance` m outside it (to a third more), (<= count, 3) each."""
    upper = lattice.origin + lattice.spacing * (np.array(lattice.shape) - 1)
    points = np.random.default_rng(seed).uniform(lattice.origin, upper, size=(500 * count, 3))
    depth = lattice.sample(field, points)
    outside = (depth >= distance) & (depth <= 4 / 3 * distance)
    return points[depth < 0][:count], points[outside][:count]


def mount_for_tips(points: np.ndarray, tips: np.ndarray, yaw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, 3) and rotations (N, 3, 3) of the mount that bring `tips` (N, 3) to `points` (N, 3)."""
    turn = np.zeros((len(yaw), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(yaw)
    turn[:, 1, 0] = np.sin(yaw)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return points - np.einsum("nij,nj->ni", turn, tips), turn * np.array([1.0, -1.0, -1.0])


def _deepest(point: np.ndarray, tips: np.ndarray, yaws: int, rigid: np.ndarray, lattice: Lattice):
    """Tips (TRIES,), yaws and depths whose mount lies deepest in the rigid map, no tip twice, deepest first."""
    angles = 2 * np.pi * np.arange(yaws) / yaws
    cos, sin = np.cos(angles), np.sin(angles)
    x = point[0] - np.outer(tips[:, 0], cos) + np.outer(tips[:, 1], sin)
    y = point[1] - np.outer(tips[:, 0], sin) - np.outer(tips[:, 1], cos)
    z = np.broadcast_to((point[2] - tips[:, 2])[:, None], x.shape)
    index = np.rint((np.stack([x, y, z]) - lattice.origin[:, None, None]) / lattice.spacing).astype(int)
    last = np.array(lattice.shape)[:, None, None] - 1
    depth = rigid[tuple(np.clip(index, 0, last))]
    best = depth.argmin(axis=1)
    depth = depth[np.arange(len(tips)), best]
    order = np.argsort(depth, kind="stable")[:TRIES]
    return order, angles[best[order]], depth[order]
