"""Frames and rotations: quaternions are (w, x, y, z); R_a_b maps coordinates in b to coordinates in a."""

import numpy as np
from scipy.spatial.transform import Rotation

STANDARD_GRAVITY = 9.80665  # m/s², ISO 80000-3


def gravity_in_base(tilt: float | np.ndarray, magnitude: float = STANDARD_GRAVITY) -> np.ndarray:
    """Gravity in the base frame when the mount is turned by `tilt` about base +y.

    The straight arm points along base -z, so `tilt` is the angle between it and gravity.

    Args:
        tilt: gravity angle θ_G in rad, any shape (...).
        magnitude: m/s².

    Returns:
        Gravity vectors, m/s². Shape (..., 3).
    """
    tilt = np.asarray(tilt, dtype=float)
    return magnitude * np.stack([np.sin(tilt), np.zeros_like(tilt), -np.cos(tilt)], axis=-1)


def tilt_of_gravity(gravity: np.ndarray) -> float:
    """The angle between the straight arm (base -z) and a gravity vector (3,) in the base frame, in rad."""
    return float(np.arctan2(np.hypot(gravity[0], gravity[1]), -gravity[2]))


def downwards(angle: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """The direction of gravity in the base frame.

    Args:
        angle: between the straight arm (base -z) and gravity, rad, any shape (...).
        azimuth: of gravity around the arm, from base +x towards +y, rad, likewise; 0 is a mount tilted about base +y.

    Returns:
        Unit vectors. Shape (..., 3).
    """
    side = np.sin(angle)
    return np.stack([side * np.cos(azimuth), side * np.sin(azimuth), -np.cos(angle) + 0.0 * azimuth], axis=-1)


def in_plane_of_tilt(side: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Positions across the arm, base x and y (N, 2), as those along gravity's part across it, and beside that.

    Args:
        gravity: its x and y in the base frame, of any size, zero for that along +x. Shape (2,) or (N, 2).

    Returns:
        Shape (2, N).
    """
    azimuth = np.arctan2(gravity[..., 1], gravity[..., 0])
    x, y = side.T
    return np.stack([np.cos(azimuth) * x + np.sin(azimuth) * y, np.cos(azimuth) * y - np.sin(azimuth) * x])


def rotation_from_wxyz(quaternion: np.ndarray) -> Rotation:
    """Quaternions (..., 4), w first, as a scipy Rotation."""
    return Rotation.from_quat(quaternion, scalar_first=True)


def wxyz_from_rotation(rotation: Rotation) -> np.ndarray:
    """A scipy Rotation as unit quaternions (..., 4), w first and not negative."""
    return rotation.as_quat(canonical=True, scalar_first=True)


def make_continuous(quaternions: np.ndarray) -> np.ndarray:
    """Flip signs along the first axis so that neighbouring quaternions (T, ..., 4) lie in one hemisphere."""
    dots = np.einsum("t...i,t...i->t...", quaternions[1:], quaternions[:-1])
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., None]])
