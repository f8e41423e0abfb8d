"""Clocks: when a frame was taken, and how far the motors' clock is from the cameras'."""

from dataclasses import dataclass

import numpy as np

from trunkline.signals.smoothing import fill_gaps, low_pass, outliers
from trunkline.trials.start import onset

LAG = 0.2  # s, the most by which the arm's lag may put a fit of the whole motion off
MIN_TRAVEL = 5e-3  # m; a tendon that moves less says nothing about time
CERTAIN = 0.3  # of the tendons' motion that a fit may leave unexplained, against what it leaves on average
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
    remains on average; near 0 is certain, near 1 is a guess. onset: the offset by the first motion, s, or None."""

    offset: float
    ratio: float
    onset: float | None = None

    @property
    def certain(self) -> bool:
        return self.ratio < CERTAIN


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


def first_motion_offset(
    time: np.ndarray, positions: np.ndarray, motor_time: np.ndarray, pulls: np.ndarray, rough: float
) -> float | None:
    """The offset at which the segments begin to move when the tendons do, s; None where nothing rests first.

    Friction and elastic cables let the arm lag behind its motors, and a fit of the whole motion takes the lag for
    an offset. Only the first motion, of the light tip, has next to none.

    Args: as for `estimate_offset`, which gave `rough`, s.
    """
    pull = pulls[:, np.argmax(np.ptp(pulls, axis=0))]
    travel = np.abs(pull - pull[0])
    rising = motor_time[np.argmax(travel > 0.15 * travel.max())]
    resting = motor_time < motor_time[0] + 0.6 * (rising - motor_time[0])
    if resting.sum() < 10:
        return None
    travel = np.abs(pull - np.median(pull[resting]))
    begin = onset(motor_time, travel, resting, floor=travel.max() / 400, powers=(1, 2))
    if begin is None:
        return None
    grid, smooth = _smooth(time, positions)
    resting = (grid > begin + rough - 3 * LAG) & (grid < begin + rough - LAG)
    if resting.sum() < 20:
        return None
    moved = np.sqrt(np.mean(np.square(smooth - smooth[resting].mean(axis=0)), axis=1))
    first = onset(grid, moved, resting)
    return None if first is None or abs(first - begin - rough) > LAG else float(first - begin)


def _smooth(time: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A uniform clock (G,) and on it the segments' coordinates (G, 3 S), without outliers, gaps and most noise."""
    grid = np.arange(time[0], time[-1], np.median(np.diff(time)))
    columns = []
    for segment in np.moveaxis(positions, 1, 0):
        good = np.isfinite(segment[:, 0])
        good[good] &= ~outliers(time[good], segment[good], deviations=8.0)
        columns += [np.interp(grid, time[good], axis[good]) for axis in segment.T]
    rate = 1 / (grid[1] - grid[0])
    return grid, low_pass(np.stack(columns, axis=1), rate, min(20.0, rate / 5), 4)


def agree_on_offset(fits: list[OffsetFit]) -> tuple[float, float]:
    """One offset for a session and its spread, s: median and robust deviation over the certain trials.

    First motions decide where there are any. (0, inf) where no trial tells.
    """
    sure = [fit for fit in fits if fit.certain]
    first = [fit.onset for fit in sure if fit.onset is not None]
    offsets = np.array(first or [fit.offset for fit in sure])
    if not len(offsets):
        return 0.0, np.inf
    offset = float(np.median(offsets))
    return offset, float(1.4826 * np.median(np.abs(offsets - offset)))


def _shape_features(columns: np.ndarray) -> np.ndarray:
    """Constant, leading principal components and their products: (T, 1 + m + m (m+1)/2)."""
    centred = columns - columns.mean(axis=0)
    u, s, _ = np.linalg.svd(centred, full_matrices=False)
    modes = u[:, :SHAPE_MODES] * (s[:SHAPE_MODES] / max(s[0], 1e-300))
    first, second = np.triu_indices(modes.shape[1])
    return np.column_stack([np.ones(len(modes)), modes, modes[:, first] * modes[:, second]])
