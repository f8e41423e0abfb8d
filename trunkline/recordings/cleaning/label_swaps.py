"""Label swaps, found by the distances along the arm, and repaired.

The distance between nearby markers hardly depends on the arm's shape. Where two labels are exchanged, both are
at the other's usual distances from their neighbours.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.reference import Reference
from trunkline.recordings.signals.runs import lasting

LONGEST = 4  # labels in a round
NEIGHBOURS = 2  # nearest markers with which one may be exchanged
REFERENCES = 4  # nearest other bodies by whose distances two markers are told apart
LEAST_CONTRAST = 3e-3  # m by which the distances of two markers must differ
LONE = 3  # frames that one of the two, alone, has to be at the other's place
CLEAR = 0.3  # the exchanged labels must fit this many times better


@dataclass
class LabelSwap:
    """bodies: by index, each label on the next one's pose, the last on the first's. frames: (T,) in which they are."""

    bodies: tuple[int, ...]
    frames: np.ndarray


def find_label_swaps(positions: np.ndarray, usual: np.ndarray, marked_base: bool = True) -> list[LabelSwap]:
    """Labels that changed places, up to `LONGEST` at a time, among the bodies of (T, B, 3) m, the base first.

    Args:
        usual: distances (B, B) m.
        marked_base: whether a body marks the base, whose label may then be exchanged as well.
    """
    candidates = _candidates(usual, marked_base)
    if not candidates:
        return []
    distances = np.empty((len(positions), *usual.shape))
    for body in range(len(usual)):  # one by one, as all differences at once take three times the memory
        distances[:, body] = np.linalg.norm(positions - positions[:, [body]], axis=-1)
    least, best = np.full(len(positions), np.inf), np.full(len(positions), -1)  # the first that leaves least
    for place, bodies in enumerate(candidates):
        flagged = np.flatnonzero(_exchanged(distances, usual, bodies))
        left = _misfit(distances[flagged], usual, bodies)
        better = left < least[flagged]
        least[flagged[better]], best[flagged[better]] = left[better], place
    return [LabelSwap(bodies, best == place) for place, bodies in enumerate(candidates) if (best == place).any()]


def repair_label_swaps(
    base: tuple[np.ndarray, np.ndarray],
    positions: np.ndarray,
    quaternions: np.ndarray | None,
    time: np.ndarray,
    reference: Reference,
    findings: Findings,
) -> None:
    """Give labels that changed places back, in the poses of the base (where a body marks it) and of the markers, at
    times (T,) s."""
    if reference.distances is None:
        return
    names = [reference.base or "base", *reference.markers]
    bodies = np.insert(positions, 0, base[0], axis=1)
    turns = None if quaternions is None else np.insert(quaternions, 0, base[1], axis=1)
    for swap in find_label_swaps(bodies, reference.distances, reference.base is not None):
        wrong, right = np.array(swap.bodies), np.array([*swap.bodies[1:], swap.bodies[0]])
        for values in (bodies, turns):
            if values is not None:
                values[np.ix_(swap.frames, right)] = values[np.ix_(swap.frames, wrong)]
        count, who = int(swap.frames.sum()), " and ".join(repr(names[body]) for body in swap.bodies)
        begin, end = time[np.flatnonzero(swap.frames)[[0, -1]]]
        when = f"between {begin:.2f} and {end:.2f} s"
        findings.repairs.append(f"{who} were taken for each other in {count} frames {when}, put right")
    base[0][:], positions[:] = bodies[:, 0], bodies[:, 1:]
    if turns is not None and quaternions is not None:
        base[1][:], quaternions[:] = turns[:, 0], turns[:, 1:]


def _candidates(usual: np.ndarray, marked_base: bool) -> list[tuple[int, ...]]:
    """Rounds of near bodies, the shortest first, in every order."""
    nearness = np.where(np.isfinite(usual), usual, np.inf)
    bodies = range(0 if marked_base else 1, len(usual))
    order = np.argsort(nearness, axis=1, kind="stable").tolist()
    near = {first: [other for other in order[first] if other in bodies and other != first] for first in bodies}
    near = {first: others[:NEIGHBOURS] for first, others in near.items()}
    rounds, sets = [], {frozenset((a, b)) for a in bodies for b in near[a] if np.isfinite(usual[a, b])}
    for _ in range(2, LONGEST + 1):
        ordered = sorted(map(sorted, sets))
        rounds += [(first, *others) for first, *rest in ordered for others in permutations(rest)]
        sets = {some | {more} for some in sets for body in some for more in near[body] if more not in some}
    return rounds


def _misfit(distances: np.ndarray, usual: np.ndarray, bodies: tuple[int, ...]) -> np.ndarray:
    """Mean misfit (T,) m of all distances (T, B, B), each of the labels `bodies` taken for the next."""
    order = np.arange(len(usual))
    order[[*bodies[1:], bodies[0]]] = bodies
    first, second = np.triu_indices(len(usual), 1)
    return np.nanmean(np.abs(distances[:, order[first], order[second]] - usual[first, second]), axis=1)


def _exchanged(distances: np.ndarray, usual: np.ndarray, bodies: tuple[int, ...]) -> np.ndarray:
    """(T,) frames in which the labels `bodies` fit their neighbours only when each is taken for the next.

    Where but one of them is seen, an outlier may look like it, and it has to last; then two distances are enough.
    """
    nearness = np.where(np.isfinite(usual), usual, np.inf)[list(bodies)].sum(axis=0)
    others = [b for b in np.argsort(nearness, kind="stable").tolist() if b not in bodies]
    others = [b for b in others if np.isfinite(usual[list(bodies), b]).all()][:REFERENCES]
    if len(others) < 2:
        return np.zeros(len(distances), bool)
    as_labelled, exchanged, contrast, terms, both = (np.zeros(len(distances)) for _ in range(5))
    for label, pose in zip(bodies, (*bodies[1:], bodies[0]), strict=True):
        usual_own, usual_other = usual[label, others], usual[pose, others]
        measured = distances[:, label, others]
        visible = np.isfinite(measured)
        as_labelled += np.sum(np.where(visible, abs(measured - usual_own), 0), axis=1)
        exchanged += np.sum(np.where(visible, abs(measured - usual_other), 0), axis=1)
        contrast += np.sum(np.where(visible, abs(usual_own - usual_other), 0), axis=1)
        terms += visible.sum(axis=1)
        both += visible.any(axis=1)
    enough = ((terms >= 3) | ((terms == 2) & (both == 1))) & (contrast > LEAST_CONTRAST * terms)
    flagged = enough & (as_labelled > 0.5 * contrast) & (exchanged < CLEAR * as_labelled)
    return flagged & ((both == len(bodies)) | lasting(flagged, LONE))
