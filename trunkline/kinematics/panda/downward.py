"""Exact sampling of the Panda's poses whose end effector points straight down, or a given angle off it.

Draw q1 to q4 freely. With u = R04^T d, d = (0, 0, -1) or tilted from it, the direction in which the end effector shall
point seen from frame 4, the wrist has two solutions (s = +1 and -1):

    q6 = acos(-u_y)  or  2 pi - acos(-u_y),    q5 = atan2(-s u_z, s u_x),

and q7 is free. Every sample points there exactly; only the limits of q5 and q6 (and collisions) reject any.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.stats import qmc

from trunkline.compute.threads import thread_count
from trunkline.kinematics.panda.collision import CHUNK, clearance
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, joint_frames, within_limits

# Borders of the workspace lie where the arm is stretched in its plane or a joint stands at its limit: a
# share of the draws goes there, or thin tips of the workspace would stay empty.
BORDER_SHARE = 0.25
BORDER_VALUES = ((1, Q_MIN[1]), (1, Q_MAX[1]), (2, 0.0), (3, Q_MIN[3]), (3, Q_MAX[3]))  # joint index, rad


def sample_downward(count: int, seed: int, mount_offset: float = 0.0, avoid_collisions: bool = True) -> np.ndarray:
    """At least `count` joint vectors (M, 7), in rad, within limits, with the end effector straight down.

    Args:
        count: how many to find.
        seed: of the scrambled Sobol sequence; the same seed gives the same samples.
        mount_offset: from the flange to the mount, in m; matters for collisions only.
        avoid_collisions: leave out poses in which the arm touches itself.
    """
    return _sample(qmc.Sobol(6, seed=seed), count, 0.0, mount_offset, avoid_collisions)


def sample_tilted(count: int, seed: int, tilt: float, mount_offset: float, avoid_collisions: bool) -> np.ndarray:
    """As `sample_downward`, with the end effector `tilt` rad off straight down, its headings uniform."""
    return _sample(qmc.Sobol(7, seed=seed), count, tilt, mount_offset, avoid_collisions)


def _sample(sequence: qmc.Sobol, count: int, tilt: float, mount_offset: float, avoid_collisions: bool) -> np.ndarray:
    def solve(draws: np.ndarray) -> np.ndarray:
        poses = _solve(draws, tilt)
        return poses[clearance(poses, mount_offset) > 0.0] if avoid_collisions else poses

    threads = thread_count()
    accepted, total = [], 0
    with ThreadPoolExecutor(threads) as pool:
        while total < count:
            for poses in pool.map(solve, [sequence.random(CHUNK) for _ in range(threads)]):
                if total < count:  # whatever the number of threads, the same draws count
                    accepted.append(poses)
                    total += len(poses)
    return np.concatenate(accepted)


def _solve(draws: np.ndarray, tilt: float) -> np.ndarray:
    """Poses from uniform `draws` (N, 6 or 7): four joints, q7, which border to sit on, if any, and the heading."""
    free = [0, 1, 2, 3, 6]
    q = np.empty((len(draws), 7))
    q[:, free] = Q_MIN[free] + draws[:, :5] * (Q_MAX - Q_MIN)[free]
    border = (draws[:, 5] / BORDER_SHARE * len(BORDER_VALUES)).astype(int)
    for index, (joint, value) in enumerate(BORDER_VALUES):
        q[border == index, joint] = value
    heading = 2 * np.pi * draws[:, 6] if draws.shape[1] > 6 else np.zeros(len(draws))
    level = np.sin(tilt) * np.array([np.cos(heading), np.sin(heading)])
    q5, q6 = wrist_towards(q[:, :4], np.vstack([level, np.full(len(draws), -np.cos(tilt))]))
    branches = []
    for s in (0, 1):
        branch = q.copy()
        branch[:, 4], branch[:, 5] = q5[s], q6[s]
        branches.append(branch)
    poses = np.concatenate(branches)
    return poses[within_limits(poses)]


def wrist_towards(q: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both solutions (q5, q6), each (2, N) in rad, that point the end effector along `direction` (3, N) of the base
    frame, of unit length, given q1..q4 (N, 4)."""
    frame = joint_frames(q)[-1]
    ux, uy, uz = ((axis * direction).sum(axis=0) for axis in frame[:3])
    q6 = np.arccos(np.clip(-uy, -1.0, 1.0))
    return np.stack([np.arctan2(-uz, ux), np.arctan2(uz, -ux)]), np.stack([q6, 2 * np.pi - q6])
