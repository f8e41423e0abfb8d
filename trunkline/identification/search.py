"""Two ways to the minimum: differential evolution (the paper's) and least squares, both a batch at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import differential_evolution, least_squares

from trunkline.identification.problem import Problem

DIFFERENCE = 1e-3  # step of a forward difference, in ln(value) or in a factor
Report = Callable[[float], None]  # called with the best loss after each generation or iteration


@dataclass
class Convergence:
    """Best loss so far and mean loss of each generation's trials; for least squares both are the iterate's."""

    best: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)


@dataclass
class Found:
    """Result of a search.

    vector: the best candidate z. converged: stopped for that reason, not because its time was up.
    linearisation: of least squares, residuals (R,) and Jacobians (R, P) per trial at the last iterate.
    """

    vector: np.ndarray
    convergence: Convergence
    converged: bool
    linearisation: tuple[list[np.ndarray], list[np.ndarray]] | None = None


def evolve(
    problem: Problem,
    low: np.ndarray,
    high: np.ndarray,
    start: np.ndarray | None,
    population: int,
    generations: int,
    tolerance: float,
    seed: int,
    report: Report,
) -> Found:
    """Differential evolution, best1bin, a whole generation per batch (scipy, deferred updating).

    Args:
        low, high: bounds (P,).
        start: a candidate to include in the first generation, or None.
        population: candidates per generation.
        tolerance: stop when the standard deviation of the losses falls below this share of their mean.
    """
    convergence, last = Convergence(), []

    def losses(columns: np.ndarray) -> np.ndarray:
        values = problem.losses(np.ascontiguousarray(columns.T))
        last[:] = [values]
        return values

    def note(intermediate_result) -> None:
        convergence.best.append(float(intermediate_result.fun))
        convergence.mean.append(float(last[0].mean()))
        report(convergence.best[-1])

    rng = np.random.default_rng(seed)
    first = _latin_hypercube(rng, population, low, high)
    if start is not None:
        first[0] = np.clip(start, low, high)
    result = differential_evolution(
        losses,
        list(zip(low, high, strict=True)),
        strategy="best1bin",
        init=first,
        maxiter=generations,
        tol=tolerance,
        mutation=(0.4, 0.9),
        recombination=0.9,
        rng=rng,
        polish=False,
        updating="deferred",
        vectorized=True,
        callback=note,
    )
    return Found(result.x, convergence, bool(result.success))


def polish(
    problem: Problem,
    low: np.ndarray,
    high: np.ndarray,
    start: np.ndarray,
    iterations: int,
    tolerance: float,
    report: Report,
) -> Found:
    """Least squares on the same residuals by scipy's trust region; all columns of a Jacobian in one batch."""
    convergence, last = Convergence(), None

    def residuals(vector: np.ndarray) -> np.ndarray:
        return np.concatenate([block[0] for block in problem.residuals(vector[None])])

    def derivatives(vector: np.ndarray) -> np.ndarray:
        nonlocal last
        blocks, columns = last = jacobian(problem, vector, high)
        loss = 0.5 * sum(float(block @ block) for block in blocks)
        convergence.best.append(loss)
        convergence.mean.append(loss)
        report(loss)
        return np.concatenate(columns)

    inside = np.clip(start, low + 1e-9, high - 1e-9)
    result = least_squares(
        residuals, inside, derivatives, bounds=(low, high), max_nfev=iterations, ftol=tolerance, xtol=1e-5
    )
    convergence.best.append(float(result.cost))
    convergence.mean.append(float(result.cost))
    return Found(result.x, convergence, result.status > 0, last)


def jacobian(
    problem: Problem, vector: np.ndarray, high: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Residuals (R,) and their derivatives (R, P) per trial, by differences towards the inside, in one batch."""
    steps = np.where(vector + DIFFERENCE > high, -DIFFERENCE, DIFFERENCE)
    candidates = np.concatenate([vector[None], vector + np.diag(steps)])
    blocks = problem.residuals(candidates)
    columns = [((block[1:] - block[0]) / steps[:, None]).T for block in blocks]
    return [block[0] for block in blocks], columns


def _latin_hypercube(rng: np.random.Generator, count: int, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """One candidate in each of `count` slices of every axis. Shape (count, P)."""
    slices = np.stack([rng.permutation(count) for _ in low], axis=1)
    return low + (slices + rng.random(slices.shape)) / count * (high - low)
