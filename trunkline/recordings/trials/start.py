"""When a trial begins: the moment a held arm is let go, or a tendon begins to be pulled."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion

AHEAD, BEHIND = 0.033, 0.1  # s: how far a hand's motion is foreseen, and from how much of it
SHORTEST = 0.08  # s of a hold, before which nothing is foreseen
LIFTOFF = 0.5  # share of the largest departure from what was foreseen that only the released arm reaches
QUIET = 0.05  # share of it below which a hand may still move the arm,
USUAL = 2.0  # and times its median before, if that is more
FORESEEN_FRAMES = 3  # at least, or there was no hold
HOLD, FREE = 0.15, 0.07  # s before and after the release that are fitted
SEARCHED = 0.05  # s to either side of the first guess
DEGREE = 2  # of the hand's motion
LEAVING = ((2, 3), (2, 2.5, 3))  # powers of time in which a released arm leaves: as a mass on springs, or, as the end
# of a long beam leaves by the 1.5th, its mobility falling with the root of the frequency (Cremer, Heckl), between these
PLAINLY = 0.5  # share of the residual that is left by then, or the arm leaves in the simpler way
TRIES = 4  # a frame
FAR = 0.05  # share of the largest range by which a command is far from its initial value
RESTED = 0.1  # s, for which a command has to stand at first, or the arm is on its way already
NOISES, EXACT = 5.0, 1e-6  # times its median departure, and m, by which a command that rests may depart
SWAYING = 0.03  # share of the top speed from which on a hand gives the arm a start of its own

Smooth = Callable[[np.ndarray], np.ndarray]  # the low-pass that positions went through, on columns (T, C)


@dataclass(frozen=True)
class Start:
    """When a trial begins.

    time, sigma: s, and its standard error. speed: m/s, with which the arm is on its way by then.
    in_motion: whether it moves from the first frame on, let go before.
    swaying: whether the hand's own speed as it lets go matters, so that the trial must start with it.
    """

    time: float
    sigma: float
    speed: float = 0.0
    in_motion: bool = False
    swaying: bool = False


def release_time(time: np.ndarray, positions: np.ndarray, measured: np.ndarray, smooth: Smooth) -> Start:
    """When the arm was let go; at 0 s and in motion if it is on its way from the first frame.

    A hand sways and creeps, but smoothly: where the arm will be a moment later can be foreseen. An arm that is let go
    accelerates most at once, and departs from that (`departures`): a first guess. Around it, positions are fitted by
    the hand's motion, a polynomial, and from an instant on powers of the time since, which went through the same
    low-pass; the instant with the least residual counts, of the fewest powers that do. Its uncertainty is that of the
    fit, how far it is from the first guess, which was made in another way, and a frame.

    Args:
        time (T,) s, uniform. positions (T, S, 3) m, filtered, of an arm that is held, then swings. measured (T, S):
            where they count.
    """
    step = float(time[1] - time[0])
    speed = robust_length(np.gradient(positions, time, axis=0), _or_all(_within(measured, 1)))
    until = np.argmax(speed) + 1 + _frames(AHEAD, step)
    end = _end_of_hold(positions[:until], measured[:until], step)
    if end is None:
        return Start(0.0, step / np.sqrt(12), float(speed[0]), in_motion=True)
    begin, variance, swayed = _let_go(time, positions, measured, smooth, float(time[end]))
    sigma = float(np.sqrt(variance + (begin - time[end]) ** 2 / 3 + step**2 / 12))
    return Start(begin, sigma, swayed, swaying=swayed > SWAYING * float(speed.max()))


def _let_go(
    time: np.ndarray, positions: np.ndarray, measured: np.ndarray, smooth: Smooth, guess: float
) -> tuple[float, float, float]:
    """The instant near `guess`, s, from which powers of the time since explain the motion best, its variance, and the
    speed, m/s, that the hand had given the arm by then."""
    step = float(time[1] - time[0])
    window = (time >= guess - HOLD) & (time <= guess + FREE)
    markers = _or_all(np.asarray(measured[window].all(axis=0)))
    motion = positions[window][:, markers].reshape(window.sum(), -1)
    before_release = np.vander((time[window] - guess) / HOLD, DEGREE + 1)
    instants = np.arange(max(guess - SEARCHED, time[window][0]), guess + min(SEARCHED, FREE / 2), step / TRIES)

    def explain(instant: float, powers: tuple[float, ...]) -> tuple[float, np.ndarray]:
        since = np.maximum(time - instant, 0)[:, None] / FREE
        design = np.hstack([before_release, smooth(since ** np.array(powers))[window]])
        fit = np.linalg.lstsq(design, motion)[0]
        return float(np.square(motion - design @ fit).sum()), fit

    residuals, fits = np.full(len(instants), np.inf), []
    for powers in LEAVING:
        errors, tried = zip(*(explain(instant, powers) for instant in instants), strict=True)
        if min(errors) < PLAINLY * residuals.min():
            residuals, fits = np.array(errors), tried
    best = int(np.argmin(residuals))
    spare = max(motion.size / 3 - fits[best].size, 1)  # of three frames, the low-pass leaves about one
    inner = int(np.clip(best, 1, len(instants) - 2))
    curvature = (residuals[inner - 1] - 2 * residuals[inner] + residuals[inner + 1]) / (step / TRIES) ** 2
    variance = 2 * residuals[best] / spare / curvature if curvature > 0 else SEARCHED**2
    return float(instants[best]), float(variance), _speed(fits[best][: DEGREE + 1], (instants[best] - guess) / HOLD)


def _speed(polynomials: np.ndarray, at: float) -> float:
    """Speed, m/s, of markers that move as polynomials (DEGREE + 1, 3 S) of time over HOLD, highest power first."""
    velocity = np.stack([np.polyval(np.polyder(column), at) for column in polynomials.T]) / HOLD
    velocity = velocity.reshape(1, -1, 3)
    return float(robust_length(velocity, np.ones(velocity.shape[:2], bool))[0])


def _end_of_hold(positions: np.ndarray, measured: np.ndarray, step: float) -> int | None:
    """The last frame (T, S, 3) in which the hand still had the arm; None if it never had."""
    ahead, shortest = _frames(AHEAD, step), _frames(SHORTEST, step)
    departed = departures(positions, measured, _frames(BEHIND, step), ahead, shortest)
    if not len(departed):
        return None
    top = departed.max()
    liftoff = int(np.argmax(departed > LIFTOFF * top))
    usual = float(np.median(departed[: liftoff + 1]))
    quiet = np.flatnonzero(departed[:liftoff] < min(max(QUIET * top, USUAL * usual), 0.5 * LIFTOFF * top))
    return shortest + int(quiet[-1]) + ahead - 1 if len(quiet) >= FORESEEN_FRAMES else None


def departures(
    positions: np.ndarray, measured: np.ndarray, behind: int, ahead: int, shortest: int
) -> np.ndarray:
    """How far the arm is, after `ahead` frames, from where a parabola through the last `behind` led, m.

    Args:
        positions: (T, S, 3) m. measured: where they count, (T, S). shortest: frames, fewer than `behind`, from which on
            something is foreseen.

    Returns:
        From frame `shortest` on, as far as others are `ahead`. Shape (T - shortest - ahead,), if that is positive.
    """
    distances = []
    for frame in range(shortest, len(positions) - ahead):
        past = min(behind, frame)
        powers = np.vander(np.arange(-past, 1) / past, 3)
        weights = np.vander([ahead / past], 3) @ np.linalg.pinv(powers)
        led = np.tensordot(weights, positions[frame - past : frame + 1], 1)
        counts = measured[frame - past : frame + 1].all(axis=0) & measured[frame + ahead]
        distances.append(robust_length(positions[frame + ahead] - led, _or_all(counts)[None])[0])
    return np.array(distances)


def _frames(seconds: float, step: float) -> int:
    return max(round(seconds / step), 2)


def free_time(time: np.ndarray, positions: np.ndarray, measured: np.ndarray, begin: float) -> float:
    """When a hand that lets go gently is gone, s: it moves along from `begin` on, the arm pulling ever harder.

    An arm that is let go at once accelerates most at once. Where its acceleration still grows, something holds it; so
    it is free from the largest acceleration of its farthest travelling marker before that one's top speed.

    Args:
        time (T,) s, uniform. positions (T, S, 3) m, filtered. measured (T, S): where they count. begin: s, when the
            arm began to move.
    """
    counts = np.broadcast_to(measured[..., None], positions.shape)
    way = positions.max(axis=0, where=counts, initial=-np.inf) - positions.min(axis=0, where=counts, initial=np.inf)
    velocity, counts = np.gradient(positions, time, axis=0), _within(measured, 2)
    top = np.argmax(np.where(counts, np.linalg.norm(velocity, axis=2), 0), axis=0)
    swing = (time >= begin)[:, None] & (np.arange(len(time))[:, None] <= top)
    whole = np.all(counts | ~swing, axis=0) & measured.any(axis=0)
    if not whole.any():  # as `_or_all`
        return free_time(time, positions, np.ones_like(measured), begin)
    farthest = int(np.argmax(np.where(whole, way.max(axis=-1), -np.inf)))
    pull = np.linalg.norm(np.gradient(velocity[:, farthest], time, axis=0), axis=1)
    swings = np.flatnonzero(swing[:, farthest])
    return float(time[swings[np.argmax(pull[swings])]]) if len(swings) else begin


def _within(measured: np.ndarray, frames: int) -> np.ndarray:
    """Where so many frames to either side were measured too, of (T, S)."""
    return binary_erosion(measured, np.ones((2 * frames + 1, 1)), border_value=1)


def _or_all(counts: np.ndarray) -> np.ndarray:
    """All (..., S) where none counts: each has a gap there, and what bridges it is all that there is."""
    return np.where(counts.any(axis=-1, keepdims=True), counts, True)


def robust_length(vectors: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Upper quartile over the measured (T, S) markers of the lengths of (T, S, 3): a few exchanged ones do not matter.
    0 where none was measured. Shape (T,)."""
    lengths = np.where(measured, np.linalg.norm(vectors, axis=2), np.nan)
    lengths[~measured.any(axis=1)] = 0
    return np.nanquantile(lengths, 0.75, axis=1)


def cycle_time(time: np.ndarray, commands: np.ndarray) -> Start:
    """When a command (T, K) m first leaves its initial value; at 0 s if none does, and in motion if it
    never rested: then the trial is a piece of a longer motion.

    That is before it is far from it. A command that is sent rests exactly until then, measured tendon positions in its
    place have noise: as much as in the first half of that time.
    """
    step = float(time[1] - time[0])
    least = max(FAR * float(np.ptp(commands, axis=0).max(initial=0)), 1e-4)
    far = np.any(np.abs(commands - commands[0]) > least, axis=1)
    if not far.any():
        return Start(0.0, step / np.sqrt(12))
    before = commands[: np.argmax(far)]
    early = before[: (len(before) + 1) // 2]
    left = np.abs(before - np.median(early, axis=0))
    noise = np.median(left[: len(early)], axis=0)
    resting = np.flatnonzero(np.all(left <= NOISES * noise + EXACT, axis=1))
    last = float(time[resting[-1]]) if len(resting) else 0.0
    if last < RESTED:
        return Start(0.0, step / np.sqrt(12), in_motion=True)
    return Start(last + step / 2, step / np.sqrt(12))
