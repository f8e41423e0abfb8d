"""Two ways to the minimum: differential evolution (the paper's) and least squares, both a batch at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, least_squares

from trunkline.identification.linearisation import Linearisation, linearise
from trunkline.identification.optimizers import DifferentialEvolution, Optimizer
from trunkline.identification.problem import Problem

PLATEAU_SCAN = 24  # values over the range of a parameter that does not matter, and
PLATEAU_STARTS = 2  # from how many of the nearest that do matter to search again
PLATEAU_ITERATIONS, PLATEAU_TOLERANCE = 4, 1e-3  # of each
PLATEAU_LEVEL = 1e-6  # relative change of the loss that matters
STEP_TOLERANCE = 1e-5  # of a candidate z, relative: a smaller step of least squares is no step
ELSEWHERE_STARTS = 2  # besides what was found,
ELSEWHERE_CANDIDATES, ELSEWHERE_APART = 12, 0.15  # the best of so many, so far apart, as a share of a range
ELSEWHERE_ITERATIONS, ELSEWHERE_TOLERANCE = 25, 1e-3  # of least squares from each
AGREEING = 1.05  # times the least loss
Report = Callable[[float], None]  # called with the best loss after each generation or iteration


@dataclass
class Convergence:
    """Best loss so far and mean loss of each generation's trials; for least squares both are the iterate's."""

    best: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)


@dataclass
class Found:
    """Result of a search.

    vector: the best candidate z. loss: its. converged: stopped for that reason, not because its time was up.
    agreeing, starts: of so many distinct starts, how many ended at a loss as small; 0 of 0 if there was only one.
    linear: the residuals around it, if least squares ended there. others: worse minima that were found on the way,
    which whole trials may rank otherwise than the few that a search is made on.
    """

    vector: np.ndarray
    loss: float
    convergence: Convergence
    converged: bool
    linear: Linearisation | None = None
    others: tuple[np.ndarray, ...] = ()
    agreeing: int = 0
    starts: int = 0


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
    if not problem.parameters:
        return found
    if isinstance(optimizer, DifferentialEvolution) or optimizer.starts:  # else it goes on from what is known
        found = _from_elsewhere(problem, found, rng, report)
    return _leave_plateaus(problem, found, report)


def _from_elsewhere(problem: Problem, found: Found, rng: np.random.Generator, report: Report) -> Found:
    """Least squares from a few starts far from what was found and from one another, and how many of them end there.

    A search that ends for its own reasons may still have ended beside the minimum. It has converged if distinct starts
    agree with it: at least two ends, its own included, as good as the best.
    """
    low, high = problem.bounds()
    drawn = _latin_hypercube(rng, ELSEWHERE_CANDIDATES, low, high)
    drawn = drawn[np.argsort(problem.losses(drawn), kind="stable")]
    chosen = [found.vector]
    for start in drawn:
        apart = min(np.abs((start - other) / (high - low)).max() for other in chosen)
        if apart > ELSEWHERE_APART and len(chosen) <= ELSEWHERE_STARTS:
            chosen.append(start)
    polished = descend(problem, found.vector, ELSEWHERE_ITERATIONS, ELSEWHERE_TOLERANCE, report)
    ends = [polished, *(descend(problem, s, ELSEWHERE_ITERATIONS, ELSEWHERE_TOLERANCE, report) for s in chosen[1:])]
    best = min(ends, key=lambda end: end.loss)
    agreeing = sum(end.loss <= AGREEING * best.loss for end in ends)
    others = (*found.others, *(end.vector for end in ends if end is not best))
    return replace(
        found, vector=best.vector, loss=best.loss, linear=best.linear, others=others, agreeing=agreeing,
        starts=len(ends), converged=found.converged and agreeing > 1,
    )  # fmt: skip


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
                others = (*found.others, found.vector)
                found = replace(found, vector=again.vector, loss=again.loss, linear=again.linear, others=others)
            else:
                found = replace(found, others=(*found.others, again.vector))
    return found


def _best_descent(problem: Problem, starts, iterations: int, tolerance: float, report: Report) -> Found:
    descents = [descend(problem, start, iterations, tolerance, report) for start in starts]
    return min(descents, key=lambda found: found.loss)


def descend(problem: Problem, start: np.ndarray, iterations: int, tolerance: float, report: Report) -> Found:
    """Least squares on the loss's residuals. Only a step that is taken costs a Jacobian.

    It ends with the first step that gains less than `tolerance` of the loss, also where less was gained than expected:
    there scipy's own rule goes on, in ever smaller steps along a kink.
    """
    convergence = Convergence()
    known: dict[bytes, list[np.ndarray]] = {}
    accepted: list[Linearisation] = []
    low, high = problem.bounds()

    def blocks_at(vector: np.ndarray) -> list[np.ndarray]:
        key = vector.tobytes()
        if key not in known:
            known[key] = [block[0] for block in problem.residuals(vector[None])]
        return known[key]

    def residuals(vector: np.ndarray) -> np.ndarray:
        return np.concatenate([*blocks_at(vector), problem.prior(vector[None])[0]])

    def derivatives(vector: np.ndarray) -> np.ndarray:
        found = linearise(problem, vector, blocks_at(vector))
        known.clear()  # steps before this iterate are not tried again
        known[vector.tobytes()] = found.residuals
        accepted[:] = [found]  # scipy asks for derivatives at its iterates alone
        blocks = [*found.residuals, problem.prior(vector[None])[0]]
        loss = 0.5 * sum(float(block @ block) for block in blocks)
        convergence.best.append(loss)
        convergence.mean.append(loss)
        report(loss)
        prior = np.zeros(len(vector)) if found.prior is None else found.prior
        return np.concatenate([*found.jacobians, np.diag(prior)])

    def enough(_: OptimizeResult) -> None:
        if len(best := convergence.best) > 1 and best[-2] - best[-1] < tolerance * best[-2]:
            raise StopIteration

    inside = np.clip(start, low + 1e-9, high - 1e-9)
    result = least_squares(
        residuals, inside, derivatives, bounds=(low, high), max_nfev=iterations, ftol=tolerance, xtol=STEP_TOLERANCE,
        callback=enough,
    )  # fmt: skip
    if result.cost != convergence.best[-1]:
        convergence.best.append(float(result.cost))
        convergence.mean.append(float(result.cost))
    last = accepted[0]
    if not np.array_equal(last.vector, result.x):
        last = linearise(problem, result.x, blocks_at(result.x))
    return Found(result.x, float(result.cost), convergence, result.status != 0, last)


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
    from scipy.stats import qmc  # half of a stage's time to import, so not before its first line

    return low + qmc.LatinHypercube(len(low), rng=rng).random(count) * (high - low)
