"""Times of frames that came late, evened out: cameras take frames at one rate, however late each is stamped or logged.

A stamp of arrival is late by what the network took, a log time by what the recorder did before. Some frames then come
almost at once, and a smooth curve through them would run through their noise as if it were speed.
"""

from dataclasses import dataclass

import numpy as np

from trunkline.recordings.signals.clock import fit_frames

SHORT, OFTEN = 0.6, 0.03  # intervals below which a step is short, and share of short steps that ordinary jitter has not
JITTER = 0.25  # intervals by which steps differ, that ordinary jitter has not either
COINCIDE = 0.05  # intervals, below which a single step is no jitter
FEWEST = 10  # frames, below which no rate shows
SIDE = 10  # frames to either side of a loss whose quickest are compared
FEW = 4  # at least
STEP = 0.6  # intervals by which the quickest have to be later from then on
ROUNDS = 50  # losses, at most
SOON = 0.1  # quantile of lateness that stands for frames that did not wait


@dataclass
class EvenTimes:
    """time: (T,) s, without what each frame was late. rate: Hz, of the cameras. late: (T,) s. missing: frames lost."""

    time: np.ndarray
    rate: float
    late: np.ndarray
    missing: int


def usual_interval(time: np.ndarray) -> float:
    """Of frames at times (T,) s, in order, also where they come in bursts."""
    far = max(1, len(time) // 8)
    return float(np.median(time[far:] - time[:-far])) / far


def is_uneven(time: np.ndarray) -> bool:
    """Whether frames at times (T,) s, in order, come almost at once now and then, as no camera takes them."""
    if len(time) < FEWEST:
        return False
    steps, interval = np.diff(time), usual_interval(time)
    jitter = 1.4826 * np.median(np.abs(steps - np.median(steps)))
    short = np.mean(steps < SHORT * interval) > OFTEN
    return bool(short or steps.min() < COINCIDE * interval or jitter > JITTER * interval)


def even_times(time: np.ndarray, frames: np.ndarray | None) -> EvenTimes | None:
    """Times (T,) s, in order, by which frames came late, evened out; None where nobody can tell which frame is which.

    Args: frames: their numbers, which increase, or None: then they are counted. A frame that was lost makes all later
        ones late for good, a delay only some.
    """
    count = frames - frames[0] if frames is not None else _counted(time)
    if count is None:
        return None
    fit = fit_frames(np.round(time * 1e9), count)
    late = time - time[0] - fit.start - count / fit.rate
    soon = float(np.quantile(late, SOON))
    even = time[0] + fit.start + soon + count / fit.rate
    return EvenTimes(even, fit.rate, time - even, int(np.sum(np.diff(count) - 1)))


def _counted(time: np.ndarray) -> np.ndarray | None:
    """Numbers (T,) of frames by their times alone; None where they are later for a while than they ever were lost."""
    interval, count = usual_interval(time), np.arange(len(time))
    waits = np.append(np.diff(time) < SHORT * interval, False)  # the next came at once: this one had waited
    settled = np.flatnonzero(~waits)
    if len(settled) < 2 * FEW:
        return None
    for _ in range(ROUNDS):
        fit = fit_frames(np.round(time * 1e9), count)
        rises = _rises((time - count / fit.rate)[settled])
        if rises.max(initial=0.0) < STEP * interval:
            return count if rises.min(initial=0.0) > -STEP * interval else None
        likely = np.flatnonzero(rises > max(STEP * interval, 0.8 * rises.max()))
        first = settled[likely + FEW - 1]
        widest = int(np.argmax(time[first + 1] - time[first]))
        lost = round(float(rises[likely[widest]]) / interval)
        count = count + max(lost, 1) * (np.arange(len(time)) > first[widest])
    return None


def _rises(late: np.ndarray) -> np.ndarray:
    """By how much the quickest of the frames after each are later than those up to it, where there are `FEW` on either
    side. Shape (T - 2 FEW + 1,)."""
    return np.array([
        late[place : place + SIDE].min() - late[max(0, place - SIDE) : place].min()
        for place in range(FEW, len(late) - FEW + 1)
    ])  # fmt: skip
