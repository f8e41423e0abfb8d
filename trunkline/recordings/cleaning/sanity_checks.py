"""Whether a trial can be what session.yaml says: its bodies against the arm, its motion against the experiment.

Lengths are measured against the arm's own, which is the largest of the markers' usual distances from the base. Every
check compares a trial with that, with the session's other trials, or with what its kind of experiment means.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from trunkline.frames import rotation_from_wxyz
from trunkline.recordings.cleaning.attitudes import contradictions, displaced_bases, turned_bases
from trunkline.recordings.cleaning.checks import Findings, deciding
from trunkline.recordings.cleaning.described_arm import Places, against_arm, doubtful_size
from trunkline.recordings.cleaning.pulls import check_pulls, encoder_zeros
from trunkline.recordings.cleaning.usual_distances import usual_distances
from trunkline.recordings.signals.smoothing import fill_gaps
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_stepwise
from trunkline.recordings.trials.raw_trial import RawTrial

NEAREST = 4  # other bodies by whose distances a body's place is told
BLOCK = 12  # frames whose median is a sample of motion: few outliers are left, and a third of the noise
CLEAR = 3.0  # times the motion of another body, by which a base moves that is none
OTHER_UNIT = 3.0  # ratio of sizes that no two shapes of one arm have
LONGER = 0.01  # share of the arm's length by which the way along the named order has to be longer than need be


@dataclass
class SanityLimits:
    """What a trial must be like. Shares are of the arm's length.

    still: by how much an arm at rest may move, as a share; an arm in motion moves by more.
    distance: by how much a body's distances to its neighbours may differ from the usual ones, as a share.
    pull: factor by which pulls may differ from the trial's level, and measured ones from commanded ones.
    clock: s, by which the arm may move after its tendons, by log times, and by which its lags in trials may differ.
    otherwise: what becomes of a trial, or a session, that is not: "refuse", or "warn" and go on with it.
    """

    still: Annotated[float, Field(gt=0, le=0.2)]
    distance: Annotated[float, Field(gt=0, le=0.5)]
    pull: Annotated[float, Field(ge=1.5, le=100)]
    clock: Annotated[float, Field(gt=0, le=1)]
    otherwise: Literal["refuse", "warn"]


def check_sanity(
    raw_trials: list[RawTrial],
    findings: list[Findings],
    base: str | None,
    settings: SanityLimits,
    arm: Places | None = None,
    unit: str = "m",
) -> list[str]:
    """Add to each raw trial's findings what cannot be true of it; returned: what cannot be true of the session.

    What is usual is what the raw trials of the split `identify` say, or all where there are none of it.

    Args:
        base: the name of the body that marks the mount, None where none does.
        arm: the described one, None where nobody describes it.
        unit: of the logs' positions.
    """
    chosen, _ = deciding(raw_trials, lambda raw: raw.split)
    usual = usual_distances([_bodies(raw) for raw in chosen])
    length = float(np.nanmax(usual[0]))
    names, idle = (base or "base", *raw_trials[0].markers), settings.still * length
    zeros = encoder_zeros(chosen, idle)
    for raw, record in zip(raw_trials, findings, strict=True):
        record.faults += _misplaced(raw, usual, names, settings.distance * length)
        record.faults += _motion(raw, length, settings.still)
        record.faults += check_pulls(raw, length, idle, settings.pull, zeros)
    for record, sentences in zip(findings, _other_frames(findings), strict=True):
        record.faults += sentences
    if base is not None:
        for check in (turned_bases, displaced_bases):
            for record, sentences in zip(findings, check(raw_trials, base), strict=True):
                record.faults += sentences
    faults = contradictions(chosen) or ([] if arm is None else against_arm(chosen, arm, base, unit))
    if arm is not None and (doubtful := doubtful_size(chosen, arm)):
        for record in findings:
            record.warnings.append(doubtful)
    faults += _order(raw_trials[0].markers, usual) + _loose(chosen, usual, settings, length)
    return faults if base is None else faults + _base_at_rest(chosen, base)


def _other_frames(findings: list[Findings]) -> list[list[str]]:
    """For each trial that its poses are in another frame than most of the session's, by its messages, in a sentence."""
    counts = Counter(record.frame_names for record in findings if record.frame_names)
    if len(counts) < 2:
        return [[] for _ in findings]
    usual = counts.most_common(1)[0][0]
    expected = f"expected {', '.join(map(repr, usual))} as in most trials: a session for each, with its own `frame.up`"
    return [
        [f"header.frame_id: found poses in the frame {', '.join(map(repr, record.frame_names))}, {expected}"]
        if record.frame_names and record.frame_names != usual else []
        for record in findings
    ]  # fmt: skip


def _bodies(raw: RawTrial) -> np.ndarray:
    """The base and the markers, (T, 1 + S, 3) m."""
    return np.insert(raw.positions, 0, raw.base_positions, axis=1)


def _misplaced(raw: RawTrial, usual: np.ndarray, names: tuple[str, ...], least: float) -> list[str]:
    """Bodies that are not where the session's other trials have them, by the distances from their neighbours."""
    distances = usual_distances([_bodies(raw)])
    ratio = float(np.nanmedian((distances / usual)[~np.eye(len(usual), dtype=bool)]))
    if not 1 / OTHER_UNIT < ratio < OTHER_UNIT:
        place = f"bodies are {ratio:.4g} times as far apart as in the session's trials of identify"
        return [f"unit: {place}, expected all logs of a session in one unit"]
    if len(names) == 2:  # one point alone comes as near to the base as the arm bends
        return []
    return list(misplaced(distances, usual, names, least).values())


def misplaced(distances: np.ndarray, usual: np.ndarray, names: Sequence[str], least: float) -> dict[int, str]:
    """Bodies, by index, most of whose `NEAREST` neighbors are at other distances than usual, with a sentence each.

    Args:
        distances: between the bodies, m, NaN where one is not seen. Shape (B, B).
        usual: likewise, as of `usual_distances`. Shape (B, B).
        names: of the bodies.
        least: m, by which the median of a body's distances has to differ.
    """
    faults = {}
    for body, name in enumerate(names):
        others = np.argsort(usual[body])[:NEAREST]
        others = others[np.isfinite((distances - usual)[body, others])]
        off = np.abs(distances - usual)[body, others]
        if len(off) and np.median(off) > least:
            near, worst = others[0], others[int(np.argmax(off))]
            place = f"{_mm(distances[body, worst])} from {names[worst]!r} for the usual {_mm(usual[body, worst])}"
            if near != worst:
                place += f", {_mm(distances[body, near])} from {names[near]!r} for {_mm(usual[body, near])}"
            expected = f"expected neighbours at distances that differ by less than {_mm(least)}"
            faults[body] = f"{name!r} is {place}, {expected}"
    return faults


def _motion(raw: RawTrial, length: float, still: float) -> list[str]:
    """Whether an experiment at rest rests, and another moves."""
    if is_stepwise(raw.experiment):
        return []
    static, blocks = EXPERIMENTS[raw.experiment].static, _blocks(raw.positions)
    travel = np.linalg.norm(np.ptp(blocks, axis=0), axis=1)
    most = int(np.argmax(travel))
    if static == (travel[most] <= still * length):
        return []
    share = 100 * travel[most] / length
    travelled = f"{raw.markers[most]!r} moves by {_mm(travel[most])}, {share:.2g} % of the arm's length"
    expected = f"expected {'at most' if static else 'more than'} {100 * still:g} % in a {raw.experiment}"
    others = ", ".join(name for name, kind in EXPERIMENTS.items() if kind.static != static)
    return [f"experiment: {travelled}, {expected}: is it another experiment ({others})?"]


def _order(markers: tuple[str, ...], usual: np.ndarray) -> list[str]:
    """Numbered markers that do not follow each other along the arm as their numbers do, up or down.

    From the base on, the next marker along an arm is the nearest of those that are left. Along any other order the
    way from body to body is longer.
    """
    numbered = [re.fullmatch(r"(.*?)(\d+)", name) for name in markers]
    parts = [match.groups() for match in numbered if match is not None]
    if len(parts) < len(markers) or len({stem for stem, _ in parts}) > 1 or len(parts) < 3:
        return []
    if not np.isfinite(usual).all(where=~np.eye(len(usual), dtype=bool)):
        return []
    left, along = set(range(1, len(usual))), [0]
    while left:
        along.append(min(left, key=lambda body: usual[along[-1], body]))
        left.remove(along[-1])
    named = sorted(range(len(markers)), key=lambda place: int(parts[place][1]))
    length = float(usual[0].max(where=np.isfinite(usual[0]), initial=0.0))
    orders = [[0, *(place + 1 for place in order)] for order in (named, named[::-1])]
    order = min(orders, key=lambda order: _way(usual, order))
    if _way(usual, order) - _way(usual, along) <= LONGER * length:
        return []
    places = [(markers[a - 1], markers[b - 1]) for a, b in zip(order[1:], along[1:], strict=True) if a != b]
    exchanged = ", ".join(f"{actual!r} where {name!r} is expected" for name, actual in places)
    problem = f"along the arm lies {exchanged}, by the distances between them"
    return [f"markers: {problem}: check `markers` in session.yaml"]


def _way(usual: np.ndarray, order: list[int]) -> float:
    return float(sum(usual[a, b] for a, b in pairwise(order)))


def _loose(raw_trials: list[RawTrial], usual: np.ndarray, settings: SanityLimits, length: float) -> list[str]:
    """Markers that are not fixed to the arm: in most trials in which it moves they keep no distance from any other
    marker, or rest while one nearer to the base moves."""
    least, still, count = settings.distance * length, settings.still * length, len(raw_trials[0].markers)
    apart, farther = [], usual[0, 1:, None] > usual[0, None, 1:]
    rests = []
    for raw in raw_trials:
        if EXPERIMENTS[raw.experiment].static or count < 3:
            continue
        blocks = _blocks(raw.positions)
        distances = np.linalg.norm(blocks[:, :, None] - blocks[:, None], axis=-1)
        spread = np.quantile(distances, 0.95, axis=0) - np.quantile(distances, 0.05, axis=0)
        apart.append(np.min(spread + np.where(np.eye(count), np.inf, 0.0), axis=1) > least)
        travel = np.linalg.norm(np.ptp(blocks, axis=0), axis=1)
        rests.append((travel < still) & (farther & (travel > least)).any(axis=1))
    faults = []
    for flags, motion in (
        (apart, f"keeps no distance from any other marker, to within {_mm(least)}, while the arm moves"),
        (rests, f"rests, to within {_mm(still)}, while markers nearer to the base move"),
    ):
        most = np.mean(flags, axis=0) > 0.5 if flags else np.zeros(count, bool)
        hit = [name for name, some in zip(raw_trials[0].markers, most, strict=True) if some]
        faults += [f"{name!r} {motion}: is it on the arm?" for name in hit]
    return faults


def _base_at_rest(raw_trials: list[RawTrial], base: str) -> list[str]:
    """A base that moves or turns while a marker rests."""
    motion = []
    for raw in raw_trials:
        if EXPERIMENTS[raw.experiment].static or raw.quaternions is None:
            continue
        turns = _turns(np.insert(raw.quaternions, 0, raw.base_quaternions, axis=1))
        motion.append([_spread(_blocks(_bodies(raw))), _spread(_blocks(turns))])
    if not motion:
        return []
    for moved, unit, scale in zip(np.median(motion, axis=0), ("mm", "°"), (1e3, np.degrees(1)), strict=True):
        rests = int(np.argmin(moved[1:])) + 1
        if moved[0] > CLEAR * moved[rests]:
            problem = f"moves by {scale * moved[0]:.2f} {unit} while {raw_trials[0].markers[rests - 1]!r} moves by"
            expected = "expected the body at the mount, which rests"
            return [f"base: {base!r} {problem} {scale * moved[rests]:.2f} {unit}, {expected}"]
    return []


def _turns(quaternions: np.ndarray) -> np.ndarray:
    """Rotation vectors (T, B, 3) rad from each body's mean orientation, NaN where not seen."""
    turns = np.full((*quaternions.shape[:2], 3), np.nan)
    for body in range(quaternions.shape[1]):
        visible = np.isfinite(quaternions[:, body, 0])
        rotations = rotation_from_wxyz(quaternions[visible, body])
        turns[visible, body] = (rotations.mean().inv() * rotations).as_rotvec()
    return turns


def _blocks(values: np.ndarray) -> np.ndarray:
    """Medians of stretches of `BLOCK` frames of (T, B, 3), gaps bridged: (T // BLOCK, B, 3)."""
    filled = fill_gaps(np.arange(len(values), dtype=float), values.reshape(len(values), -1)).reshape(values.shape)
    count = len(values) // BLOCK
    return np.median(filled[: count * BLOCK].reshape(count, BLOCK, *values.shape[1:]), axis=1)


def _spread(blocks: np.ndarray) -> np.ndarray:
    """Standard deviation (B,) of the places (n, B, 3)."""
    return np.sqrt(np.sum(np.var(blocks, axis=0), axis=1))


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.4g} mm"
