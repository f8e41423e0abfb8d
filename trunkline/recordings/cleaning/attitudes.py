"""Whether attitudes are in the frame and the convention that positions are in: by what neighbours say of each other.

On an arm that bends little from body to body, the way from one body to the next is nearly fixed in the first one's
axes, however those are chosen. Where positions were turned or mirrored and attitudes were not, it wanders as the arm
turns, and hardly does once both are taken as they are meant.
"""

from collections.abc import Callable
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.frames import rotation_from_wxyz
from trunkline.recordings.cleaning.usual_distances import usual_distances
from trunkline.recordings.trials.raw_trial import RawTrial

SAMPLE = 30  # frames of a trial
WANDERS = 0.2  # share of the way to a neighbour, by which it has to wander before anything is said
STEADIER = 0.4  # of that, which is left where the true convention is taken
DISPLACED = 0.08  # of the arm's length, by which a body next to the base may be off where its attitude has it
TWIST = np.radians(45)  # of the base about the arm between trials, more than arms twist

AS_GOOD = 1.5  # times the least that a convention leaves, within which another is not excluded
MOST = 3  # conventions that are named

CONVENTIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "inverted": lambda q: q * [1, -1, -1, -1],
    "read as x, y, z, w": lambda q: np.roll(q, 1, axis=-1),
    "read as w, x, y, z": lambda q: np.roll(q, -1, axis=-1),
}


def contradictions(raw_trials: list[RawTrial]) -> list[str]:
    """That the attitudes of a session contradict its positions, in a sentence, with what reconciles them; else none."""
    turns, ways = _ways(raw_trials)
    if not len(ways):
        return []
    wanders = _wandering(turns, ways)
    if wanders <= WANDERS:
        return []
    problem = f"a body's way to its neighbour wanders by {100 * wanders:.0f} % of its length in the body's own axes"
    left = {f"having quaternions {name}": _wandering(turned(turns), ways) for name, turned in CONVENTIONS.items()}
    for axes, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        left[f"turning positions {_axes(axes, signs)}"] = _wandering(turns, ways[..., axes] * signs)
    best = min(left.values())
    if best > STEADIER * wanders:
        return []
    remedies = [remedy for remedy, some in left.items() if some <= AS_GOOD * best]
    fixed = f"; {' or '.join(remedies)} leaves {100 * best:.0f} %" if len(remedies) <= MOST else ""
    return [f"attitudes: {problem}{fixed}: expected positions and attitudes in one frame, right-handed"]


def turned_bases(raw_trials: list[RawTrial], base: str) -> list[list[str]]:
    """For each trial that its base has other axes than in most of the session, in a sentence: as against it, the bodies
    next to it are all turned alike about the arm."""
    faults: list[list[str]] = [[] for _ in raw_trials]
    numbers = [number for number, raw in enumerate(raw_trials) if raw.quaternions is not None]
    if len(numbers) < 3:
        return faults
    usual = usual_distances([np.insert(raw.positions, 0, raw.base_positions, axis=1) for raw in raw_trials])
    near = np.argsort(usual[0, 1:])[:2].tolist()
    if len(near) < 2:
        return faults
    relative = np.array([[_mean_turn(raw_trials[number], body) for body in near] for number in numbers])  # (k, 2, 4)
    twists = np.array([[_twists(relative[:, body], ref) for ref in relative[:, body]] for body in range(2)])
    other = np.all(np.abs(twists) > TWIST, axis=0)  # (k, k): trials that disagree, by both bodies
    alone = other.mean(axis=1) > 0.5
    for place in np.flatnonzero(alone):
        agreeing = np.flatnonzero(~alone)
        angle = np.degrees(np.median(np.abs(twists[:, place][:, agreeing]))) if len(agreeing) else np.nan
        problem = f"{base!r} is turned about the arm by {angle:.0f}° against the session's other trials"
        faults[numbers[int(place)]] = [f"base: {problem}, expected one choice of its axes in a session"]
    return faults


def displaced_bases(raw_trials: list[RawTrial], base: str) -> list[list[str]]:
    """For each trial that the body next to its base is at another place in the base's axes than in most of the session,
    in a sentence: more than its turn against the base explains, as of one half of it on the way."""
    faults: list[list[str]] = [[] for _ in raw_trials]
    numbers = [number for number, raw in enumerate(raw_trials) if raw.quaternions is not None]
    if len(numbers) < 3:
        return faults
    usual = usual_distances([np.insert(raw.positions, 0, raw.base_positions, axis=1) for raw in raw_trials])
    near, length = int(np.nanargmin(usual[0, 1:])), float(np.nanmax(usual))
    places = np.array([_mean_place(raw_trials[number], near) for number in numbers])
    turns = np.array([_mean_turn(raw_trials[number], near) for number in numbers])
    good = np.isfinite(places).all(axis=1) & np.isfinite(turns).all(axis=1)
    numbers, places, rotations = np.array(numbers)[good], places[good], rotation_from_wxyz(turns[good])
    off = np.zeros((len(numbers), len(numbers)))
    for place, rotation in enumerate(rotations):
        halves = Rotation.from_rotvec((rotation * rotations.inv()).as_rotvec() / 2)
        off[place] = np.linalg.norm(halves.apply(places) - places[place], axis=1)
    for place in np.flatnonzero(np.mean(off > DISPLACED * length, axis=1) > 0.5):
        name, far = raw_trials[0].markers[near], 1e3 * float(np.median(off[place]))
        problem = f"in the axes of {base!r}, {name!r} is {far:.0f} mm from where most trials have it"
        faults[int(numbers[place])] = [
            f"base: {problem}, for its attitude: expected one choice of the base's axes and place in a session, and "
            "positions and attitudes in one frame"
        ]
    return faults


def _ways(raw_trials: list[RawTrial]) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes (pairs, n, 4) wxyz of bodies, and the ways (pairs, n, 3) m from each to its nearest; NaN unseen."""
    some = [raw for raw in raw_trials if raw.quaternions is not None]
    if not some:
        return np.empty((0, 0, 4)), np.empty((0, 0, 3))
    positions, turns = [], []
    for raw in some:
        frames = slice(None, None, max(1, len(raw.time) // SAMPLE))
        positions.append(np.insert(raw.positions, 0, raw.base_positions, axis=1)[frames])
        assert raw.quaternions is not None, "as chosen"
        turns.append(np.insert(raw.quaternions, 0, raw.base_quaternions, axis=1)[frames])
    usual = usual_distances(positions)
    where, how = np.concatenate(positions), np.concatenate(turns)
    nearest = np.argmin(np.where(np.isfinite(usual) & (usual > 0), usual, np.inf), axis=1)
    return np.swapaxes(how, 0, 1), np.swapaxes(where[:, nearest] - where, 0, 1)


def _wandering(turns: np.ndarray, ways: np.ndarray) -> float:
    """By which share of its length a way (pairs, n, 3) wanders in axes (pairs, n, 4), in the median of pairs."""
    shares = []
    for turn, way in zip(turns, ways, strict=True):
        visible = np.isfinite(turn).all(axis=1) & np.isfinite(way).all(axis=1)
        if visible.sum() >= 2:
            inside = rotation_from_wxyz(turn[visible]).inv().apply(way[visible])
            off = np.linalg.norm(inside - np.median(inside, axis=0), axis=1)
            shares.append(np.sqrt(np.mean(off**2)) / max(float(np.median(np.linalg.norm(inside, axis=1))), 1e-12))
    return float(np.median(shares)) if shares else 0.0


def _axes(axes: tuple[int, ...], signs: tuple[int, ...]) -> str:
    """As words: to (x, -z, y)."""
    parts = [("-" if sign < 0 else "") + "xyz"[axis] for axis, sign in zip(axes, signs, strict=True)]
    return f"to ({', '.join(parts)})"


def _mean_turn(raw: RawTrial, body: int) -> np.ndarray:
    """Mean attitude (4,) wxyz of a body in the base's axes over a trial; NaN where both are never seen."""
    assert raw.quaternions is not None, "as chosen"
    visible = np.isfinite(raw.base_quaternions).all(axis=1) & np.isfinite(raw.quaternions[:, body]).all(axis=1)
    if not visible.any():
        return np.full(4, np.nan)
    base, turn = (rotation_from_wxyz(q[visible]) for q in (raw.base_quaternions, raw.quaternions[:, body]))
    return (base.inv() * turn).mean().as_quat(scalar_first=True)


def _mean_place(raw: RawTrial, body: int) -> np.ndarray:
    """Median place (3,) m of a body in the base's axes over a trial; NaN where both are never seen."""
    visible = np.isfinite(raw.base_quaternions).all(axis=1) & np.isfinite(raw.positions[:, body]).all(axis=1)
    if not visible.any():
        return np.full(3, np.nan)
    away = raw.positions[visible, body] - raw.base_positions[visible]
    return np.median(rotation_from_wxyz(raw.base_quaternions[visible]).inv().apply(away), axis=0)


def _twists(turns: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Angles (k,), rad from -pi to pi, about the base's z axis between attitudes (k, 4) and one of them."""
    good = np.isfinite(turns).all(axis=1)
    twists = np.zeros(len(turns))
    if np.isfinite(reference).all():
        change = rotation_from_wxyz(turns[good]) * rotation_from_wxyz(reference).inv()
        x, y, z, w = change.as_quat().T
        twists[good] = (2 * np.arctan2(z, w) + np.pi) % (2 * np.pi) - np.pi
    return twists
