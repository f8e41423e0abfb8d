"""Signals on a clock: outliers, gaps, a uniform rate, a low-pass without delay. Columns are independent."""

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter
from scipy.signal import butter, sosfiltfilt

NEIGHBOURHOOD = 11  # rows, over which one has to stand out
STAND_OUT = 4.0  # times the median of its neighbourhood
COINCIDE = 0.1  # of the usual step, below which two samples are taken for one
ROUNDS = 3  # of removing outliers; what bad rows hide shows once they are gone


def outliers(time: np.ndarray, columns: np.ndarray, deviations: float) -> np.ndarray:
    """Which rows of (T, C) disagree with their neighbours, however one looks at them: (T,). No NaN allowed.

    A row is predicted along a line from the two before it, the two behind it and the ones at its sides; the best
    counts. So a good row beside a bad one passes. Where the arm is shaken, all rows disagree somewhat, and one has
    to stand out from them too. Three bad rows that agree with each other are no noise but a marker taken for
    another, and pass.

    Args:
        time: (T,) s, increasing.
        deviations: allowed disagreement, in medians of it.
    """
    rows = np.arange(len(time))
    for _ in range(ROUNDS):
        off = _disagreement(time[rows], columns[rows])
        around = median_filter(off, NEIGHBOURHOOD, mode="mirror")
        good = off <= np.maximum(deviations * np.median(off), STAND_OUT * around)
        if good.all():
            break
        rows = rows[good]
    bad = np.ones(len(time), bool)
    bad[rows] = False
    return bad


def _disagreement(time: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Distance of each row to the nearest of its three predictions; 0 where there is none. Shape (T,)."""
    nearest = np.full(len(time), np.inf)
    for first, second in ((-2, -1), (1, 2), (-1, 1)):
        rows = np.arange(max(0, -first), len(time) - max(0, second))
        before, after = time[rows] - time[rows + first], time[rows] - time[rows + second]
        share = (before / (before - after))[:, None]
        predicted = columns[rows + first] + share * (columns[rows + second] - columns[rows + first])
        nearest[rows] = np.minimum(nearest[rows], np.linalg.norm(columns[rows] - predicted, axis=1))
    return np.where(np.isfinite(nearest), nearest, 0.0)


def resample(time: np.ndarray, columns: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Columns (T, C) at `grid` (G,), by a cubic spline through the samples, held at the ends.

    Linear interpolation would cost a τ²/8 in a gap of τ, 2 mm at 20 m/s² and 30 ms. Samples that nearly coincide count
    as one: through both, noise would become speed.
    """
    time, columns = _apart(time, columns)
    if len(time) < 4:
        return np.stack([np.interp(grid, time, column) for column in columns.T], axis=1)
    return CubicSpline(time, columns)(np.clip(grid, time[0], time[-1]))


def _apart(time: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) and columns (T, C), the means of samples less than `COINCIDE` of the usual step after the one before.
    """
    steps = np.diff(time)
    usual = np.median(steps[steps > COINCIDE * steps.mean()]) if len(steps) else 0.0
    apart = steps >= COINCIDE * usual
    if apart.all():
        return time, columns
    group = np.concatenate([[0], np.cumsum(apart)])
    count = np.bincount(group)
    means = [np.bincount(group, weights=column) / count for column in (time, *columns.T)]
    return means[0], np.stack(means[1:], axis=1)


def bridged(time: np.ndarray, grid: np.ndarray, longest: float) -> np.ndarray:
    """Which of `grid` (G,) may be trusted: in a gap of `time` (T,) of at most `longest` s, or by a sample."""
    after = np.searchsorted(time, grid)
    left = time[np.clip(after - 1, 0, len(time) - 1)]
    right = time[np.clip(after, 0, len(time) - 1)]
    inside = (after > 0) & (after < len(time))
    nearest = np.minimum(np.abs(grid - left), np.abs(right - grid))
    step = np.median(np.diff(grid)) if len(grid) > 1 else np.inf
    return (inside & (right - left <= longest)) | (nearest <= 0.5 * step)


def low_pass(columns: np.ndarray, rate: float, cutoff: float, order: int) -> np.ndarray:
    """Zero-phase Butterworth low-pass of (T, C) at `rate` Hz; forwards and backwards, -6 dB at `cutoff` Hz.

    The padding mirrors the signal at its ends, for one period of the cutoff and more.
    """
    sections = butter(order, cutoff, fs=rate, output="sos")
    padding = min(len(columns) - 1, int(3 * rate / cutoff))
    return sosfiltfilt(sections, columns, axis=0, padlen=padding)


def noise_level(columns: np.ndarray) -> np.ndarray:
    """Standard deviation of white noise on smooth columns (T, C), by their third differences: (C,)."""
    third = np.diff(columns, n=3, axis=0)
    return 1.4826 * np.nanmedian(np.abs(third), axis=0) / np.sqrt(20)  # 1² + 3² + 3² + 1²


def fill_gaps(time: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Columns (T, C) with NaN replaced by linear interpolation, held at the ends; all-NaN columns are 0."""
    table = pd.DataFrame(columns, index=time).interpolate("index", limit_direction="both")
    return np.ascontiguousarray(table.fillna(0.0))
