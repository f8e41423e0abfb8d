"""From the motion-capture frame to the base frame: where the mount is, averaged over a trial."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.frames import STANDARD_GRAVITY, rotation_from_wxyz, wxyz_from_rotation


@dataclass
class BasePose:
    """position: p_mocap_base (3,) m. rotation: R_mocap_base. shift, turn: m and rad, how far the mount moved
    between the trial's first and second half."""

    position: np.ndarray
    rotation: Rotation
    shift: float
    turn: float


def average_base(positions: np.ndarray, quaternions: np.ndarray) -> BasePose:
    """Robust mean of the base body's poses (T, 3) m and (T, 4) wxyz, NaN where it was not seen."""
    visible = np.isfinite(positions[:, 0]) & np.isfinite(quaternions[:, 0])
    positions, rotations = positions[visible], rotation_from_wxyz(quaternions[visible])
    keep = np.ones(len(positions), bool)
    for _ in range(3):
        position, rotation = positions[keep].mean(axis=0), rotations[keep].mean()
        far = np.linalg.norm(positions - np.median(positions[keep], axis=0), axis=1)
        off = (rotation.inv() * rotations).magnitude()
        keep = (far <= 5 * np.median(far) + 1e-9) & (off <= 5 * np.median(off) + 1e-9)
    halves = np.array_split(np.flatnonzero(keep), 2)
    if not len(halves[1]):
        return BasePose(position, rotation, 0.0, 0.0)
    shift = positions[halves[1]].mean(axis=0) - positions[halves[0]].mean(axis=0)
    turn = (rotations[halves[0]].mean().inv() * rotations[halves[1]].mean()).magnitude()
    return BasePose(position, rotation, float(np.linalg.norm(shift)), float(turn))


def gravity_from_up(base: BasePose, up: np.ndarray) -> np.ndarray:
    """Gravity in the base frame, m/s²: R_mocap_baseᵀ (−g up), with `up` (3,) in the motion-capture frame."""
    return base.rotation.inv().apply(-STANDARD_GRAVITY * up)


def to_base_frame(
    base: BasePose, positions: np.ndarray, quaternions: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """(T, S, 3) and (T, S, 4) from the motion-capture frame to the base frame; NaN stays NaN."""
    inverse = base.rotation.inv()
    moved = inverse.apply((positions - base.position).reshape(-1, 3)).reshape(positions.shape)
    if quaternions is None:
        return moved, None
    turned = np.full(quaternions.shape, np.nan)
    visible = np.isfinite(quaternions[..., 0])
    turned[visible] = wxyz_from_rotation(inverse * rotation_from_wxyz(quaternions[visible]))
    return moved, turned
