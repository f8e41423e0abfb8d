"""Inverse kinematics of the Panda: damped least squares on many targets at once, with random restarts.

Each step solves (J J^T + lambda^2 I) y = e with lambda^2 proportional to |e|^2 (Levenberg-Marquardt in task space),
moves by J^T y and clips to the joint limits. The task error e is the position error and either the rotation
vector of the orientation error or, for a target that leaves the yaw free, the cross product of the pointing
directions.

The maps ask for hundreds of targets at once, which cost far less together than one by one, or by mink
(docs/measurements/kinematics.md).
"""

from typing import NamedTuple

import numpy as np

from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.kinematics import FLANGE, Q_MAX, Q_MIN, JointFrame, cross, jacobian, joint_frames

POSITION_TOLERANCE = 1e-5  # m
ROTATION_TOLERANCE = 1e-4  # rad
ITERATIONS = 60  # per start; a start that needs more is rarely worth it against a fresh one
DAMPING = 0.3  # lambda^2 per squared task error
DAMPING_FLOOR = 1e-10
TOGETHER = 1000  # descents at once: with fewer, calls cost more than the arithmetic in them
LARGEST_STEP = 0.5  # rad, per joint and iteration


class InverseResult(NamedTuple):
    """Outcome for N targets.

    `q` (N, 7) in rad; `position_error` (N,) in m and `rotation_error` (N,) in rad of the best start;
    `starts` (N,) used; `success` (N,): within tolerance, limits and, if asked, free of collisions.
    """

    q: np.ndarray
    position_error: np.ndarray
    rotation_error: np.ndarray
    starts: np.ndarray
    success: np.ndarray


def solve(
    positions: np.ndarray,
    rotations: np.ndarray | None = None,
    *,
    seed: int,
    starts: int,
    mount_offset: float = 0.0,
    avoid_collisions: bool = True,
    only: np.ndarray | None = None,
) -> InverseResult:
    """Joint angles that bring the mount to targets.

    Args:
        positions: of the mount, (N, 3) in m.
        rotations: of the mount, (N, 3, 3); `None`: straight down, with any yaw.
        seed: of the random starts; target i meets the same starts whatever the other targets are.
        starts: most starts per target.
        mount_offset: from the flange to the mount, in m.
        avoid_collisions: count a solution in which the arm touches itself as a failed start.
        only: numbers of the targets that are looked for, all by default; the others count as not found.
    """
    positions = np.asarray(positions, dtype=float)
    n = len(positions)
    best = InverseResult(np.tile((Q_MIN + Q_MAX) / 2, (n, 1)), np.full(n, np.inf), np.full(n, np.inf),
                         np.zeros(n, int), np.zeros(n, bool))
    left, done = np.arange(n) if only is None else only, 0
    while left.size and done < starts:
        # As many starts at once as there were before: at most twice as many descents as one start after the other.
        count = min(max(1, done), max(1, TOGETHER // left.size), starts - done)
        first = [np.random.default_rng([seed, done + k]).uniform(Q_MIN, Q_MAX, size=(n, 7))[left] for k in range(count)]
        rows = np.tile(left, count)
        target = None if rotations is None else rotations[rows]
        q, position_error, rotation_error = _descend(np.concatenate(first), positions[rows], target, mount_offset)
        success = (position_error <= POSITION_TOLERANCE) & (rotation_error <= ROTATION_TOLERANCE)
        if avoid_collisions:
            success[success] = clearance(q[success], mount_offset) > 0.0
        for part in np.split(np.arange(len(rows)), count):  # one start each, in order: the first success counts
            part = part[~best.success[rows[part]]]
            best.starts[rows[part]] += 1
            total = position_error[part] + rotation_error[part]
            at = rows[part]
            part = part[success[part] | (total < best.position_error[at] + best.rotation_error[at])]
            at = rows[part]
            best.q[at], best.position_error[at] = q[part], position_error[part]
            best.rotation_error[at], best.success[at] = rotation_error[part], success[part]
        left, done = left[~best.success[left]], done + count
    return best


def _descend(q: np.ndarray, positions: np.ndarray, rotations: np.ndarray | None, mount_offset: float):
    """One start per target: joint angles (N, 7), position errors and rotation errors (N,) at its end."""
    q = q.copy()
    joints = 7 if rotations is not None else 6  # joint 7 changes neither position nor pointing direction
    position_error, rotation_error = np.full(len(q), np.inf), np.full(len(q), np.inf)
    active = np.arange(len(q))
    for _ in range(ITERATIONS):
        frames = joint_frames(q[active])
        mount = frames[-1].p + (FLANGE + mount_offset) * frames[-1].z
        error = np.concatenate([
            positions[active].T - mount,
            _rotation_error(frames[-1], None if rotations is None else rotations[active]),
        ])
        position_error[active] = np.sqrt((error[:3] ** 2).sum(axis=0))
        rotation_error[active] = np.sqrt((error[3:] ** 2).sum(axis=0))
        going = position_error[active] > 0.1 * POSITION_TOLERANCE
        going |= rotation_error[active] > 0.1 * ROTATION_TOLERANCE
        if not going.any():
            break
        J = jacobian(frames, mount)[:, :joints, going].transpose(2, 0, 1)
        active, error = active[going], error[:, going].T
        q[active, :joints] = _step(q[active, :joints], J, error)
    return q, position_error, rotation_error


def _step(q: np.ndarray, J: np.ndarray, error: np.ndarray) -> np.ndarray:
    """One damped step from `q` (N, n) with Jacobians (N, 6, n) and errors (N, 6), inside the limits."""
    n = q.shape[1]
    # A joint at its limit that the error pushes outwards is left out of the step.
    gradient = np.einsum("nij,ni->nj", J, error)
    stuck = ((q >= Q_MAX[:n]) & (gradient > 0)) | ((q <= Q_MIN[:n]) & (gradient < 0))
    J = np.where(stuck[:, None, :], 0.0, J)
    damping = DAMPING * (error**2).sum(axis=1) + DAMPING_FLOOR
    normal = np.einsum("nij,nkj->nik", J, J) + damping[:, None, None] * np.eye(6)
    step = np.einsum("nij,ni->nj", J, np.linalg.solve(normal, error[:, :, None])[:, :, 0])
    scale = np.minimum(1.0, LARGEST_STEP / np.maximum(np.abs(step).max(axis=1), 1e-12))
    return np.clip(q + scale[:, None] * step, Q_MIN[:n], Q_MAX[:n])


def _rotation_error(last: JointFrame, rotations: np.ndarray | None) -> np.ndarray:
    """Rotation that remains, (3, N) in rad (small angles: exactly; large ones: in the right direction)."""
    if rotations is None:
        down = np.array([[0.0], [0.0], [-1.0]])
        axis = cross(last.z, np.broadcast_to(down, last.z.shape))
        return _unsaturated(axis, -last.z[2])
    axes, zero = list(zip(last[:3], rotations.transpose(2, 1, 0), strict=True)), np.zeros(())  # now and wanted
    axis = 0.5 * sum((cross(now, wanted) for now, wanted in axes), start=zero)
    cosine = 0.5 * (sum(((now * wanted).sum(axis=0) for now, wanted in axes), start=zero) - 1.0)
    return _unsaturated(axis, cosine)


def _unsaturated(axis: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """`axis` (3, N), of length sin(angle), rescaled to length angle, so that half a turn is not an end."""
    sine = np.sqrt((axis**2).sum(axis=0))
    angle = np.arctan2(sine, cosine)
    return axis * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
