"""The hybrid map at a tilt: where the soft tip can be while the end effector points a given angle off straight down.

The soft arm's gravity angle then is that tilt, and joint 7 turns the arm so that gravity lies in the plane of tendon 1,
as in the data set. The tips go with the heading of the tilt, so the map is no sum of two sets. But joint 1 still turns
everything about the vertical: pairs of a rigid pose and a soft tip give points in (r, z) and azimuth, and these a map
as in `rigid`.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from trunkline.kinematics.panda.downward import sample_tilted
from trunkline.kinematics.panda.inverse import solve
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, mount_pose
from trunkline.kinematics.reachability.hybrid_check import STARTS, TRIES, ReachingPoses
from trunkline.kinematics.reachability.rigid import azimuth_from_joint_1, outline, rigid_field
from trunkline.kinematics.sdf.grid import Lattice

TIPS_PER_POSE = 8
NEAREST = 200  # pairs whose points are nearest to a target in (r, z), among which poses are looked for


class Pairs(NamedTuple):
    """Rigid poses `q` (P, 7) in rad; of N pairs the `pose` (N,), the soft `tip` (N,) and where it is brought,
    `points` (N, 3) in m."""

    q: np.ndarray
    pose: np.ndarray
    tip: np.ndarray
    points: np.ndarray


def draw_pairs(
    tips: np.ndarray, tilt: float, count: int, seed: int, *, mount_offset: float, avoid_collisions: bool
) -> Pairs:
    """At least `count` rigid poses at `tilt` (rad), `TIPS_PER_POSE` of the soft `tips` (M, 3) at each."""
    q = sample_tilted(count, seed, tilt, mount_offset, avoid_collisions)
    mount, rotation = mount_pose(q, mount_offset)
    base = soft_base(rotation[:, :, 2])
    index = np.random.default_rng(seed).integers(0, len(tips), (TIPS_PER_POSE, len(q)))
    points = [mount + np.einsum("nij,nj->ni", base, tips[some]) for some in index]
    return Pairs(q, np.tile(np.arange(len(q)), TIPS_PER_POSE), index.reshape(-1), np.concatenate(points))


def soft_base(pointing: np.ndarray) -> np.ndarray:
    """Axes of the soft arm's base frame, in columns, where the end effector is `pointing` (N, 3). Shape (N, 3, 3).

    The base's z points backwards, its y is level, and gravity has a positive x in it.
    """
    z = -pointing
    y = np.column_stack([-z[:, 1], z[:, 0], np.zeros(len(z))])
    length = np.linalg.norm(y, axis=1, keepdims=True)
    y = np.where(length > 1e-9, y / np.maximum(length, 1e-9), [0.0, 1.0, 0.0])
    return np.stack([np.cross(y, z), y, z], axis=2)


def tilted_field(pairs: Pairs, spacing: float, smoothing: float, smallest: int) -> tuple[np.ndarray, Lattice]:
    """Signed distance field, m, of the set that `pairs` sample, on a lattice of `spacing` m.

    Its profile has cells half as wide; gaps in it up to twice `spacing` are filled. For `smoothing` see
    `rigid.rigid_field`, for `smallest` `rigid.profile`.
    """
    azimuth = azimuth_from_joint_1(pairs.points, pairs.q[pairs.pose, 0])
    radius = np.hypot(pairs.points[:, 0], pairs.points[:, 1])
    shape = outline(radius, pairs.points[:, 2], azimuth, spacing / 2, spacing, smallest)
    return rigid_field(shape, spacing, smoothing)


def find_tilted(
    points: np.ndarray, pairs: Pairs, tips: np.ndarray, *, seed: int, mount_offset: float, avoid_collisions: bool
) -> ReachingPoses:
    """Rigid pose and soft tip for each of `points` (N, 3), as `hybrid_check.find_poses`, near drawn `pairs`."""
    plane = np.column_stack([np.hypot(pairs.points[:, 0], pairs.points[:, 1]), pairs.points[:, 2]])
    # Millions of pairs and a few hundred targets: what counts is how fast the tree is built.
    tree = cKDTree(plane, balanced_tree=False, compact_nodes=False)
    _, near = tree.query(np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]]), k=NEAREST)
    turn = np.arctan2(points[:, 1], points[:, 0])[:, None]
    turn = turn - np.arctan2(pairs.points[near, 1], pairs.points[near, 0])  # (N, NEAREST), of joint 1
    joint_1 = pairs.q[pairs.pose[near], 0]
    first = (joint_1 + turn + np.pi) % (2 * np.pi) - np.pi
    turn = first - joint_1
    outside = np.maximum(Q_MIN[0] - first, first - Q_MAX[0])
    order = np.argsort(np.maximum(outside, 0.0), axis=1, kind="stable")[:, :TRIES]
    count = len(points)
    poses = ReachingPoses(np.zeros(count, bool), np.zeros((count, 7)), np.zeros(count, int), np.zeros(count))
    for attempt in range(TRIES):
        left = np.flatnonzero(~poses.reached)
        if not len(left):
            break
        chosen = order[left, attempt]
        pair = near[left, chosen]
        q = pairs.q[pairs.pose[pair]]
        q[:, 0] += turn[left, chosen]
        base = soft_base(mount_pose(q, mount_offset)[1][:, :, 2])
        mount = points[left] - np.einsum("nij,nj->ni", base, tips[pairs.tip[pair]])
        result = solve(mount, base * np.array([1.0, -1.0, -1.0]), seed=seed + attempt, starts=STARTS,
                       mount_offset=mount_offset, avoid_collisions=avoid_collisions)
        at = left[result.success]
        poses.reached[at], poses.q[at], poses.tip[at] = True, result.q[result.success], pairs.tip[pair[result.success]]
    return poses
