"""Segments taken for one another: labels that change places, told by the distances along the arm.

The distance between nearby segments hardly depends on the arm's shape. Where two labels are exchanged, both are
at the other's usual distances from their neighbours.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_opening

NEIGHBOURS = 2  # nearest segments with which one may be exchanged
REFERENCES = 4  # nearest other bodies by whose distances two segments are told apart
LEAST_CONTRAST = 3e-3  # m by which the distances of two segments must differ
LONE = 3  # frames that one of the two, alone, has to be at the other's place
CLEAR = 0.3  # the exchanged labels must fit this many times better
SAMPLE = 200  # frames of a log that tell the usual distances


@dataclass
class Swap:
    """first, second: bodies by index. frames: (T,) in which they are exchanged."""

    first: int
    second: int
    frames: np.ndarray


def usual_distances(logs: list[np.ndarray]) -> np.ndarray:
    """Median distances (B, B) in m between the bodies of logs (T, B, 3); NaN where two are never seen together."""
    samples = []
    for positions in logs:
        some = positions[:: max(1, len(positions) // SAMPLE)]
        some = np.where(np.isfinite(some), some, np.nan)
        samples.append(np.linalg.norm(some[:, :, None] - some[:, None], axis=-1))
    together = np.concatenate(samples)
    distances = np.full(together.shape[1:], np.nan)
    for first, second in zip(*np.triu_indices(len(distances), 1), strict=True):
        seen = together[:, first, second]
        seen = seen[np.isfinite(seen)]
        if len(seen):
            distances[first, second] = distances[second, first] = np.median(seen)
    return distances


def find_swaps(positions: np.ndarray, usual: np.ndarray) -> list[Swap]:
    """Exchanged pairs among the bodies of (T, B, 3) m, but for the first, the base; usual: distances (B, B) m."""
    found, count = [], positions.shape[1]
    nearness = np.where(np.isfinite(usual), usual, np.inf)
    for first in range(1, count):
        order = [other for other in np.argsort(nearness[first], kind="stable") if other not in (0, first)]
        for second in order[:NEIGHBOURS]:
            if np.isfinite(usual[first, second]) and not any({s.first, s.second} == {first, second} for s in found):
                frames = _exchanged(positions, usual, first, second, nearness)
                if frames.any():
                    found.append(Swap(first, second, frames))
    return found


def _exchanged(
    positions: np.ndarray, usual: np.ndarray, first: int, second: int, nearness: np.ndarray
) -> np.ndarray:
    """(T,) frames in which the labels of two bodies fit their neighbours only when exchanged.

    Where only one of the two is seen, an outlier may look like it, and it has to last.
    """
    others = [b for b in np.argsort(nearness[first] + nearness[second], kind="stable") if b not in (first, second)]
    others = [b for b in others if np.isfinite(usual[first, b] + usual[second, b])][:REFERENCES]
    if len(others) < 2:
        return np.zeros(len(positions), bool)
    own, other = usual[first, others], usual[second, others]
    to_first = np.linalg.norm(positions[:, [first]] - positions[:, others], axis=-1)
    to_second = np.linalg.norm(positions[:, [second]] - positions[:, others], axis=-1)
    saw_first, saw_second = np.isfinite(to_first), np.isfinite(to_second)
    kept, exchanged = np.zeros(len(positions)), np.zeros(len(positions))
    contrast, terms = np.zeros(len(positions)), saw_first.sum(axis=1) + saw_second.sum(axis=1)
    for seen, found, labelled, opposite in ((saw_first, to_first, own, other), (saw_second, to_second, other, own)):
        kept += np.sum(np.where(seen, abs(found - labelled), 0), axis=1)
        exchanged += np.sum(np.where(seen, abs(found - opposite), 0), axis=1)
        contrast += np.sum(np.where(seen, abs(own - other), 0), axis=1)
    told = (terms >= 3) & (contrast > LEAST_CONTRAST * terms)
    flagged = told & (kept > 0.5 * contrast) & (exchanged < CLEAR * kept)
    both = saw_first.any(axis=1) & saw_second.any(axis=1)
    return flagged & (both | _lasting(flagged))


def _lasting(flags: np.ndarray) -> np.ndarray:
    """Which of (T,) lie in runs of True of at least `LONE` frames."""
    return binary_opening(flags, np.ones(LONE, bool))
