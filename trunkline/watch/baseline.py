"""What trials of an unchanged arm look like: the mean and the spread of each parameter's estimate, by kind.

No model is the arm, so the estimates of an unchanged arm are neither 0 nor alike: a kind of experiment has its own
offset, and one tilt another than the next. An estimate of information I scatters with variance s² / I around its mean
m. Both come from M reference trials: m is their mean, weighted by I, and s² = Σ I (d - m)² / ν, ν = M - 1. A new trial
is then off by (d - m) / (s √(1/I + 1/ΣI)), which has Student's distribution with ν degrees of freedom (the variance of
a prediction, (1 + 1/M) s² where all I are alike; Montgomery, Introduction to Statistical Quality Control, 2013).

Where two reference trials or more were done as the new one was (kind, level, load), m is theirs, and s is pooled within
such conditions; else both are those of the kind. Fewer than `LEAST` degrees of freedom chart nothing.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri, stdtr

from trunkline.watch.scores import Score

LEAST = 4  # degrees of freedom of a spread
TELLING = 0.05  # share of the usual information of a kind's trials, below which a trial does not tell a parameter


@dataclass(frozen=True)
class Group:
    """Reference trials of one parameter that are alike: `count` of them, of total information `weight`.

    mean: of their estimates. spread: s. degrees: of freedom of s. key: what they have in common, for all that shares
    the error of `mean`.
    """

    key: tuple
    count: int
    mean: float
    spread: float
    degrees: int
    weight: float

    def deviation(self, information: float) -> float:
        """Standard deviation of a new estimate's difference from `mean`."""
        return self.spread * float(np.sqrt(1 / information + 1 / self.weight))


@dataclass(frozen=True)
class Departure:
    """How far a trial's estimate of one parameter is from that of an unchanged arm.

    change: from the group's mean. deviation: that this has by chance. z: what is standard normal by chance.
    """

    change: float
    deviation: float
    z: float
    group: Group


@dataclass
class Baseline:
    """Of `reference` scores, all of the same P parameters."""

    reference: list[Score]
    _kinds: dict[tuple[str, int], tuple[float, Group | None, dict[tuple, Group]]] = field(default_factory=dict)

    def __post_init__(self):
        by_kind = defaultdict(list)
        for score in self.reference:
            by_kind[score.kind].append(score)
        for kind, own in by_kind.items():
            for p in range(len(own[0].slope)):
                self._kinds[kind, p] = _groups(kind, own, p)

    def departure(self, score: Score, p: int) -> Departure | None:
        """Of parameter `p`; None where the trial does not tell it, or too few reference trials do."""
        least, whole, alike = self._kinds.get((score.kind, p), (0.0, None, {}))
        group, information = alike.get(score.condition, whole), score.information[p]
        if group is None or information <= least:
            return None
        change, deviation = float(score.estimates[p] - group.mean), group.deviation(information)
        tail = ndtri(stdtr(group.degrees, -abs(change) / deviation))
        return Departure(change, deviation, float(-np.sign(change) * tail), group)

    def departures(self, score: Score) -> dict[int, Departure]:
        """By the number of the parameter, of those that the trial tells."""
        found = {p: self.departure(score, p) for p in range(len(score.slope))}
        return {p: one for p, one in found.items() if one is not None}

    def typical(self, p: int) -> list[tuple[Group, float]]:
        """For each reference trial that tells parameter `p`, the group by which one like it is judged, and by how much
        that one's estimate would be off by chance."""
        found = [(self.departure(score, p), score.information[p]) for score in self.reference]
        return [(one.group, one.group.deviation(float(info))) for one, info in found if one is not None]


def _groups(kind: str, own: list[Score], p: int) -> tuple[float, Group | None, dict[tuple, Group]]:
    """The least information that counts, the group of the whole kind, and those of its conditions."""
    least = TELLING * float(np.median([score.information[p] for score in own]))
    telling = [score for score in own if score.information[p] > least]
    if len(telling) <= LEAST:
        return least, None, {}
    by_condition = defaultdict(list)
    for score in telling:
        by_condition[score.condition].append(score)
    whole = _group((kind,), telling, p, *_scatter([telling], p))
    repeated = {condition: alike for condition, alike in by_condition.items() if len(alike) > 1}
    squares, degrees = _scatter(list(repeated.values()), p)
    if degrees < LEAST:
        return least, whole, {}
    return least, whole, {c: _group(c, alike, p, squares, degrees) for c, alike in repeated.items()}


def _scatter(sets: list[list[Score]], p: int) -> tuple[float, int]:
    """Σ I (d - m)² within sets, and its degrees of freedom."""
    squares = 0.0
    for scores in sets:
        weights, values = _columns(scores, p)
        squares += float(weights @ (values - np.average(values, weights=weights)) ** 2)
    return squares, sum(len(scores) - 1 for scores in sets)


def _group(key: tuple, scores: list[Score], p: int, squares: float, degrees: int) -> Group:
    weights, values = _columns(scores, p)
    mean = float(np.average(values, weights=weights))
    return Group(key, len(scores), mean, float(np.sqrt(squares / degrees)), degrees, float(weights.sum()))


def _columns(scores: list[Score], p: int) -> tuple[np.ndarray, np.ndarray]:
    """Information and estimates. Each (M,)."""
    return np.array([score.information[p] for score in scores]), np.array([score.estimates[p] for score in scores])
