"""The Franka Emika Panda: published geometry and limits, forward kinematics, Jacobian.

Each joint i follows Craig's modified Denavit-Hartenberg convention,

    T_{i-1,i} = Rot_x(alpha_i) Trans_x(a_i) Rot_z(q_i) Trans_z(d_i),

and the mount of the soft arm lies `FLANGE + mount_offset` along z of frame 7. Frames are kept as their
three axes and origin, each of shape (3, N) in the base frame, so that a million poses are a few array
operations a joint: faster than `mujoco.batch` and `mj_geomDistance`, which give the same
(docs/measurements/kinematics.md).
"""

from typing import NamedTuple

import numpy as np

# Franka Control Interface documentation, "Denavit-Hartenberg parameters" and "Joint limits" of the Panda.
DH_A = np.array([0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088])  # m
DH_D = np.array([0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0])  # m
DH_ALPHA = np.pi / 2 * np.array([0, -1, 1, 1, -1, 1, 1])  # rad
FLANGE = 0.107  # m, from frame 7 to the flange along z
Q_MIN = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])  # rad
Q_MAX = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])  # rad

_COS, _SIN = np.round(np.cos(DH_ALPHA), 15), np.round(np.sin(DH_ALPHA), 15)


class JointFrame(NamedTuple):
    """N frames in the base frame: axes `x`, `y`, `z` (unitless) and origin `p` (m), each (3, N)."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    p: np.ndarray


def next_frame(previous: JointFrame, joint: int, q: np.ndarray) -> JointFrame:
    """JointFrame after `joint` (0 to 6) at angles `q` (N,), in rad, from the frame before it."""
    x, y, z, p = previous
    y, z = _COS[joint] * y + _SIN[joint] * z, _COS[joint] * z - _SIN[joint] * y
    cos, sin = np.cos(q), np.sin(q)
    origin = p + DH_A[joint] * x + DH_D[joint] * z
    return JointFrame(cos * x + sin * y, cos * y - sin * x, z, origin)


def joint_frames(q: np.ndarray) -> list[JointFrame]:
    """Frames 1, 2, ... of the joints whose angles `q` (N, up to 7), in rad, are given."""
    columns = np.ascontiguousarray(np.asarray(q, dtype=float).T)
    axes = np.eye(3)[:, :, None]
    frame = JointFrame(axes[0], axes[1], axes[2], np.zeros((3, 1)))
    frames = []
    for joint, angles in enumerate(columns):
        frame = next_frame(frame, joint, angles)
        frames.append(frame)
    return frames


def mount_pose(q: np.ndarray, mount_offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Pose of the mount of the soft arm.

    Args:
        q: joint angles in rad, (N, 7).
        mount_offset: from the flange to the mount along the flange's z, in m.

    Returns:
        Positions (N, 3) in m and rotation matrices (N, 3, 3), mount to base frame. The mount's z axis points
        out of the flange, so it is (0, 0, -1) when the end effector points straight down.
    """
    last = joint_frames(q)[-1]
    return (last.p + (FLANGE + mount_offset) * last.z).T, np.stack(last[:3], axis=1).transpose(2, 0, 1)


def jacobian(frames: list[JointFrame], position: np.ndarray) -> np.ndarray:
    """Geometric Jacobian (6, n, N) of a point fixed to the last of n `frames`: linear (m/rad), then angular.

    Args:
        frames: from `joint_frames`.
        position: the point in the base frame, (3, N), in m.
    """
    columns = []
    for frame in frames:
        z = np.broadcast_to(frame.z, position.shape)
        columns.append(np.concatenate([cross(z, position - frame.p), z]))
    return np.stack(columns, axis=1)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of (3, N) columns."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def within_limits(q: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
    """Whether each of `q` (N, 7), in rad, keeps all joint limits to `tolerance` rad. Shape (N,)."""
    return np.all((q >= Q_MIN - tolerance) & (q <= Q_MAX + tolerance), axis=1)
