"""Reference trials that are unlike the others of their kind, such as one in which somebody touched the arm.

A single outlier widens the spread, and hides a change for good. They are found by the generalised extreme studentised
deviate (Rosner, Technometrics 25, 1983), here from a curve: of n values the furthest from a fit to them, in standard
deviations, is taken out, then the furthest of those that are left, and so on; outliers are all up to the last of them
that is further than it would be by chance. Taken one after the other, two that hide each other are found.
"""

import numpy as np
from scipy.stats import t as student

CHANCE = 1e-5  # that any of n normal trials is called an outlier; the longer tails of real ones are not to be cut off
RANK = 1e-9  # of the largest singular value, below which a column is one of the others
MOST = 0.25  # share of n that may be


def find_outliers(values: np.ndarray, information: np.ndarray, design: np.ndarray, least: int) -> np.ndarray:
    """Which of the estimates `values` (n,), of variance s² / `information` (n,) around what is linear in the columns of
    `design` (n, k), are outliers; shape (n,), bool. The others keep so many degrees of freedom, at `least`."""
    count, root = len(values), np.sqrt(information)
    left, furthest, last = np.ones(count, dtype=bool), [], 0
    for taken in range(int(MOST * count)):
        basis, sizes, _ = np.linalg.svd((root * left)[:, None] * design, full_matrices=False)
        basis = basis[:, sizes > RANK * sizes[0]]
        terms = basis.shape[1]
        if count - taken - terms <= least:
            break
        off = root * left * values
        off = off - basis @ (basis.T @ off)
        free = np.clip(1 - np.square(basis).sum(axis=1), 1e-9, None)
        deviates = np.abs(off) / np.sqrt(free * max((off**2).sum(), 1e-300) / (count - taken - terms))
        worst = int(deviates.argmax())
        furthest.append(worst)
        left[worst] = False
        if deviates[worst] > _most(count - taken, terms):
            last = taken + 1
    return np.isin(np.arange(count), furthest[:last])


def _most(count: int, terms: int) -> float:
    """How far the furthest of so many normal values is from a fit of so many `terms` by chance, in its own standard
    deviations."""
    degrees = count - terms - 1
    quantile = float(student.ppf(1 - CHANCE / (2 * count), degrees))
    return quantile * np.sqrt((degrees + 1) / (degrees + quantile**2))
