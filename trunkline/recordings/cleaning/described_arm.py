"""A session's bodies against the arm that is described: in which unit they are, how far apart, and which way it goes.

The described arm is where its markers are while it is straight: m in the base frame, each of shape (3,), by name.
Bodies that are next to each other along it are hardly nearer while it bends, and never farther apart.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from trunkline.recordings.cleaning.usual_distances import usual_distances
from trunkline.recordings.signals.base_frame import average_base, to_base_frame
from trunkline.recordings.signals.units import METRES_PER
from trunkline.recordings.trials.raw_trial import RawTrial

FITS = 1.5  # ratio of distances to the described ones, or its inverse, by which another unit is taken
WRONG = 2.0  # from which on the declared unit, or the description, is wrong; inches over centimetres are 2.54
LONE = 2.5  # the inverse of both, of one body alone: it comes as near to the base as the arm bends
LONGER, SHORTER = 1.04, 0.85  # ratios from which on it is said; an arm that bends is a little shorter, never longer
OFF = 0.3  # share of the arm's length by which a body may be from where its neighbours would have it
SIDE = np.radians(60)  # between the described arm and what is measured, next to the base, in every trial

Places = Mapping[str, np.ndarray]


def size_ratio(distances: np.ndarray, markers: Sequence[str], arm: Places) -> float:
    """How many times as far apart as on the described arm bodies are that are next to each other along it; NaN where
    it has no such markers.

    Args:
        distances: usual ones between the base and the `markers`, m. Shape (1 + S, 1 + S).
    """
    ratios = [distances[a, b] / described for a, b, described in _neighbours(markers, arm)]
    return float(np.nanmedian(ratios)) if np.isfinite(ratios).any() else float("nan")


def fits(ratio: float, lone: bool, limit: float = WRONG) -> bool:
    """Whether an arm may be of that many times the described size. lone: one body alone tells it."""
    return 1 / (LONE if lone else limit) <= ratio <= limit


def unit_that_fits(ratios: Mapping[str, float], lone: bool) -> str | None:
    """The only unit with which bodies are as far apart as on the described arm, of `ratios` by unit; else None."""
    fitting = [unit for unit, ratio in ratios.items() if fits(ratio, lone, FITS)]
    return fitting[0] if len(fitting) == 1 else None


def against_arm(raw_trials: list[RawTrial], arm: Places, base: str | None, unit: str) -> list[str]:
    """What cannot be true of a session's bodies on the described arm, a sentence each.

    Args:
        base: the name of the body that marks the mount, None where none does.
        unit: of the logs' positions.
    """
    markers = raw_trials[0].markers
    usual = usual_distances([np.insert(raw.positions, 0, raw.base_positions, axis=1) for raw in raw_trials])
    pairs = _neighbours(markers, arm)
    if not pairs:
        return []
    ratio = size_ratio(usual, markers, arm)
    length = max(float(np.linalg.norm(place)) for place in arm.values())
    names = (base or "base", *markers)
    faults = [
        f"{names[b]!r} is usually {1e3 * usual[a, b]:.0f} mm from {names[a]!r}, {1e3 * described:.0f} mm on the "
        "described arm: are its poses in another frame or unit, or are names exchanged?"
        for a, b, described in pairs
        if abs(usual[a, b] - described) > OFF * length
    ]
    if not np.isnan(ratio) and not fits(ratio, len(pairs) == 1):
        others = {other: ratio * metres / METRES_PER[unit] for other, metres in METRES_PER.items()}
        other = unit_that_fits(others, len(pairs) == 1)
        remedy = f"`frame.unit: {other}` would fit" if other else f"no unit fits ({', '.join(METRES_PER)})"
        far = f"bodies are {ratio:.3g} times as far apart as on the arm under build_mjcf, in {unit}"
        return [f"unit: {far}, expected {1 / WRONG:.2g} to {WRONG:g} times: {remedy}"]
    return faults or _base_axes(raw_trials, arm, base, length)


def doubtful_size(raw_trials: list[RawTrial], arm: Places) -> str:
    """That the session's bodies are not as far apart as on the described arm, though no unit is wrong; else empty."""
    usual = usual_distances([np.insert(raw.positions, 0, raw.base_positions, axis=1) for raw in raw_trials])
    markers = raw_trials[0].markers
    ratio = size_ratio(usual, markers, arm)
    if np.isnan(ratio) or len(markers) == 1 or SHORTER <= ratio <= LONGER:
        return ""
    causes = "are the cameras' calibration, the markers' places on bodies and the described lengths right?"
    return f"unit: bodies are {ratio:.3g} times as far apart as on the arm under build_mjcf: {causes}"


def _neighbours(markers: Sequence[str], arm: Places) -> list[tuple[int, int, float]]:
    """(body, next body, m between them on the described arm), the base being 0, along the arm; none of one unknown."""
    if not markers or not set(markers) <= arm.keys():
        return []
    places = [np.zeros(3), *(arm[name] for name in markers)]
    order = np.argsort([np.linalg.norm(place) for place in places], kind="stable").tolist()
    pairs = [(a, b, float(np.linalg.norm(places[b] - places[a]))) for a, b in zip(order, order[1:], strict=False)]
    return [pair for pair in pairs if pair[2] > 0]


def _base_axes(raw_trials: list[RawTrial], arm: Places, base: str | None, length: float) -> list[str]:
    """An arm that in no trial leaves the base where the described one does."""
    markers = raw_trials[0].markers
    sizes = np.array([np.linalg.norm(arm[name]) for name in markers])
    far_enough = np.flatnonzero(sizes >= min(0.05 * length, sizes.max()))
    near = int(far_enough[np.argmin(sizes[far_enough])])
    described, places = arm[markers[near]], []
    for raw in raw_trials:
        mount = average_base(raw.base_positions, raw.base_quaternions)
        place = np.nanmedian(to_base_frame(mount, raw.positions[:, near], None)[0], axis=0)
        places.append(place / max(float(np.linalg.norm(place)), 1e-12))
    angles = np.arccos(np.clip(np.array(places) @ described / np.linalg.norm(described), -1, 1))
    if not angles.min() > SIDE:
        return []
    best = 1e3 * sizes[near] * places[int(np.argmin(angles))]
    where, expected = (f"[{', '.join(f'{x:.0f}' for x in place + 0.0)}] mm" for place in (best, 1e3 * described))
    problem = f"in its axes the arm leaves it towards {markers[near]!r} at {where}, at {expected} as described"
    if base is None:
        return [f"base: {problem}: are `base` and `frame.up` in session.yaml right?"]
    return [f"base: {base!r}: {problem}: is the frame left-handed, or are its axes not the arm's (z back along it)?"]
