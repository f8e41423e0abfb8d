"""Clocks: when a frame was taken, and how far the motors' clock is from the cameras'."""

from dataclasses import dataclass

import numpy as np

from trunkline.recordings.signals.smoothing import fill_gaps

WINDOW = 0.5  # s, in each of which the quickest messages of two topics are compared
MIN_TRAVEL = 5e-3  # m; a tendon that moves less says nothing about time
CERTAIN = 0.3  # of the tendons' motion that a fit may leave unexplained, against what it leaves on average
APART = 0.1  # s, by which two offsets differ, or that they are from the end of those tried
NEARLY = 0.2  # of the way from the best offset's residual to the mean one, within which another is a rival
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
    """time = motor time + offset, s, by motion: the arm's lag behind its tendons is in it. ratio: what remains
    unexplained of the tendons' motion there, over what remains on average; near 0 is certain, near 1 is a guess.
    rival: whether another offset may be as good."""

    offset: float
    ratio: float
    rival: bool = False

    @property
    def certain(self) -> bool:
        return self.ratio < CERTAIN and not self.rival


@dataclass
class LoggedOffset:
    """time = motor time + offset, s, by log times. uncertainty: s."""

    offset: float
    uncertainty: float


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
    quadratic in the principal motions of the markers, for every offset within ±limit; the best fit wins. Motors,
    cables and friction let the shape lag behind what was wound or sent, and this fit takes the lag for an offset.

    Args:
        time (T,) s, positions (T, S, 3) m with NaN: the markers in any fixed frame.
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
    rival = _rival(offsets, residuals, best)
    return OffsetFit(float(offset), float(residuals[best] / residuals.mean()), rival)


def _rival(offsets: np.ndarray, residuals: np.ndarray, best: int) -> bool:
    """Whether another offset (n,) s explains the tendons nearly as well, a period of the motion away, or one beyond
    those that were tried may do better."""
    low = (residuals[1:-1] <= residuals[:-2]) & (residuals[1:-1] <= residuals[2:])
    others = np.flatnonzero(low) + 1
    others = others[np.abs(offsets[others] - offsets[best]) > APART]
    near = residuals[best] + NEARLY * (residuals.mean() - residuals[best])
    at_end = min(offsets[best] - offsets[0], offsets[-1] - offsets[best]) < APART / 2
    return bool(at_end or np.any(residuals[others] < near))


def offset_by_log_times(
    time: np.ndarray, logged: np.ndarray, motor_time: np.ndarray, motor_logged: np.ndarray
) -> LoggedOffset | None:
    """The offset between the clocks by what one recorder saw of both; None where it never saw both.

    A message is logged after what dates it: by the offset of that clock to the recorder's, and by its delay. The
    recorder's own clock falls out of the difference of the two, and with the quickest messages the delays do, but for
    what the quickest of one topic takes longer than that of the other. No log tells that; it is taken to be no more
    than the typical delay beyond the quickest, which is stated as the uncertainty. The quickest are compared every
    WINDOW s, so that a drift or a step of the recorder's clock does not matter, and the median counts.

    Args:
        time (T,) s: what dates the poses. logged (T,) s: when the recorder had them.
        motor_time (M,), motor_logged (M,): s, the same of the motors' messages, by their own and by the same recorder.
    """
    order = np.argsort(logged, kind="stable")
    delay, motor_delay, estimates = logged - time, motor_logged - motor_time, []
    for rows in np.array_split(order, max(round(float(np.ptp(time)) / WINDOW), 1)):
        within = (motor_logged >= logged[rows[0]]) & (motor_logged <= logged[rows[-1]])
        if within.any():
            quickest = delay[rows].min(), motor_delay[within].min()
            beyond = np.median(delay[rows]) - quickest[0], np.median(motor_delay[within]) - quickest[1]
            estimates.append((quickest[1] - quickest[0], max(beyond)))
    if not estimates:
        return None
    offset, uncertainty = np.median(estimates, axis=0)
    return LoggedOffset(float(offset), float(uncertainty))


def agree(offsets: list[float]) -> tuple[float, float]:
    """One offset for several trials' and its spread, s: median and robust deviation."""
    middle = float(np.median(offsets))
    return middle, float(1.4826 * np.median(np.abs(np.array(offsets) - middle)))


def _shape_features(columns: np.ndarray) -> np.ndarray:
    """Constant, leading principal components and their products: (T, 1 + m + m (m+1)/2)."""
    centred = columns - columns.mean(axis=0)
    u, s, _ = np.linalg.svd(centred, full_matrices=False)
    modes = u[:, :SHAPE_MODES] * (s[:SHAPE_MODES] / max(s[0], 1e-300))
    first, second = np.triu_indices(modes.shape[1])
    return np.column_stack([np.ones(len(modes)), modes, modes[:, first] * modes[:, second]])
