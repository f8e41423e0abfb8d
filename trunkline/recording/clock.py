"""Clocks: when a frame was taken, and how far the motors' clock is from the cameras'."""

from dataclasses import dataclass

import numpy as np

MIN_TRAVEL = 5e-3  # m; a tendon that moves less says nothing about time
SHAPE_MODES = 5  # principal motions of the arm that explain the tendons, with their products


@dataclass
class FrameFit:
    """Stamp ≈ start + frame / rate. start: s, rate: Hz. jitter, worst: s, robust and largest deviation."""

    start: float
    rate: float
    jitter: float
    worst: float


@dataclass
class OffsetFit:
    """time = motor time + offset, s. ratio: what remains unexplained of the tendons' motion there, over what
    remains on average; near 0 is certain, near 1 is a guess."""

    offset: float
    ratio: float


def fit_frames(stamps: np.ndarray, frames: np.ndarray) -> FrameFit:
    """Robust straight line through the stamps (T,) in ns over the frame numbers (T,).

    Least squares on what lies within 4 robust deviations, repeated, as stamps are delayed in bursts.
    """
    x = (frames - frames[0]).astype(float)
    y = (stamps - stamps[0]).astype(float) * 1e-9
    keep = np.ones(len(x), bool)
    for _ in range(5):
        slope, start = np.polyfit(x[keep], y[keep], 1)
        residual = y - (start + slope * x)
        spread = 1.4826 * np.median(np.abs(residual - np.median(residual)))
        keep = np.abs(residual - np.median(residual)) <= max(4 * spread, 1e-6)
    return FrameFit(float(start), float(1 / slope), float(spread), float(np.abs(residual).max()))


def estimate_offset(
    time: np.ndarray, positions: np.ndarray, motor_time: np.ndarray, pulls: np.ndarray, limit: float
) -> OffsetFit | None:
    """The offset between the clocks at which the shape explains the tendons best; None if they rest.

    A taut tendon's length is a function of the arm's shape, whatever the dynamics. It is fitted as a
    quadratic in the principal motions of the segments, for every offset within ±limit; the best fit wins.

    Args:
        time (T,) s, positions (T, S, 3) m with NaN: the segments in any fixed frame.
        motor_time (M,) s, pulls (M, K) m: measured tendon positions, or commands.
        limit: s, the largest offset looked for.
    """
    moving = np.ptp(pulls, axis=0) > MIN_TRAVEL if len(pulls) else np.zeros(0, bool)
    if not moving.any():
        return None
    shape = _shape_features(fill_gaps(time, positions.reshape(len(time), -1)))
    basis, _ = np.linalg.qr(shape)
    offsets = np.arange(-limit, limit + 1e-9, 0.005)
    residuals = np.zeros(len(offsets))
    for pull in pulls[:, moving].T:
        shifted = np.stack([np.interp(time - offset, motor_time, pull) for offset in offsets], axis=1)
        shifted -= shifted.mean(axis=0)
        rest = shifted - basis @ (basis.T @ shifted)
        residuals += np.square(rest).sum(axis=0) / np.ptp(pull) ** 2
    best = int(residuals.argmin())
    offset = offsets[best]
    if 0 < best < len(offsets) - 1:  # the vertex of the parabola through the three lowest
        left, middle, right = residuals[best - 1 : best + 2]
        offset += 0.005 * 0.5 * (left - right) / max(left - 2 * middle + right, 1e-300)
    return OffsetFit(float(offset), float(residuals[best] / residuals.mean()))


def agree_on_offset(fits: list[OffsetFit]) -> tuple[float, float]:
    """One offset for a session and its spread, s: median and robust deviation over the certain trials.

    (0, inf) where there is no such trial.
    """
    certain = np.array([fit.offset for fit in fits if fit.ratio < 0.3])
    if not len(certain):
        return 0.0, np.inf
    offset = float(np.median(certain))
    return offset, float(1.4826 * np.median(np.abs(certain - offset)))


def fill_gaps(time: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Columns (T, C) with NaN replaced by linear interpolation, held at the ends; all-NaN columns are 0."""
    filled = np.zeros_like(columns)
    for index, column in enumerate(columns.T):
        good = np.isfinite(column)
        if good.any():
            filled[:, index] = np.interp(time, time[good], column[good])
    return filled


def _shape_features(columns: np.ndarray) -> np.ndarray:
    """Constant, leading principal components and their products: (T, 1 + m + m (m+1)/2)."""
    centred = columns - columns.mean(axis=0)
    u, s, _ = np.linalg.svd(centred, full_matrices=False)
    modes = u[:, :SHAPE_MODES] * (s[:SHAPE_MODES] / max(s[0], 1e-300))
    first, second = np.triu_indices(modes.shape[1])
    return np.column_stack([np.ones(len(modes)), modes, modes[:, first] * modes[:, second]])
