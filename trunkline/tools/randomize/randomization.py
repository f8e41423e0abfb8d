"""Parameters of an arm as a distribution to draw from: of one arm, or of a population of arms."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.twin.posterior import Posterior

TRIES = 100  # rounds of draws in which all must fall within the limits
MOST = 95  # of 100, within `interval`


@dataclass(frozen=True)
class Randomization:
    """P parameters. Of those that are never 0 or less, lognormal, x = ln(value / centre); of the others, normal,
    x = value - centre.

    Attributes:
        names, groups: of each. Those of one group are drawn together, others independently of each other: of one arm,
            a group is a stage of identification.
        centre: medians, in the parameters' units. Shape (P,).
        covariance: of x before limits cut it, 0 between groups. Shape (P, P).
        low, high: limits that no draw is beyond, the range that was searched, in the parameters' units. Each (P,).
        arms: how many it comes from.
    """

    names: list[str]
    groups: list[str]
    centre: np.ndarray
    covariance: np.ndarray
    low: np.ndarray
    high: np.ndarray
    arms: int = 1

    @property
    def normal(self) -> np.ndarray:
        """Which are. Shape (P,)."""
        return np.array([parameter_named(name).signed for name in self.names])

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviation of x. Shape (P,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def interval(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends of what holds 95 of 100 draws of each, in their units. Each (P,)."""
        half = float(norm.ppf(0.5 + MOST / 200)) * self.deviation
        return np.maximum(self.at(-half), self.low), np.minimum(self.at(half), self.high)

    def at(self, x: np.ndarray) -> np.ndarray:
        """Values, in the parameters' units; the very centre where x is 0. From (..., P) to (..., P)."""
        factors = np.exp(np.where(self.normal, 0.0, x))
        return np.where(self.normal, self.centre + x, self.centre * factors)

    def values(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """By name, in the parameters' units, from x of shape (n, P)."""
        return dict(zip(self.names, self.at(x).T, strict=True))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """x of `count` arms. What is beyond a limit is drawn again. Shape (count, P).

        Raises:
            InputError: hardly any draw is within the limits.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0))
        accepted = np.empty((0, len(self.names)))
        inside = np.zeros(len(self.names))
        for _ in range(TRIES):
            x = rng.standard_normal((count, len(self.names))) @ root.T
            within = (self.at(x) >= self.low) & (self.at(x) <= self.high)
            inside += within.sum(axis=0)
            accepted = np.concatenate([accepted, x[within.all(axis=1)]])
            if len(accepted) >= count:
                return accepted[:count]
        out = self.names[int(np.argmin(inside))]
        raise InputError(f"{out}: found {len(accepted)} of {count * TRIES} draws within its range, expected {count}")

    def widened(self, factor: float) -> "Randomization":
        """All standard deviations times `factor`; the limits stay."""
        return replace(self, covariance=self.covariance * factor**2)


def of_arm(estimates: Posterior) -> Randomization:
    """Of one arm: the estimates with their standard uncertainties, and correlations within a stage."""
    parameters = [parameter_named(name) for name in estimates.names]
    scales = np.array([parameter.scale if parameter.signed else 1.0 for parameter in parameters])
    deviation = estimates.deviation * scales
    centre, low, high = (
        np.array([float(parameter.value(z)) for parameter, z in zip(parameters, row, strict=True)])
        for row in (estimates.estimate, estimates.low, estimates.high)
    )
    covariance = estimates.correlation * np.outer(deviation, deviation)
    return Randomization(estimates.names, estimates.stages, centre, covariance, low, high)


def of_population(arms: list[Randomization]) -> Randomization:
    """Of an arm that is not among these n: about their mean, by what differs between them besides what is uncertain.

    x = b + e: b between arms, independent from parameter to parameter, as a few arms tell no correlations; e within
    an arm, with the mean of their covariances. The variance between arms is that of the estimates less the mean of
    those within, where it is more (the moment estimator of one-way random effects). The mean of a few arms is uncertain
    itself, so both are taken 1 + 1/n times.

    Raises:
        InputError: they do not have the same parameters.
    """
    first, count = arms[0], len(arms)
    for number, arm in enumerate(arms):
        if odd := sorted(set(first.names) ^ set(arm.names)):
            mismatch = f"found in one of arms 1 and {number + 1} alone, expected the same parameters"
            raise InputError(f"{', '.join(odd)}: {mismatch}")
    order = [[arm.names.index(name) for name in first.names] for arm in arms]
    within = np.mean([arm.covariance[np.ix_(o, o)] for arm, o in zip(arms, order, strict=True)], axis=0)
    centres, low, high = (
        np.array([values[o] for values, o in zip(of_all, order, strict=True)])
        for of_all in ([a.centre for a in arms], [a.low for a in arms], [a.high for a in arms])
    )
    axis = np.where(first.normal, centres, np.log(np.where(first.normal, 1.0, centres)))
    middle = axis.mean(axis=0)
    between = np.maximum(axis.var(axis=0, ddof=1) - np.diag(within), 0)
    return Randomization(
        first.names, first.groups, np.where(first.normal, middle, np.exp(np.where(first.normal, 0.0, middle))),
        (within + np.diag(between)) * (1 + 1 / count), low.min(axis=0), high.max(axis=0), count,
    )  # fmt: skip
