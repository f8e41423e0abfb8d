"""Samples that repeat the one before to the last bit."""

import numpy as np

from trunkline.recordings.signals.runs import lasting

SHORTEST = 5  # frames that agree to the last bit; noise does not, and a rounded log is known by its single axes
ROUNDED = 0.05  # share of other steps in which an axis does not change, above which the log is rounded


def stale_samples(positions: np.ndarray) -> np.ndarray:
    """Which samples of (T, B, 3) only repeat the one before: (T, B). NaN where unseen.

    The first of a stretch is a measurement and is not marked. A body that hardly ever changes is a noise-free one,
    or one that stands for a constant, and nothing of it is marked.
    """
    repeats = np.zeros(positions.shape[:2], bool)
    for body in range(positions.shape[1]):
        visible = np.flatnonzero(np.isfinite(positions[:, body, 0]))
        same = np.diff(positions[visible, body], axis=0) == 0
        whole = same.all(axis=1)
        long = lasting(whole, SHORTEST - 1)
        rest = same[~long]
        if 0 < long.sum() < len(visible) / 2 and rest.any(axis=1).mean() <= ROUNDED:
            repeats[visible[1:][long], body] = True
    return repeats
