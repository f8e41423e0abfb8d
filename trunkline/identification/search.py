"""Two ways to the minimum: differential evolution (the paper's) and least squares, both a batch at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt
from scipy.optimize import differential_evolution, least_squares
from scipy.stats import qmc

from trunkline.identification.problem import Problem

DIFFERENCE = 1e-3  # step of a one-sided difference: in ln(value), in a factor, or in a signed value
PLATEAU_SCAN = 24  # values over the range of a parameter that does not matter, and
PLATEAU_STARTS = 3  # from how many of the nearest that do matter to search again
PLATEAU_ITERATIONS, PLATEAU_TOLERANCE = 6, 1e-3  # of each
PLATEAU_LEVEL = 1e-6  # relative change of the loss that matters
STEP_TOLERANCE = 1e-5  # of a candidate z, relative: a smaller step of least squares is no step
Report = Callable[[float], None]  # called with the best loss after each generation or iteration


@dataclass
class LeastSquares:
    """Descents from the best of a few starts, by scipy's trust region (Branch, Coleman, Li 1999).

    starts: of a Latin hypercube, besides the given one. descents: from how many of the best. iterations: of each, at
    most. tolerance: relative decrease of the loss at the end.
    """

    starts: NonNegativeInt
    descents: PositiveInt
    iterations: PositiveInt
    tolerance: PositiveFloat
    method: Literal["least_squares"] = "least_squares"

    def steps(self) -> int:
        return self.descents * self.iterations


@dataclass
class DifferentialEvolution:
    """best1bin, a whole generation per batch (Storn, Price 1997; scipy, deferred updating).

    population, population_per_parameter: candidates a generation, P parameters: the first plus P times the second.
    generations: at most. tolerance: standard deviation of the losses over their mean at the end.
    """

    population: Annotated[int, Field(ge=5)]
    population_per_parameter: NonNegativeInt
    generations: PositiveInt
    tolerance: PositiveFloat
    method: Literal["differential_evolution"] = "differential_evolution"

    def steps(self) -> int:
        return self.generations


Optimizer = Annotated[LeastSquares | DifferentialEvolution, Field(discriminator="method")]


@dataclass
class Convergence:
    """Best loss so far and mean loss of each generation's trials; for least squares both are the iterate's."""

    best: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)


@dataclass
class Linearisation:
    """Residuals (R,) and their derivatives (R, P) per trial, around a vector, and the weights (P,) of a prior."""

    vector: np.ndarray
    residuals: list[np.ndarray]
    jacobians: list[np.ndarray]
    prior: np.ndarray | None = None

    def normals(self) -> np.ndarray:
        """JᵀJ of every trial. Shape (T, P, P)."""
        return np.stack([j.T @ j for j in self.jacobians])

    def moves(self, weights: np.ndarray) -> np.ndarray:
        """By how much the minimum moves when trials weigh `weights` (B, T) in place of 1, to first order. (B, P)."""
        normals = self.normals()
        scores = np.stack([j.T @ r for j, r in zip(self.jacobians, self.residuals, strict=True)])
        scores = scores - scores.mean(axis=0)  # they sum to nothing, but for a search that stopped early
        prior = np.zeros_like(normals[0]) if self.prior is None else np.diag(self.prior**2)
        scale = 1 / np.sqrt(np.maximum(np.diag(normals.sum(axis=0) + prior), 1e-300))
        scaling = np.outer(scale, scale)
        weighted = (np.einsum("bt,tpq->bpq", weights, normals) + prior) * scaling
        return -np.einsum("bpq,bq->bp", np.linalg.pinv(weighted, hermitian=True) * scaling, weights @ scores)


@dataclass
class Found:
    """Result of a search.

    vector: the best candidate z. loss: its. converged: stopped for that reason, not because its time was up.
    linear: the residuals around it, if least squares ended there.
    """

    vector: np.ndarray
    loss: float
    convergence: Convergence
    converged: bool
    linear: Linearisation | None = None


def search(problem: Problem, optimizer: Optimizer, seed: int, report: Report) -> Found:
    """The minimum within bounds, from the problem's own start or with it among the first candidates."""
    rng = np.random.default_rng(seed)
    if isinstance(optimizer, DifferentialEvolution):
        found = _evolve(problem, optimizer, rng, report)
    else:
        starts = problem.start()[None]
        if optimizer.starts:
            starts = np.concatenate([starts, _latin_hypercube(rng, optimizer.starts, *problem.bounds())])
            starts = starts[np.argsort(problem.losses(starts), kind="stable")]
        found = _best_descent(problem, starts[: optimizer.descents], optimizer.iterations, optimizer.tolerance, report)
    return _leave_plateaus(problem, found, report) if problem.parameters else found


def _leave_plateaus(problem: Problem, found: Found, report: Report) -> Found:
    """Search again from where parameters begin to matter that do not matter at the minimum found.

    A force range that no pull reaches is one: the loss is flat above the largest tension, so nothing leads from
    there to a smaller minimum below.
    """
    low, high = problem.bounds()
    columns = np.concatenate((found.linear or linearise(problem, found.vector)).jacobians)
    for index in np.flatnonzero(~columns.any(axis=0)):
        scan = np.repeat(found.vector[None], PLATEAU_SCAN, axis=0)
        scan[:, index] = np.linspace(low[index], high[index], PLATEAU_SCAN)
        matters = np.flatnonzero(np.abs(problem.losses(scan) - found.loss) > PLATEAU_LEVEL * found.loss)
        nearest = matters[np.argsort(np.abs(scan[matters, index] - found.vector[index]))][:PLATEAU_STARTS]
        if len(nearest):
            again = _best_descent(problem, scan[nearest], PLATEAU_ITERATIONS, PLATEAU_TOLERANCE, report)
            if again.loss < found.loss:
                found = replace(found, vector=again.vector, loss=again.loss, linear=again.linear)
    return found


def _best_descent(problem: Problem, starts, iterations: int, tolerance: float, report: Report) -> Found:
    descents = [descend(problem, start, iterations, tolerance, report) for start in starts]
    return min(descents, key=lambda found: found.loss)


def descend(problem: Problem, start: np.ndarray, iterations: int, tolerance: float, report: Report) -> Found:
    """Least squares on the loss's residuals. A step and the Jacobian that it will need are one batch."""
    convergence = Convergence()
    known: dict[bytes, Linearisation] = {}
    accepted: list[Linearisation] = []
    low, high = problem.bounds()

    def linear(vector: np.ndarray) -> Linearisation:
        key = vector.tobytes()
        if key not in known:
            while len(known) > 1:  # the iterate and the step tried from it
                known.pop(next(iter(known)))
            known[key] = linearise(problem, vector)
        return known[key]

    def residuals(vector: np.ndarray) -> np.ndarray:
        return np.concatenate([*linear(vector).residuals, problem.prior(vector[None])[0]])

    def derivatives(vector: np.ndarray) -> np.ndarray:
        found = linear(vector)
        accepted[:] = [found]  # scipy asks for derivatives at its iterates alone
        blocks = [*found.residuals, problem.prior(vector[None])[0]]
        loss = 0.5 * sum(float(block @ block) for block in blocks)
        convergence.best.append(loss)
        convergence.mean.append(loss)
        report(loss)
        prior = np.zeros(len(vector)) if found.prior is None else found.prior
        return np.concatenate([*found.jacobians, np.diag(prior)])

    inside = np.clip(start, low + 1e-9, high - 1e-9)
    result = least_squares(
        residuals, inside, derivatives, bounds=(low, high), max_nfev=iterations, ftol=tolerance, xtol=STEP_TOLERANCE
    )
    if result.cost != convergence.best[-1]:
        convergence.best.append(float(result.cost))
        convergence.mean.append(float(result.cost))
    last = accepted[0] if np.array_equal(accepted[0].vector, result.x) else linearise(problem, result.x)
    return Found(result.x, float(result.cost), convergence, result.status > 0, last)


def linearise(problem: Problem, vector: np.ndarray) -> Linearisation:
    """Derivatives of all residuals by differences towards the inside of the bounds, all columns in one batch."""
    high = problem.bounds()[1]
    steps = np.where(vector + DIFFERENCE > high, -DIFFERENCE, DIFFERENCE)
    candidates = np.concatenate([vector[None], vector + np.diag(steps)])
    blocks = problem.residuals(candidates)
    columns = [((block[1:] - block[0]) / steps[:, None]).T for block in blocks]
    weights = problem.prior(np.full((1, len(vector)), 2.0))[0]  # of f - 1 = 1
    return Linearisation(vector, [block[0] for block in blocks], columns, weights if weights.any() else None)


def _evolve(
    problem: Problem, optimizer: DifferentialEvolution, rng: np.random.Generator, report: Report
) -> Found:
    convergence, last = Convergence(), []
    low, high = problem.bounds()

    def losses(columns: np.ndarray) -> np.ndarray:
        values = problem.losses(np.ascontiguousarray(columns.T))
        last[:] = [values]
        return values

    def note(intermediate_result) -> None:
        convergence.best.append(float(intermediate_result.fun))
        convergence.mean.append(float(last[0].mean()))
        report(convergence.best[-1])

    first = _latin_hypercube(rng, optimizer.population + optimizer.population_per_parameter * len(low), low, high)
    first[0] = problem.start()
    result = differential_evolution(
        losses,
        list(zip(low, high, strict=True)),
        strategy="best1bin",
        init=first,
        maxiter=optimizer.generations,
        tol=optimizer.tolerance,
        mutation=(0.4, 0.9),
        recombination=0.9,
        rng=rng,
        polish=False,
        updating="deferred",
        vectorized=True,
        callback=note,
    )
    return Found(result.x, float(result.fun), convergence, bool(result.success))


def _latin_hypercube(rng: np.random.Generator, count: int, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """`count` candidates, one in each of as many slices of every axis. Shape (count, P)."""
    return low + qmc.LatinHypercube(len(low), rng=rng).random(count) * (high - low)
