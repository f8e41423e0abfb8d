"""When a trial begins: the moment a held arm is let go, or a tendon begins to be pulled."""

import numpy as np

LIFTOFF = 0.2  # share of the top speed that only the released arm reaches
QUIET = 0.03  # share of the top speed below which a hand may still move the arm
REST = 0.25  # s before the motion in which the noise is measured
RISE = (2.0, 16.0)  # times the noise: where the displacement stands out, yet grows as the square of time


def release_time(time: np.ndarray, positions: np.ndarray) -> float:
    """When the arm was let go, s; 0 if it is on its way from the first frame.

    Args:
        time (T,) s, uniform. positions (T, S, 3) m, filtered, of an arm that is held, then swings.
    """
    speed = robust_length(np.gradient(positions, time, axis=0))
    liftoff = int(np.argmax(speed > LIFTOFF * speed.max()))
    quiet = np.flatnonzero(speed[: liftoff + 1] < QUIET * speed.max())
    if not len(quiet):
        return 0.0
    end = time[quiet[-1]]
    resting = (time >= end - REST) & (time <= end)
    begin = onset(time, robust_length(positions - positions[resting].mean(axis=0)), resting)
    return float(end) if begin is None else begin


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
    time: np.ndarray,
    moved: np.ndarray,
    resting: np.ndarray,
    floor: float = 1e-5,
    powers: tuple[int, ...] = (2,),
) -> float | None:
    """When the displacement `moved` (T,) m begins to grow, s, after the frames `resting` (T,); None if it does not.

    Under a force that sets in at t0, as under one that grows while damping prevails, the displacement grows as
    (t - t0)². Its root is a straight line in time, and where that crosses zero is t0.

    Args:
        floor: m, what the noise is taken for at least.
        powers: of (t - t0) that come into question; the one that fits best counts.
    """
    noise = max(float(np.median(moved[resting])), floor)
    moved = np.sqrt(np.maximum(moved**2 - noise**2, 0))
    low, high = (share * noise for share in RISE)
    risen = np.flatnonzero((moved > high) & (time > time[resting][-1]))
    if not len(risen):
        return None
    last = max(int(risen[0]), 3)
    still = np.flatnonzero(moved[:last] < low)
    first = min(int(still[-1]) + 1 if len(still) else 0, last - 2)
    t, y = time[first : last + 1], moved[first : last + 1]
    best, begin = np.inf, None
    for power in powers:
        slope, offset = np.polyfit(t, y ** (1 / power), 1)
        misfit = np.square(np.maximum(slope * t + offset, 0) ** power - y).sum()
        if slope > 0 and misfit < best:
            best, begin = misfit, float(np.clip(-offset / slope, time[max(first - 6, 0)], t[-1]))
    return begin


def robust_length(vectors: np.ndarray) -> np.ndarray:
    """Upper quartile over the segments of the lengths of (T, S, 3): a few hidden segments do not matter. (T,)."""
    return np.quantile(np.linalg.norm(vectors, axis=2), 0.75, axis=1)


def cycle_time(time: np.ndarray, commands: np.ndarray) -> float:
    """When a command (T, K) m first leaves its initial value by 0.5 % of its range, s; 0 if none does."""
    left = np.abs(commands - commands[0])
    moved = np.any(left > np.maximum(0.005 * np.ptp(commands, axis=0), 1e-4), axis=1)
    return float(time[max(np.argmax(moved) - 1, 0)]) if moved.any() else 0.0
