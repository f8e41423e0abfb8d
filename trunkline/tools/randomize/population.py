"""Parameters of an arm that is not among those that were identified, as a distribution to draw from."""

from dataclasses import replace

import numpy as np

from trunkline.errors import InputError
from trunkline.twin.posterior import Posterior


def of_population(arms: list[Posterior]) -> Posterior:
    """Of an arm that is not among these n: about their mean, by what differs between them besides what is uncertain.

    z = b + e: b between arms, independent from parameter to parameter, as a few arms tell no correlations; e within
    an arm, with the mean of their scale matrices and, as is pooled, the sum of their degrees of freedom. The variance
    between arms is that of the estimates less the mean of those within, where it is more (the moment estimator of
    one-way random effects). The mean of a few arms is uncertain itself, so both are taken 1 + 1/n times.

    Raises:
        InputError: they do not have the same parameters.
    """
    first, count = arms[0], len(arms)
    for number, arm in enumerate(arms):
        if odd := sorted(set(first.names) ^ set(arm.names)):
            mismatch = f"found in one of arms 1 and {number + 1} alone, expected the same parameters"
            raise InputError(f"{', '.join(odd)}: {mismatch}")
    orders = [[arm.names.index(name) for name in first.names] for arm in arms]
    ordered = list(zip(arms, orders, strict=True))
    within = np.mean([arm.covariance[np.ix_(order, order)] for arm, order in ordered], axis=0)
    estimates = np.array([arm.estimate[order] for arm, order in ordered])
    between = np.maximum(estimates.var(axis=0, ddof=1) - np.diag(within), 0)
    covariance = (within + np.diag(between)) * (1 + 1 / count)
    deviation = np.sqrt(np.diag(covariance))
    return replace(
        first,
        estimate=estimates.mean(axis=0),
        deviation=deviation,
        degrees=np.sum([arm.degrees[order] for arm, order in ordered], axis=0),
        correlation=covariance / np.outer(deviation, deviation),
        low=np.min([arm.low[order] for arm, order in ordered], axis=0),
        high=np.max([arm.high[order] for arm, order in ordered], axis=0),
    )
