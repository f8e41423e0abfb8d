"""Two ways to the minimum: differential evolution (the paper's) and least squares, both a batch at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import differential_evolution, least_squares

from trunkline.identification.fit.linearisation import Linearisation, linearise
from trunkline.identification.fit.optimizers import DifferentialEvolution, Optimizer
from trunkline.identification.fit.problem import Problem

PLATEAU_SCAN = 12  # values over the range of a parameter that does not matter
PLATEAU_LEVEL = 1e-6  # relative change of the loss that matters
STEP_TOLERANCE = 1e-5  # of a candidate z, relative: a smaller step of least squares is no step
STARTS = 3  # of least squares, at least, that have to agree
APART = 0.15  # as a share of a range, in one parameter at least, from one another
CANDIDATES = 12  # drawn beside what differential evolution found, for the other starts
ITERATIONS, TOLERANCE = 25, 1e-3  # of least squares after differential evolution
AGREEING = 1.05  # times the least loss
FORESEEN = 0.1  # of a step's gain, by how much that may be off which a Jacobian foresaw, to go on with it
Report = Callable[[float], None]  # called with the best loss after each generation or iteration
Expect = Callable[[int], None]  # called with how many more of those there will be than expected so far, or fewer


@dataclass
class Convergence:
    """Best loss so far and mean loss of each generation's trials; for least squares both are the iterate's."""

    best: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)


@dataclass
class SearchResult:
    """Result of a search.

    vector: the best candidate z. loss: its. converged: stopped for that reason, not because its time was up.
    agreeing, starts: of so many distinct starts, how many ended at a loss as small; 0 of 0 if there was only one.
    residuals: per trial (R,), if least squares ended there. flat: which parameters did not matter near it, (P,),
    likewise. others: worse minima that were on the way, which whole trials may rank otherwise than the few that a
    search is made on.
    """

    vector: np.ndarray
    loss: float
    convergence: Convergence
    converged: bool
    residuals: list[np.ndarray] | None = None
    flat: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    others: tuple[np.ndarray, ...] = ()
    agreeing: int = 0
    starts: int = 0


def _not_shown(_: int) -> None:
    """Where nobody counts."""


def search(
    problem: Problem, optimizer: Optimizer, seed: int, report: Report, expect: Expect = _not_shown
) -> SearchResult:
    """The minimum within bounds, from the problem's own start or with it among the first candidates.

    Args:
        expect: told where there are more or fewer iterations than `optimizer.steps()`.
    """
    rng = np.random.default_rng(seed)
    if isinstance(optimizer, DifferentialEvolution):
        evolved = _evolve(problem, optimizer, rng, report)
        expect(len(evolved.convergence.best) - optimizer.steps())
        if not problem.parameters:
            return evolved
        drawn = _latin_hypercube(rng, CANDIDATES, *problem.bounds())
        ranks = np.argsort(problem.losses(drawn, rough=True), kind="stable")
        candidates = np.concatenate([evolved.vector[None], drawn[ranks]])
        result = _several(problem, _apart(problem, candidates, STARTS), ITERATIONS, TOLERANCE, report, expect)
        return replace(result, convergence=evolved.convergence, converged=evolved.converged and result.agreeing > 1)
    candidates, count = problem.start()[None], 1
    if optimizer.starts:  # else it goes on from what is known
        drawn = _latin_hypercube(rng, optimizer.starts, *problem.bounds())
        candidates = np.concatenate([candidates, drawn])
        candidates = candidates[np.argsort(problem.losses(candidates, rough=True), kind="stable")]
        count = max(optimizer.descents, STARTS) if problem.parameters else optimizer.descents
    starts = _apart(problem, candidates, count)
    expect(-optimizer.steps())
    result = _several(problem, starts, optimizer.iterations, optimizer.tolerance, report, expect)
    if count == 1:
        return replace(result, agreeing=0, starts=0)
    return replace(result, converged=result.converged and result.agreeing > 1)


def _apart(problem: Problem, candidates: np.ndarray, count: int) -> list[np.ndarray]:
    """The first of the candidates (C, P) and those of the next that are far from it and from one another."""
    low, high = problem.bounds()
    chosen = [candidates[0]]
    for start in candidates[1:]:
        apart = min(np.abs((start - other) / (high - low)).max() for other in chosen)
        if apart > APART and len(chosen) < count:
            chosen.append(start)
    return chosen


def _several(
    problem: Problem,
    starts: list[np.ndarray],
    iterations: int,
    tolerance: float,
    report: Report,
    expect: Expect = _not_shown,
) -> SearchResult:
    """The best end of least squares from several starts, the best of them first, and how many of them end as well.

    A search that ends for its own reasons may still have ended beside the minimum. It has converged if distinct starts
    agree with it: at least two ends, its own included, as good as the best. What counts is where each start leads once
    it has left the plateaus on its way: on one, a start would end beside the minimum that it might have found.
    """
    expect(len(starts) * iterations)
    ends = []
    for index, start in enumerate(starts):
        expect(-iterations)  # `_ends` expects them itself
        ends.append(_ends(problem, start, iterations, tolerance, report, index > 0, expect))
    losses = [min(end.loss for end in each) for each in ends]
    every = sorted((end for each in ends for end in each), key=lambda end: end.loss)
    agreeing = sum(loss <= AGREEING * every[0].loss for loss in losses)
    others = tuple(end.vector for end in every[1:])
    return replace(every[0], others=others, agreeing=agreeing, starts=len(starts))


def _ends(
    problem: Problem,
    start: np.ndarray,
    iterations: int,
    tolerance: float,
    report: Report,
    hasty: bool,
    expect: Expect = _not_shown,
) -> list[SearchResult]:
    """Where least squares ends from `start`, and from where parameters begin to matter that do not matter there.

    A force range that no pull reaches is one: the loss is flat above the largest tension, so nothing leads from
    there to a smaller minimum below.

    Args:
        hasty: leave a plateau at once, not from its own minimum, unless nothing better is found outside.
    """

    def descent(start: np.ndarray, hasty: bool = False) -> SearchResult:
        """Its limit of iterations is expected while it lasts, what it took once it has ended."""
        expect(iterations)
        reported = []
        end = descend(problem, start, iterations, tolerance, lambda best: reported.append(report(best)), hasty)
        expect(len(reported) - iterations)
        return end

    ends = [descent(start, hasty)]
    if not problem.parameters:
        return ends
    (low, high), first = problem.bounds(), ends[0]
    plateaus = np.flatnonzero(first.flat)
    for index in plateaus:
        scan = np.repeat(first.vector[None], PLATEAU_SCAN, axis=0)
        scan[:, index] = np.linspace(low[index], high[index], PLATEAU_SCAN)
        losses = problem.losses(scan)
        matters = np.abs(losses - first.loss) > PLATEAU_LEVEL * first.loss
        if matters.any():
            edge = scan[np.argmin(np.where(matters, losses, np.inf))]
            ends.append(descent(edge))
    if hasty and len(plateaus) and min(ends, key=lambda end: end.loss) is first:
        ends[0] = descent(first.vector)
    return ends


def _flat(linear: Linearisation) -> np.ndarray:
    """Which parameters do not matter at all. Shape (P,)."""
    return np.asarray(~np.concatenate(linear.jacobians).any(axis=0))


class _Ended(Exception):
    """A descent has come to its end at the candidate that scipy asks derivatives of."""


class _Misled(Exception):
    """A Jacobian that was updated leads down no further."""


@dataclass
class _Local:
    """Residuals (R,) at a candidate (P,) and their Jacobian (R, P), by differences there, or else updated by steps."""

    vector: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    updated: bool = False

    def foreseen(self, vector: np.ndarray) -> np.ndarray:
        return self.residuals + self.jacobian @ (vector - self.vector)

    def moved(self, vector: np.ndarray, residuals: np.ndarray) -> "_Local":
        """At `vector`, with the least change by which the Jacobian would have foreseen these residuals."""
        step = vector - self.vector
        change = np.outer(residuals - self.foreseen(vector), step / (step @ step))
        return _Local(vector.copy(), residuals, self.jacobian + change, True)


def descend(
    problem: Problem, start: np.ndarray, iterations: int, tolerance: float, report: Report, hasty: bool = False
) -> SearchResult:
    """Least squares on the loss's residuals.

    A step whose gain the Jacobian foresaw updates it (Broyden 1965), which costs nothing; after others it is made anew,
    by differences. The end is the first step by one of these that gains less than `tolerance` of the loss, also where
    less was gained than expected: there scipy's own rule goes on, in ever smaller steps along a kink. If `hasty`, it
    is the first iterate after the start at which a parameter does not matter, too.
    """
    convergence = Convergence()
    tried: dict[bytes, list[np.ndarray]] = {}
    matters = np.ones(len(start), dtype=bool)
    low, high = problem.bounds()
    here, spent = np.clip(start, low + 1e-9, high - 1e-9), 0
    local: _Local | None = None

    def blocks_at(vector: np.ndarray) -> list[np.ndarray]:
        nonlocal spent
        key = vector.tobytes()
        if key not in tried:
            tried[key] = [block[0] for block in problem.residuals(vector[None])]
            spent += 1
        return tried[key]

    def residuals(vector: np.ndarray) -> np.ndarray:
        values = np.concatenate([*blocks_at(vector), problem.prior(vector[None])[0]])
        if local is not None and local.updated and 0.5 * values @ values >= convergence.best[-1]:
            raise _Misled
        return values

    def derivatives(vector: np.ndarray) -> np.ndarray:
        nonlocal here, local
        before, local = local, None
        values, blocks, best = residuals(vector), blocks_at(vector), convergence.best
        tried.clear()  # steps before this iterate are not tried again
        tried[vector.tobytes()] = blocks
        if not best or (vector != here).any():
            best.append(0.5 * float(values @ values))
            convergence.mean.append(best[-1])
            report(best[-1])
        here = vector.copy()
        if before is not None:
            gain = best[-2] - best[-1]
            if gain < tolerance * best[-2]:
                raise _Misled if before.updated else _Ended
            foreseen = before.foreseen(vector)
            if abs(0.5 * foreseen @ foreseen - best[-1]) <= FORESEEN * gain:
                local = before.moved(vector, values)
                return local.jacobian
        linear = linearise(problem, vector, blocks)
        matters[:] = ~_flat(linear)
        if hasty and len(best) > 1 and not matters.all():
            raise _Ended
        prior = np.zeros(len(vector)) if linear.prior is None else linear.prior
        local = _Local(here, values, np.concatenate([*linear.jacobians, np.diag(prior)]))
        return local.jacobian

    converged = False
    while not converged and spent < iterations:
        local = None
        try:
            result = least_squares(
                residuals, here, derivatives, bounds=(low, high), max_nfev=iterations - spent + bool(tried),
                ftol=tolerance, xtol=STEP_TOLERANCE,
            )  # fmt: skip
            if result.status == 0:
                break
            converged = local is None or not local.updated
        except _Misled:
            continue
        except _Ended:
            converged = True
    return SearchResult(here, convergence.best[-1], convergence, converged, blocks_at(here), ~matters)


def _evolve(
    problem: Problem, optimizer: DifferentialEvolution, rng: np.random.Generator, report: Report
) -> SearchResult:
    convergence, last = Convergence(), []
    low, high = problem.bounds()

    def losses(columns: np.ndarray) -> np.ndarray:
        values = problem.losses(np.ascontiguousarray(columns.T), rough=True)
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
    return SearchResult(result.x, float(result.fun), convergence, bool(result.success))


def _latin_hypercube(rng: np.random.Generator, count: int, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """`count` candidates, one in each of as many slices of every axis. Shape (count, P)."""
    from scipy.stats import qmc  # half of a stage's time to import, so not before its first line

    return low + qmc.LatinHypercube(len(low), rng=rng).random(count) * (high - low)
