"""Runs of True in flags on a clock."""

import numpy as np
from scipy.ndimage import binary_opening, find_objects, label


def lasting(flags: np.ndarray, least: int) -> np.ndarray:
    """Which of (T,) lie in runs of True of at least `least` samples."""
    return binary_opening(flags, np.ones(least, bool))


def stretches(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run of True in (T,)."""
    return [(run.start, run.stop - 1) for (run,) in find_objects(label(flags)[0])]
