"""Steps between clocks: where one jumps against another and stays there."""

from dataclasses import dataclass

import numpy as np

SIDE = 1.0  # s before and after a jump in which the clocks are compared
FEWEST = 10  # events on either side; fewer tell a step from a delay no better than by chance
FRAMES, JITTERS = 1.5, 8.0  # a step is at least so many intervals, and so many times the jitter
MOST = 20  # jumps that are looked at, the largest first
SOON = 0.1  # quantile of the delays in a stretch: what is late for a while does not count


@dataclass
class ClockStep:
    """at: the first event after it. size: s, by which the later clock goes ahead there."""

    at: int
    size: float


def find_step(late: np.ndarray, early: np.ndarray) -> ClockStep | None:
    """The largest step between two clocks that date the same T events; None if there is none.

    A message that is late raises `late` for a while, and then it comes back. A step stays.

    Args:
        late, early: (T,) s, in the order of arrival. `late` is read farther down the line than `early`.
    """
    interval = np.median(np.diff(late))
    if len(late) < 2 * FEWEST or not interval > 0:
        return None
    ahead = relative(late, early)
    jumps = np.diff(ahead)
    least = max(FRAMES * interval, JITTERS * 1.4826 * np.median(np.abs(jumps - np.median(jumps))))
    candidates = np.flatnonzero(np.abs(jumps) > least) + 1
    candidates = candidates[np.argsort(-np.abs(jumps[candidates - 1]), kind="stable")][:MOST]
    steps = [ClockStep(int(at), size_at(ahead, int(at), interval)) for at in candidates]
    return max((step for step in steps if abs(step.size) > least), key=lambda step: abs(step.size), default=None)


def relative(late: np.ndarray, early: np.ndarray) -> np.ndarray:
    """What `late` (T,) is ahead of `early` (T,), s, without the offset and the drift of one against the other."""
    lag = max(1, len(late) // 8)  # a step reaches an eighth of the slopes only
    ran = early[lag:] - early[:-lag]
    slopes = (late[lag:] - late[:-lag])[ran > 0] / ran[ran > 0]
    return late - late[0] - (np.median(slopes) if len(slopes) else 1.0) * (early - early[0])


def size_at(ahead: np.ndarray, at: int, interval: float) -> float:
    """By how much `ahead` (T,) s is larger from event `at` on than before; 0 too near to an end."""
    side = max(FEWEST, round(SIDE / interval))
    before, after = ahead[max(0, at - side) : at], ahead[at : at + side]
    if min(len(before), len(after)) < FEWEST:
        return 0.0
    return float(np.quantile(after, SOON) - np.quantile(before, SOON))
