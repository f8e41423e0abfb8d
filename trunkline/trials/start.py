"""When a trial begins: the moment a held arm is let go, or a tendon begins to be pulled."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

AHEAD, BEHIND = 0.033, 0.1  # s: how far a hand's motion is foreseen, and from how much of it
SHORTEST = 0.08  # s of a hold, before which nothing is foreseen
LIFTOFF = 0.5  # share of the largest departure from what was foreseen that only the released arm reaches
QUIET = 0.05  # share of it below which a hand may still move the arm,
USUAL = 2.0  # and times its median before, if that is more
FORESEEN_FRAMES = 3  # at least, or there was no hold
HOLDS = (0.15, 0.25, 0.4)  # s before the release, over which the hand's motion is fitted
DEGREES = (0, 1, 2, 3)  # of the polynomials
ALIKE = 1.3  # times the least residual: up to there, fits of the hold count alike
RISE = (2.0, 16.0)  # times the noise: where the displacement stands out, yet grows as the square of time
LEAP = (8.0, 64.0)  # the same for a release: beyond what the low-pass carries ahead of it
POWERS = (1.5, 2.0)  # of time, with which a released arm leaves: its far end is light, and soon at full speed
MOVING = 0.03  # share of the top speed from which on a swaying hand gives the arm a start of its own


@dataclass(frozen=True)
class Start:
    """When a trial begins.

    time, sigma: s, and its standard error. speed: m/s, with which the arm is on its way by then.
    in_motion: whether that matters, so that the trial must start with it.
    """

    time: float
    sigma: float
    speed: float = 0.0
    in_motion: bool = False


@dataclass(frozen=True)
class _Hold:
    """One fit of a hold: its residual m, the degree, the release by it s with its variance, and the speed m/s then."""

    residual: float
    degree: int
    begin: float
    variance: float
    speed: float


def release_time(time: np.ndarray, positions: np.ndarray) -> Start:
    """When the arm was let go; at 0 s and in motion if it is on its way from the first frame.

    A hand sways and creeps, but smoothly: where the arm will be a moment later can be foreseen. An arm that is let go
    accelerates most at once, and departs from that (`departures`). The hand's motion before is fitted and continued;
    the arm was let go when its displacement from there began to grow (`onset`). Several fits explain a hold about as
    well: their median counts, and their spread, beside the length of a frame, is its uncertainty.

    Args:
        time (T,) s, uniform. positions (T, S, 3) m, filtered, of an arm that is held, then swings.
    """
    step = float(time[1] - time[0])
    speed = robust_length(np.gradient(positions, time, axis=0))
    end = _end_of_hold(positions[: np.argmax(speed) + 1 + _frames(AHEAD, step)], step)
    if end is None:
        return Start(0.0, step / np.sqrt(12), float(speed[0]), in_motion=True)
    spans = dict.fromkeys(min(_frames(hold, step), end) for hold in HOLDS)
    fits = [_fit_hold(time, positions, end - span, end, degree) for span in spans for degree in DEGREES]
    alike = [fit for fit in fits if fit.residual <= ALIKE * min(fit.residual for fit in fits)]
    begins = [fit.begin for fit in alike]
    variance = np.var(begins) + np.mean([fit.variance for fit in alike]) + step**2 / 12
    swayed = min(alike, key=lambda fit: fit.degree).speed  # a higher degree would find noise to be speed
    return Start(
        float(np.median(begins)), float(np.sqrt(variance)), swayed,
        in_motion=swayed > MOVING * float(speed.max()),
    )  # fmt: skip


def _end_of_hold(positions: np.ndarray, step: float) -> int | None:
    """The last frame (T, S, 3) in which the hand still had the arm; None if it never had."""
    ahead, shortest = _frames(AHEAD, step), _frames(SHORTEST, step)
    departed = departures(positions, _frames(BEHIND, step), ahead, shortest)
    if not len(departed):
        return None
    top = departed.max()
    liftoff = int(np.argmax(departed > LIFTOFF * top))
    usual = float(np.median(departed[: liftoff + 1]))
    quiet = np.flatnonzero(departed[:liftoff] < min(max(QUIET * top, USUAL * usual), 0.5 * LIFTOFF * top))
    return shortest + int(quiet[-1]) + ahead - 1 if len(quiet) >= FORESEEN_FRAMES else None


def departures(positions: np.ndarray, behind: int, ahead: int, shortest: int) -> np.ndarray:
    """How far the arm is, after `ahead` frames, from where a parabola through the last `behind` led, m.

    Args:
        positions: (T, S, 3) m. shortest: frames, fewer than `behind`, from which on something is foreseen.

    Returns:
        From frame `shortest` on, as far as others are `ahead`. Shape (T - shortest - ahead,), if that is positive.
    """
    found = []
    for frame in range(shortest, len(positions) - ahead):
        past = min(behind, frame)
        powers = np.vander(np.arange(-past, 1) / past, 3)
        weights = np.vander([ahead / past], 3) @ np.linalg.pinv(powers)
        led = np.tensordot(weights, positions[frame - past : frame + 1], 1)
        found.append(robust_length(positions[frame + ahead] - led)[0])
    return np.array(found)


def _fit_hold(time: np.ndarray, positions: np.ndarray, first: int, end: int, degree: int) -> _Hold:
    """The frames from `first` to `end` as polynomials of a degree, and when the arm leaves them."""
    since = time - time[end]
    held = np.zeros(len(time), bool)
    held[first : end + 1] = True
    powers = np.vander(since, degree + 1, increasing=True)
    fitted = np.linalg.lstsq(powers[held], positions[held].reshape(held.sum(), -1))[0]
    left = positions - (powers @ fitted).reshape(positions.shape)
    spare = max(held.sum() - 3 * (degree + 1), 1)  # of three frames, the low-pass leaves about one
    begins, frames, misfits = onsets(time, robust_length(left), held, 1e-5, POWERS, LEAP)
    begin, variance = float(time[end]), 0.0
    if len(begins):
        misfits = np.maximum(misfits, 1e-30)
        weights = (misfits / misfits.min()) ** (-frames / 2)  # the likelihoods of the powers
        begin = float(np.average(begins, weights=weights))
        variance = float(np.average((begins - begin) ** 2, weights=weights))
    velocity = polyval(begin - time[end], polyder(fitted)).reshape(1, -1, 3)
    residual = float(np.sqrt(np.square(left[held]).sum() / spare))
    return _Hold(residual, degree, begin, variance, float(robust_length(velocity)[0]))


def _frames(seconds: float, step: float) -> int:
    return max(round(seconds / step), 2)


def free_time(time: np.ndarray, positions: np.ndarray, begin: float) -> float:
    """When a hand that lets go gently is gone, s: it moves along from `begin` on, the arm pulling ever harder.

    An arm that is let go at once accelerates most at once. Where its acceleration still grows, something holds it; so
    it is free from the largest acceleration of its farthest travelling segment before that one's top speed.

    Args:
        time (T,) s, uniform. positions (T, S, 3) m, filtered. begin: s, when the arm began to move.
    """
    tip = positions[:, np.argmax(np.ptp(positions, axis=0).max(axis=-1))]
    velocity = np.gradient(tip, time, axis=0)
    speed, pull = (np.linalg.norm(v, axis=1) for v in (velocity, np.gradient(velocity, time, axis=0)))
    swings = np.flatnonzero((time >= begin) & (np.arange(len(time)) <= np.argmax(speed)))
    return float(time[swings[np.argmax(pull[swings])]]) if len(swings) else begin


def onset(
    time: np.ndarray, moved: np.ndarray, resting: np.ndarray, floor: float = 1e-5, powers: tuple[float, ...] = (2,)
) -> float | None:
    """When the displacement `moved` (T,) m begins to grow, s, after the frames `resting` (T,); None if it does not.

    Args:
        floor: m, what the noise is taken for at least.
        powers: of (t - t0) that come into question; the one that fits best counts.
    """
    begins, _, misfits = onsets(time, moved, resting, floor, powers)
    return float(begins[np.argmin(misfits)]) if len(begins) else None


def onsets(
    time: np.ndarray,
    moved: np.ndarray,
    resting: np.ndarray,
    floor: float,
    powers: tuple[float, ...],
    rise: tuple[float, float] = RISE,
) -> tuple[np.ndarray, int, np.ndarray]:
    """When `moved` (T,) m begins to grow as each of the powers of (t - t0), s, from how many frames, and the misfits.

    Under a force that sets in at t0, as under one that grows while damping prevails, the displacement grows as
    (t - t0)². Its root is a straight line in time, and where that crosses zero is t0.

    Args: as for `onset`.
        rise: times the noise, from where to where it is looked at.
    """
    noise = max(float(np.median(moved[resting])), floor)
    moved = np.sqrt(np.maximum(moved**2 - noise**2, 0))
    low, high = (share * noise for share in rise)
    risen = np.flatnonzero((moved > high) & (time > time[resting][-1]))
    if not len(risen):
        return np.empty(0), 0, np.empty(0)
    last = max(int(risen[0]), 3)
    still = np.flatnonzero(moved[:last] < low)
    first = min(int(still[-1]) + 1 if len(still) else 0, last - 2)
    t, y = time[first : last + 1], moved[first : last + 1]
    found = []
    for power in powers:
        slope, offset = np.polyfit(t, y ** (1 / power), 1)
        misfit = np.square(np.maximum(slope * t + offset, 0) ** power - y).sum()
        if slope > 0:
            found.append((np.clip(-offset / slope, time[max(first - 6, 0)], t[-1]), misfit))
    begins, misfits = np.array(found).reshape(-1, 2).T
    return begins, len(t), misfits


def robust_length(vectors: np.ndarray) -> np.ndarray:
    """Upper quartile over the segments of the lengths of (T, S, 3): a few hidden segments do not matter. (T,)."""
    return np.quantile(np.linalg.norm(vectors, axis=2), 0.75, axis=1)


def cycle_time(time: np.ndarray, commands: np.ndarray) -> Start:
    """When a command (T, K) m first leaves its initial value by 0.5 % of its range; at 0 s if none does."""
    left = np.abs(commands - commands[0])
    moved = np.any(left > np.maximum(0.005 * np.ptp(commands, axis=0), 1e-4), axis=1)
    begin = float(time[max(np.argmax(moved) - 1, 0)]) if moved.any() else 0.0
    return Start(begin, float(time[1] - time[0]) / np.sqrt(12))
