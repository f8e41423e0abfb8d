"""The control chart: an exponentially weighted mean of each trial's estimate of a parameter, and its alarm limit.

EWMA of standardised values (Roberts 1959; Lucas, Saccucci, Technometrics 32, 1990), A ← (1 - λ) A + λ w z. A trial
that determines the parameter less well than the best kind of reference trials weighs less, w = the best deviation over
its own, so that pulls do not drown an informative release. The chart shows Q = A / √Var(A),
Var ← (1 - λ)² Var + λ² w². It begins as after a long run of unchanged trials.

A single outlier, such as a trial in which somebody touched the arm, moves Q by `ALONE` of the limit at most (as the
robust CUSUM of Lucas, Crosier 1982 limits one value): two of them, one after the other, raise the alarm.

The limit is not typed. In simulated charts of an unchanged arm, with as many reference trials, drawn anew each time, it
gives one false alarm in `1 / rate` trials over all parameters (each has the same share). What few reference trials
leave open, their own mean and spread, so widens it (Jones, Champ, Rigdon, Technometrics 43, 2001).
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri, stdtr

from trunkline.tools.monitor.baseline import POWERS, Baseline, Departure
from trunkline.tools.monitor.scores import Score

FORGETTING = 0.25  # λ: Montgomery (2013, section 9.2) advises 0.05 to 0.25; the largest sees a few per cent soonest
ALONE = 0.75  # of the limit, that one trial may move the chart
NEAR = 1.0  # a chart's standard deviation; a change begins where the chart was last within (after Nishina 1992: at 0)
FALSE_ALARMS = 1 / 5000  # a trial, for all parameters together, of normal estimates: real ones have longer tails
RUNS, LENGTH, SEED = 2000, 200, 1  # of the simulation
WIDEST = 12.0  # a limit; with more, a chart says nothing
LONG_RUN = FORGETTING / (2 - FORGETTING)  # Var(A) after a long run of trials with w = 1


@dataclass
class ParameterChart:
    """The chart of one parameter. best: the deviation of those reference trials that tell it best. beyond: whether
    the last trial took it beyond the limit."""

    limit: float
    best: float
    mean: float = 0.0
    variance: float = LONG_RUN

    @property
    def level(self) -> float:
        return self.mean / float(np.sqrt(self.variance))

    @property
    def beyond(self) -> bool:
        return abs(self.level) > self.limit

    def add(self, departure: Departure) -> None:
        """One trial more."""
        weight = min(1.0, self.best / departure.deviation)
        mean, variance = _advance(self.mean, self.variance, departure.z, weight, self.limit)
        self.mean, self.variance = float(mean), float(variance)


@dataclass(frozen=True, eq=False)
class Charted:
    """A trial on the chart. departures, levels: by the number of the parameter. alarms: of those beyond the limit."""

    score: Score
    departures: dict[int, Departure]
    levels: dict[int, float]
    alarms: list[int]


@dataclass
class Chart:
    """Charts of all parameters that the reference tells. restart: whether they begin anew after an alarm."""

    baseline: Baseline
    lines: dict[int, ParameterChart]
    restart: bool = False
    trials: list[Charted] = field(default_factory=list)

    def add(self, score: Score) -> Charted:
        departures = {p: departure for p, departure in self.baseline.departures(score).items() if p in self.lines}
        for p, departure in departures.items():
            self.lines[p].add(departure)
        alarms = [p for p in departures if self.lines[p].beyond]
        charted = Charted(score, departures, {p: self.lines[p].level for p in departures}, alarms)
        self.trials.append(charted)
        if alarms and self.restart:
            self.lines = {p: ParameterChart(line.limit, line.best) for p, line in self.lines.items()}
        return charted

    def changed(self) -> int | None:
        """The number of the first trial with an alarm."""
        return next((i for i, trial in enumerate(self.trials) if trial.alarms), None)

    def suspects(self) -> list[Charted]:
        """The trials up to the first alarm since the chart that is furthest beyond was last near its middle."""
        at = self.changed()
        if at is None:
            return []
        levels, begun = self.trials[at].levels, at
        worst = max(self.trials[at].alarms, key=lambda p: abs(levels[p]) / self.lines[p].limit)
        while begun and np.sign(levels[worst]) * self.trials[begun - 1].levels.get(worst, levels[worst]) > NEAR:
            begun -= 1
        return self.trials[begun : at + 1]


def chart_of(baseline: Baseline, parameters: int, rate: float = FALSE_ALARMS, restart: bool = False) -> Chart:
    """Empty charts of those of P `parameters` that the reference tells. rate: of false alarms, a trial."""
    typical = {p: pairs for p in range(parameters) if (pairs := baseline.typical(p))}
    lines = {}
    for p, pairs in typical.items():
        best = min(departure.deviation for departure, _ in pairs)
        lines[p] = ParameterChart(limit_of(baseline, p, rate / len(typical)), best)
    return Chart(baseline, lines, restart)


def limit_of(baseline: Baseline, p: int, rate: float) -> float:
    """The limit of |Q| that trials of an unchanged arm, of the reference's mixture, pass at this rate."""
    rng, typical = np.random.default_rng([SEED, p]), baseline.typical(p)
    deviations = np.array([departure.deviation for departure, _ in typical])
    weights = deviations.min() / deviations
    groups = list({departure.group.key: departure.group for departure, _ in typical}.values())
    place = {group.key: i for i, group in enumerate(groups)}
    of = np.array([place[departure.group.key] for departure, _ in typical])
    degrees = np.array([group.degrees for group in groups])
    # what a reference of these sizes gets wrong, in each run: the mean, and the spread over the true one
    shared = np.array([departure.group.shared(score.level) / departure.deviation for departure, score in typical])
    # the spread is pooled over the conditions of a kind, so its error is theirs together
    pools = {(key[0], len(key) > 1): i for i, key in enumerate(place)}
    pooled = np.array([pools[key[0], len(key) > 1] for key in place])
    means, spreads = rng.normal(size=(RUNS, len(groups), POWERS)), rng.chisquare(degrees, (RUNS, len(groups))) / degrees
    spreads = np.sqrt(spreads[:, pooled])
    drawn = rng.integers(len(typical), size=(LENGTH, RUNS))
    row = np.arange(RUNS)
    noise = rng.normal(size=(LENGTH, RUNS)) * np.sqrt(1 - np.square(shared).sum(axis=1))[drawn]
    x = (noise - np.einsum("trp,trp->tr", shared[drawn], means[row, of[drawn]])) / spreads[row, of[drawn]]
    z = -np.sign(x) * ndtri(stdtr(degrees[of[drawn]], -np.abs(x)))
    low, high = 1.0, WIDEST
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _alarms(z, weights[drawn], middle) > rate else (low, middle)
    return high


def _alarms(z: np.ndarray, weights: np.ndarray, limit: float) -> float:
    """A trial, of charts that begin anew after each. z, weights: (trials, runs)."""
    mean, variance, count = np.zeros(z.shape[1]), np.full(z.shape[1], LONG_RUN), 0
    for values, weight in zip(z, weights, strict=True):
        mean, variance = _advance(mean, variance, values, weight, limit)
        beyond = np.abs(mean) > limit * np.sqrt(variance)
        count += int(beyond.sum())
        mean, variance = np.where(beyond, 0.0, mean), np.where(beyond, LONG_RUN, variance)
    return count / z.size


def _advance(mean, variance, z, weight, limit):
    """A and Var(A) after a trial."""
    variance = (1 - FORGETTING) ** 2 * variance + (FORGETTING * weight) ** 2
    most = ALONE * limit * np.sqrt(variance)
    return (1 - FORGETTING) * mean + np.clip(FORGETTING * weight * z, -most, most), variance
