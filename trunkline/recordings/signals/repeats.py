"""Samples that repeat the one before to the last bit."""

import numpy as np

from trunkline.recordings.signals.runs import lasting, stretches

SHORTEST = 5  # frames that agree to the last bit; noise does not, and a rounded log is known by its single axes
ROUNDED = 0.05  # share of other steps in which an axis does not change, above which the log is rounded
STEPS = 5.0  # of rounding, by which a body that moves less has to move meanwhile, in a log that is rounded
LEAST = 1e-7  # m, below which a change is none of rounding


def stale_samples(positions: np.ndarray) -> np.ndarray:
    """Which samples of (T, B, 3) only repeat the one before: (T, B). NaN where unseen.

    The first of a stretch is a measurement and is not marked. A body that hardly ever changes is a noise-free one,
    or one that stands for a constant, and nothing of it is marked. In a rounded log a body at rest repeats too: there
    a stretch counts in which another moves that moves less over the trial.
    """
    travel = _travel(positions)
    repeats = np.zeros(positions.shape[:2], bool)
    for body in range(positions.shape[1]):
        visible = np.flatnonzero(np.isfinite(positions[:, body, 0]))
        same = np.diff(positions[visible, body], axis=0) == 0
        whole = same.all(axis=1)
        long = lasting(whole, SHORTEST - 1)
        rest = same[~long]
        if long.any() and (not len(rest) or rest.any(axis=1).mean() > ROUNDED):
            changes = np.abs(np.diff(positions[visible, body], axis=0))
            step = changes[changes > LEAST].min(initial=np.inf)
            others = positions[:, travel < travel[body]]
            for first, last in stretches(long):
                meanwhile = np.sort(others[visible[first] : visible[last + 1] + 1], axis=0)[1:-1]  # but for an outlier
                long[first : last + 1] = bool((_travel(meanwhile) > STEPS * step).any())
        if 0 < long.sum() < len(visible) / 2:
            repeats[visible[1:][long], body] = True
    return repeats


def _travel(positions: np.ndarray) -> np.ndarray:
    """Lengths (B,) of the diagonals of what bodies (T, B, 3) m go through, 0 of one that is never seen."""
    visible = np.isfinite(positions)
    low, high = np.where(visible, positions, np.inf).min(axis=0), np.where(visible, positions, -np.inf).max(axis=0)
    return np.linalg.norm(np.where(high > low, high - low, 0.0), axis=-1)
