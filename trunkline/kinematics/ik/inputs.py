"""What the network is asked: where gravity pulls, and the tip's pose. There are three forms, by how gravity is told.

The paper's is the angle of a mount that tilts about base +y: 8 numbers. The other is the direction of gravity in the
base frame, a unit vector, which is continuous everywhere: 10 numbers. The third is for an arm without gravity: the pose
alone, 7 numbers. The pose comes last in all; so the number of columns says which form an array of targets has.
"""

import numpy as np
import pandas as pd

from trunkline.frames import STANDARD_GRAVITY, downwards, gravity_in_base
from trunkline.kinematics.dataset.columns import DOWN, POSE
from trunkline.kinematics.dataset.samples import from_any_side, weightless

TILT = ["theta_g", *POSE]  # rad, m, and a quaternion, w first
DIRECTION = [*DOWN, *POSE]
UNITS = {"theta_g": "rad"} | dict.fromkeys(POSE[:3], "m")  # of others, "1"


def inputs_of(table: pd.DataFrame) -> list[str]:
    """The columns that a network of these samples takes: the angle where gravity never leaves the plane of tilt."""
    if weightless(table):
        return list(POSE)
    return DIRECTION if from_any_side(table) else TILT


def gravity_of(targets: np.ndarray) -> np.ndarray:
    """Gravity in the base frame for targets (N, 7, 8 or 10), m/s². Shape (N, 3)."""
    values = gravity_columns(targets)
    if values.shape[1] == 0:
        return np.zeros((len(values), 3))
    return gravity_in_base(values[:, 0]) if values.shape[1] == 1 else STANDARD_GRAVITY * values


def gravity_columns(targets: np.ndarray) -> np.ndarray:
    """The columns of targets for gravity. Shape (N, 0, 1 or 3)."""
    return targets[:, : -len(POSE)]


def position_of(targets: np.ndarray) -> np.ndarray:
    """Of the tip, m. Shape (N, 3)."""
    return targets[:, -7:-4]


def quaternion_of(targets: np.ndarray) -> np.ndarray:
    """Of the tip, w first. Shape (N, 4)."""
    return targets[:, -4:]


def draw_gravity(sampled: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Gravities between those `sampled` (G, 0, 1 or 3), in the same form: angles, or azimuths too, at random.

    Returns:
        Shape (count, 0, 1 or 3).
    """
    if sampled.shape[1] == 0:
        return np.zeros((count, 0))
    if sampled.shape[1] == 1:
        return rng.uniform(sampled.min(), sampled.max(), (count, 1))
    largest = np.arccos(np.clip(-sampled[:, 2].max(), -1, 1))
    return downwards(rng.uniform(0, largest, count), rng.uniform(0, 2 * np.pi, count))
