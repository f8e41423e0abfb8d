"""What trials of an unchanged arm look like: the mean and the spread of each parameter's estimate, by kind.

No model is the arm, so the estimates of an unchanged arm are neither 0 nor alike: a kind of experiment has its own
offset, and it changes with the level, smoothly. An estimate of information I scatters with variance s² / I around its
mean m = xᵀβ, x the powers of the level. Both come from M reference trials: β by least squares, weighted by I, with up
to three powers, each further one where an F test has it needed (`CHANCE`), and s² = Σ I (d - m)² / ν, ν = M less the
powers. A new trial is then off by (d - m) / (s √(1/I + xᵀCx)), with s² C the
covariance of β, which has Student's distribution with ν degrees of freedom (the variance of a prediction).

Reference trials that are unlike the others of their kind (`outliers.py`) are left out. Where two or more were done
as the new one was (kind, level, load), m is their mean, and s is pooled within such conditions. Fewer than `LEAST`
degrees of freedom chart nothing.
"""

from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from scipy.special import fdtrc, ndtri, stdtr

from trunkline.tools.monitor.outliers import find_outliers
from trunkline.tools.monitor.scores import Score

LEAST = 4  # degrees of freedom of a spread
TELLING = 0.05  # share of the usual information of a kind's trials, below which a trial does not tell a parameter
POWERS = 3  # of a level, at most: 1, x, x²
CHANCE = 1e-3  # that a further power is taken where none is needed


@dataclass(frozen=True, eq=False)
class Group:
    """Reference trials of one parameter that are alike.

    mean: β, (k,). error: s √C, lower triangular, (k, k). middle, width: by which levels are scaled. spread: s.
    degrees: of freedom of s. key: what they have in common, for all that shares the error of `mean`.
    """

    key: tuple
    mean: np.ndarray
    error: np.ndarray
    middle: float
    width: float
    spread: float
    degrees: int

    def at(self, level: float | None) -> float:
        """m."""
        return float(self._powers(level) @ self.mean)

    def shared(self, level: float | None) -> np.ndarray:
        """By how much m is off there for each of POWERS independent standard normal errors, (POWERS,)."""
        factors = self.error.T @ self._powers(level)
        return np.pad(factors, (0, POWERS - len(factors)))

    def deviation(self, score: Score, p: int) -> float:
        """Standard deviation of a new estimate's difference from m."""
        error = self.shared(score.level)
        return float(np.sqrt(self.spread**2 / score.information[p] + error @ error))

    def _powers(self, level: float | None) -> np.ndarray:
        count = len(self.mean)
        return _powers(np.array([level]), self.middle, self.width, count)[0] if count > 1 else np.ones(1)


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
    """Of `reference` scores, all of the same P parameters.

    outliers: numbers of those that were left out as unlike the others, with the numbers of those parameters.
    """

    reference: list[Score]
    outliers: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    _kinds: dict[tuple[str, int], tuple[float, Group | None, dict[tuple, Group]]] = field(default_factory=dict)

    def __post_init__(self):
        by_kind = defaultdict(list)
        place = {id(score): number for number, score in enumerate(self.reference)}
        for score in self.reference:
            by_kind[score.kind].append(score)
        for kind, scores in by_kind.items():
            for p in range(len(scores[0].slope)):
                least, telling, left_out = _telling(scores, p)
                self._kinds[kind, p] = _groups(kind, telling, p, least)
                for score in left_out:
                    self.outliers[place[id(score)]].append(p)

    def departure(self, score: Score, p: int) -> Departure | None:
        """Of parameter `p`; None where the trial does not tell it, or too few reference trials do."""
        least, whole, alike = self._kinds.get((score.kind, p), (0.0, None, {}))
        group, information = alike.get(score.condition, whole), score.information[p]
        if group is None or information <= least or (score.level is None and len(group.mean) > 1):
            return None
        change, deviation = float(score.estimates[p] - group.at(score.level)), group.deviation(score, p)
        tail = ndtri(stdtr(group.degrees, -abs(change) / deviation))
        return Departure(change, deviation, float(-np.sign(change) * tail), group)

    def departures(self, score: Score) -> dict[int, Departure]:
        """By the number of the parameter, of those that the trial tells."""
        departures = {p: self.departure(score, p) for p in range(len(score.slope))}
        return {p: departure for p, departure in departures.items() if departure is not None}

    def typical(self, p: int) -> list[tuple[Departure, Score]]:
        """Of each reference trial that tells parameter `p`: how one like it is judged."""
        regular = [score for number, score in enumerate(self.reference) if p not in self.outliers.get(number, ())]
        pairs = [(self.departure(score, p), score) for score in regular]
        return [(departure, score) for departure, score in pairs if departure is not None]


def _telling(scores: list[Score], p: int) -> tuple[float, list[Score], list[Score]]:
    """Of one kind's trials: the least information that counts, those that tell parameter `p`, and, out of these, those
    that are unlike the others."""
    least = TELLING * float(np.median([score.information[p] for score in scores]))
    telling = [score for score in scores if score.information[p] > least]
    if len(telling) <= LEAST:
        return least, telling, []
    left_out = []
    for load in sorted({score.load for score in telling}):
        alike = [score for score in telling if score.load == load]
        weights, values = _columns(alike, p)
        design = np.concatenate([_designs(alike)[-1], _repeated(alike)], axis=1)
        outliers = find_outliers(values, weights, design, LEAST)
        left_out += [score for score, is_outlier in zip(alike, outliers, strict=True) if is_outlier]
    return least, [score for score in telling if score not in left_out], left_out


def _repeated(scores: list[Score]) -> np.ndarray:
    """A column for each condition that there is twice or more: such trials are compared with each other. (n, c)."""
    counts = Counter(score.condition for score in scores)
    conditions = [condition for condition, count in counts.items() if count > 1]
    return np.array([[float(score.condition == condition) for condition in conditions] for score in scores])


def _groups(kind: str, telling: list[Score], p: int, least: float) -> tuple[float, Group | None, dict[tuple, Group]]:
    """The least information that counts, the group of the whole kind, and those of its conditions."""
    if len(telling) <= LEAST:
        return least, None, {}
    whole = _curve((kind,), telling, p)
    by_condition = defaultdict(list)
    for score in telling:
        by_condition[score.condition].append(score)
    repeated = {condition: alike for condition, alike in by_condition.items() if len(alike) > 1}
    degrees = sum(len(alike) - 1 for alike in repeated.values())
    if degrees < LEAST:
        return least, whole, {}
    fits = {condition: _fit(alike, p, np.ones((len(alike), 1))) for condition, alike in repeated.items()}
    spread = float(np.sqrt(sum(squares for _, _, squares in fits.values()) / degrees))
    alike = {key: Group(key, mean, spread * root, 0.0, 1.0, spread, degrees) for key, (mean, root, _) in fits.items()}
    return least, whole, alike


def _curve(key: tuple, scores: list[Score], p: int) -> Group:
    """The group whose mean is a curve over the level."""
    first, *further = _designs(scores)
    (mean, root, squares), degrees = _fit(scores, p, first), len(scores) - 1
    for design in further:
        bent, free = _fit(scores, p, design), len(scores) - design.shape[1]
        ratio = max(squares - bent[2], 0.0) / (degrees - free) / max(bent[2] / free, 1e-300)
        if fdtrc(degrees - free, free, ratio) < CHANCE:  # two at once, where one alone is not: a bow has no slope
            (mean, root, squares), degrees = bent, free
    spread = float(np.sqrt(squares / degrees))
    return Group(key, mean, spread * root, *_scale(scores), spread, degrees)


def _designs(scores: list[Score]) -> list[np.ndarray]:
    """Powers of the scores' levels, of one more after the other, as far as levels and degrees of freedom go."""
    levels = [score.level for score in scores]
    distinct = len(set(levels)) if None not in levels else 1
    most = max(min(POWERS, distinct - 1, len(scores) - LEAST), 1)
    return [_powers(np.array(levels, dtype=float), *_scale(scores), count) for count in range(1, most + 1)]


def _scale(scores: list[Score]) -> tuple[float, float]:
    """Middle and width of the levels."""
    levels = np.array([score.level for score in scores], dtype=float)
    return (float(levels.mean()), float(levels.std()) or 1.0) if np.isfinite(levels).all() else (0.0, 1.0)


def _powers(levels: np.ndarray, middle: float, width: float, count: int) -> np.ndarray:
    """Shape (n, count)."""
    scaled = (levels.astype(float) - middle) / width
    return np.stack([np.ones_like(scaled), *(scaled**power for power in range(1, count))], axis=1)


def _fit(scores: list[Score], p: int, design: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """β (k,), √C (k, k), and Σ I (d - m)²."""
    weights, values = _columns(scores, p)
    root = np.sqrt(weights)
    normal = np.linalg.inv(design.T @ (weights[:, None] * design))
    mean = normal @ (design.T @ (weights * values))
    return mean, np.linalg.cholesky(normal), float(np.square(root * (values - design @ mean)).sum())


def _columns(scores: list[Score], p: int) -> tuple[np.ndarray, np.ndarray]:
    """Information and estimates. Each (M,)."""
    return np.array([score.information[p] for score in scores]), np.array([score.estimates[p] for score in scores])
