"""When a trial begins: the moment a held arm is let go, or a tendon begins to be pulled."""

import numpy as np

LIFTOFF = 0.2  # share of the top speed that only the released arm reaches
QUIET = 0.03  # share of the top speed below which a hand may still move the arm
FIT = (0.15, 1.0)  # share of the displacement soon after, where it grows as the square of time


def release_time(time: np.ndarray, positions: np.ndarray) -> float:
    """When the arm was let go, s; 0 if it is on its way from the first frame.

    After the release the displacement grows as a (t - t0)² / 2, so its root is a straight line in time, and
    where that crosses zero is t0: the line is fitted beyond what the low-pass rounds off. The upper quartile over the
    segments stands for the arm, so that a few of them bridged over a gap do not matter.

    Args:
        time (T,) s, uniform. positions (T, S, 3) m, filtered, of an arm that is held, then swings.
    """
    speed = _robust_length(np.gradient(positions, time, axis=0))
    liftoff = int(np.argmax(speed > LIFTOFF * speed.max()))
    quiet = np.flatnonzero(speed[: liftoff + 1] < QUIET * speed.max())
    if not len(quiet):
        return 0.0
    held = positions[max(0, quiet[-1] - 12) : quiet[-1] + 1].mean(axis=0)
    end = liftoff + int(0.03 / (time[1] - time[0]))
    moved = _robust_length(positions[quiet[-1] : end + 1] - held)
    share = moved / moved.max()
    used = (share >= FIT[0]) & (share <= FIT[1])
    if used.sum() < 3:
        return float(time[quiet[-1]])
    slope, offset = np.polyfit(time[quiet[-1] : end + 1][used], np.sqrt(moved[used]), 1)
    return float(np.clip(-offset / slope, time[max(0, quiet[-1] - 3)], time[liftoff]))


def _robust_length(vectors: np.ndarray) -> np.ndarray:
    """Upper quartile over the segments of the lengths of (T, S, 3). Shape (T,)."""
    return np.quantile(np.linalg.norm(vectors, axis=2), 0.75, axis=1)


def cycle_time(time: np.ndarray, commands: np.ndarray) -> float:
    """When a command (T, K) m first leaves its initial value by 0.5 % of its range, s; 0 if none does."""
    left = np.abs(commands - commands[0])
    moved = np.any(left > np.maximum(0.005 * np.ptp(commands, axis=0), 1e-4), axis=1)
    return float(time[max(np.argmax(moved) - 1, 0)]) if moved.any() else 0.0
