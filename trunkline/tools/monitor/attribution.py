"""Attribute an alarm to the change of one parameter: which explains it best, by how much, and which cannot be excluded.

A change Δ of parameter p alone moves the estimate d_q of every parameter q by (JᵀJ)_qp / (JᵀJ)_qq Δ: what is charted
for one parameter shows on the charts of those that move the arm alike. So Δ is fitted to all estimates of all trials
at once by generalised least squares, and the parameter is the one that takes most from χ². The covariance is of chance
(each trial's, correlated between parameters as the reference trials of its kind are) and of the reference's own means,
which trials of one group share. Correlations of few reference trials are shrunk towards 0 (Schäfer, Strimmer 2005).
Where more is left than chance leaves, the interval of Δ is widened by the ratio (Birge 1932).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, stdtrit

from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.control_chart import Charted

APART = 3.84  # of χ², the 95th percentile for one degree of freedom: less does not separate two parameters
CHANCE = 1e-3  # of more than what is left, below which one parameter does not explain it all


@dataclass(frozen=True)
class Change:
    """Of parameter `parameter` (its number) by `size`, where it is searched, ± `half_width` (95 %).

    gain: by how much it lowers χ².
    """

    parameter: int
    size: float
    half_width: float
    gain: float


@dataclass(frozen=True)
class Attribution:
    """best: the change that explains most. alike: others that the trials cannot separate from it, best first.

    whole: whether what is left is chance.
    """

    best: Change
    alike: list[Change]
    whole: bool


def attribute_change(trials: list[Charted], baseline: Baseline, parameters: list[int]) -> Attribution:
    """The change of one of `parameters` that explains `trials` best."""
    kinds = {trial.score.kind for trial in trials if trial.departures}
    correlation = {kind: _correlation(kind, baseline) for kind in kinds}
    rows = [(i, p) for i, trial in enumerate(trials) for p in sorted(trial.departures)]
    off = np.array([trials[i].departures[p].change for i, p in rows])
    covariance = np.zeros((len(rows), len(rows)))
    for a, (i, p) in enumerate(rows):
        for b, (j, q) in enumerate(rows):
            if trials[i].score.kind == trials[j].score.kind:
                covariance[a, b] = correlation[trials[i].score.kind][p, q] * _shared(trials[i], p, trials[j], q, i == j)
    inverse = np.linalg.pinv(covariance, hermitian=True)
    degrees = min(trial.departures[p].group.degrees for trial in trials for p in trial.departures)
    changes = []
    for p in parameters:
        response = np.array([_response(trials[i], q, p) for i, q in rows])
        information = float(response @ inverse @ response)
        if information > 0:
            size = float(response @ inverse @ off) / information
            half = float(stdtrit(degrees, 0.975)) / np.sqrt(information)
            changes.append(Change(p, size, half, size**2 * information))
    changes.sort(key=lambda change: -change.gain)
    left, free = float(off @ inverse @ off) - changes[0].gain, max(len(rows) - 1, 1)
    wider = np.sqrt(max(left / free, 1.0))
    best, *others = (replace(change, half_width=float(wider * change.half_width)) for change in changes)
    alike = [change for change in others if best.gain - change.gain < APART * wider**2]
    return Attribution(best, alike, left <= float(chdtri(free, CHANCE)))


def _shared(trial: Charted, p: int, other: Charted, q: int, same: bool) -> float:
    """Covariance of two estimates if parameters were wholly correlated: of the same trial, and of the same group."""
    first, second = trial.departures[p].group, other.departures[q].group
    covariance = 0.0
    if same:
        covariance += first.spread * second.spread / np.sqrt(trial.score.information[p] * other.score.information[q])
    if first.key == second.key:
        covariance += first.shared(trial.score.level) @ second.shared(other.score.level)
    return float(covariance)


def _response(trial: Charted, q: int, p: int) -> float:
    """By how much the estimate of q moves for a change of p."""
    return float(trial.score.curvature[q, p] / trial.score.curvature[q, q])


def _correlation(kind: str, baseline: Baseline) -> np.ndarray:
    """Of the estimates of an unchanged arm's trials of a kind, shrunk towards none. Shape (P, P)."""
    numbered = enumerate(baseline.reference)
    scores = [score for number, score in numbered if score.kind == kind and number not in baseline.outliers]
    count = len(baseline.reference[0].slope)
    values = np.full((len(scores), count), np.nan)
    for i, score in enumerate(scores):
        for p, departure in baseline.departures(score).items():
            values[i, p] = departure.change / departure.deviation
    result = np.eye(count)
    estimated = np.flatnonzero(np.isfinite(values).sum(axis=0) > 3)
    complete = values[:, estimated][np.isfinite(values[:, estimated]).all(axis=1)]
    if len(estimated) < 2 or len(complete) < 4:
        return result
    number = len(complete)
    scaled = (complete - complete.mean(axis=0)) / np.maximum(complete.std(axis=0, ddof=1), 1e-300)
    products = np.einsum("np,nq->npq", scaled, scaled)
    middle = products.mean(axis=0)
    correlation = number / (number - 1) * middle
    scatter = number / (number - 1) ** 3 * np.square(products - middle).sum(axis=0)
    apart = ~np.eye(len(estimated), dtype=bool)
    shrunk = np.clip(scatter[apart].sum() / max(np.square(correlation[apart]).sum(), 1e-300), 0, 1)
    result[np.ix_(estimated, estimated)] = np.where(apart, (1 - shrunk) * correlation, 1.0)
    return result
