"""One function for the three stages: they differ in their experiments and in their parameters."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from trunkline.compute.progress import progress
from trunkline.identification.evaluation.evaluation import marker_positions
from trunkline.identification.fit.considered import Moves, considered, half_widths
from trunkline.identification.fit.fit import Fit, Refinement
from trunkline.identification.fit.influence import Influence, influence
from trunkline.identification.fit.intervals import Certainty, bootstrap, certainty
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.optimizers import Optimizer
from trunkline.identification.fit.problem import Problem
from trunkline.identification.fit.robust import reweighted
from trunkline.identification.fit.search import Convergence, SearchResult, descend, search
from trunkline.identification.fit.surrogate import Surrogate, surrogate
from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.parameters.parameters import MASS, candidate_fields, parameter_named, set_fields
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.resting import RestShape, hang_in
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import IDENTIFY

NEAR = 5.0  # times the last descent's tolerance: where outlying trials are still to be weighed, it need be no nearer
SEEN = 0.05  # share of the losses by which a surrogate may mistake those at a new estimate, and still serve there
REWEIGHINGS, SAME_WEIGHT = 5, 0.05  # at most; weights that change by less leave the minimum where it is
BOUND_TOLERANCE = 0.01  # of the range: closer to an end counts as on it; least squares stays just inside


@dataclass
class Identification:
    """Result of a stage.

    models: "initial", "coarse" and "identified", each a compiled model.
    values: identified scalars. factors: per-joint factors (units,) by parameter, empty if there are none.
    certainty: of the scalars, on the axes of the search, before joints got factors. bootstrap: their 95 % intervals
        by resampling trials, lowest and highest z, shape (2, P).
    factor_certainty: of all factors, given the scalars; None without factors.
    considered: how far the scalars move with what the model fixes, on the axes of the search; empty if nothing is.
    unconsidered: a line on each quantity with which the arm diverges.
    influence: of every trial on every scalar.
    at_bound: names of what ended on a bound.
    converged: which searches stopped for that reason; the coarse one, if its starts agree too.
    agreeing, starts: of so many distinct starts of the coarse search, how many end at its least loss.
    """

    models: dict[str, mujoco.MjModel]
    values: dict[str, float]
    factors: dict[str, np.ndarray]
    certainty: Certainty
    bootstrap: np.ndarray
    factor_certainty: Certainty | None
    considered: Moves
    unconsidered: list[str]
    influence: Influence
    at_bound: list[str]
    converged: dict[str, bool]
    agreeing: int
    starts: int
    convergence: dict[str, Convergence]
    evaluations: int
    diverged: int
    steps: int

    @property
    def half_width(self) -> np.ndarray:
        """Of the scalars' 95 % intervals, with what is considered, on the axes of the search. Shape (P,)."""
        return half_widths(self.certainty.half_width, self.considered)


def identify(label: str, model: mujoco.MjModel, experiments: list[Experiment], fit: Fit) -> Identification:
    """Fit the parameters to the `identify` split among `experiments`; the others are never looked at.

    Args:
        label: shown with the progress.
        model: the model that the stage begins with.
    """
    method, parameters, per_joint, rest = fit.method, fit.parameters, fit.per_joint, fit.rest
    fitted = [e for e in experiments if e.split == IDENTIFY]
    few = _few(fitted, method.rough.trials)
    if MASS in parameters and not any(e.load for e in few):  # without one, every mass does
        few += [e for e in fitted if e.load][:1]
    short = [e.shortened(method.rough.frames) for e in few]
    coarse_problem, exact = fit.problem(model, short, method.rough.step_factor), fit.problem(model, fitted)
    searches = {"coarse": _search(coarse_problem, method.optimizer, method.seed, f"{label} coarse")}
    problems, result = [coarse_problem, exact], searches["coarse"]
    near, last = exact, "polish"
    if method.rough.step_factor > 1 and not all(is_static(e.kind) for e in fitted):  # at rest, the step changes nothing
        near, last = fit.problem(model, fitted, method.rough.step_factor), "whole"
        problems.append(near)
    nearly = replace(method.polish, tolerance=min(NEAR * method.polish.tolerance, 1.0))
    result = _refine(near, result, nearly, f"{label} near")
    # what outlies, and by how much an estimate answers a trial, is as plain at a coarser step, which costs less
    searches[last], around = _reweigh(near, result, fit, f"{label} {last}")
    result = searches[last]
    if near is not exact:
        exact.trial_weights = near.trial_weights
        searches["polish"] = result = _refine(exact, result, method.polish, f"{label} polish")
    values = values_of(parameters, result.vector)
    coarse = with_parameters(model, values, rest=rest)
    at_bound = _at_bound(parameters, result.vector, *exact.bounds())
    linear = linearise(exact, result.vector, result.residuals)
    moves, unconsidered = {}, []
    if not fit.considered.none:
        moves, unconsidered = considered(exact, linear, fit.considered, fit.earlier)

    factors: dict[str, np.ndarray] = {}
    factor_certainty = None
    if per_joint:
        # trials count as independent, each with the coarse fit's loss for its variance
        prior_weight = np.sqrt(2 * result.loss / len(fitted)) / method.per_joint_deviation
        joints = replace(
            replace(fit, parameters={}).problem(coarse, fitted),
            per_joint=per_joint, per_joint_range=method.per_joint_range, prior_weight=prior_weight,
            trial_weights=exact.trial_weights,
        )  # fmt: skip
        searches["per_joint"] = result = _search(joints, method.fine, method.seed, f"{label} per joint")
        factor_certainty = certainty(linearise(joints, result.vector, result.residuals), method.per_joint_deviation)
        factors = dict(zip(per_joint, result.vector.reshape(len(per_joint), -1), strict=True))
        at_bound += _factors_at_bound(factors, method.per_joint_range)
        problems.append(joints)

    return Identification(
        models={"initial": model, "coarse": coarse, "identified": with_parameters(coarse, {}, factors, rest)},
        values=values,
        factors=factors,
        certainty=certainty(linear, around=around),
        bootstrap=bootstrap(linear, method.seed, around),
        factor_certainty=factor_certainty,
        considered=moves,
        unconsidered=unconsidered,
        influence=influence(around, [e.name for e in fitted], list(parameters)),
        at_bound=at_bound,
        converged={name: search.converged for name, search in searches.items()},
        agreeing=searches["coarse"].agreeing,
        starts=searches["coarse"].starts,
        convergence={name: search.convergence for name, search in searches.items()},
        evaluations=sum(p.evaluations for p in problems),
        diverged=sum(p.diverged for p in problems),
        steps=sum(p.steps for p in problems),
    )


def values_of(parameters, vector: np.ndarray) -> dict[str, float]:
    """What the scalars at the head of a candidate z are, in their units."""
    return {name: float(parameter_named(name).value(z)) for name, z in zip(parameters, vector, strict=False)}


def _few(experiments: list[Experiment], count: int) -> list[Experiment]:
    """`count` of them, from the one that swings out least to the one that swings out most, evenly between."""
    swings = [np.linalg.norm(e.positions[e.measured][:, :2], axis=-1).max(initial=0) for e in experiments]
    order = np.argsort(swings, kind="stable")
    places = np.linspace(0, len(order) - 1, min(count, len(order))).round().astype(int)
    return [experiments[i] for i in order[places]]


def _search(problem: Problem, optimizer: Optimizer, seed: int, label: str) -> SearchResult:
    with progress(optimizer.steps(), label, "iterations") as bar:
        return search(
            problem, optimizer, seed, lambda best: bar.update(1, best_loss=best, **problem.effort()), bar.expect
        )


def _refine(problem: Problem, coarse: SearchResult, settings: Refinement, label: str) -> SearchResult:
    """Least squares from the best, by this problem, of the minima of the coarse search."""
    start = coarse.vector
    if coarse.others:
        minima = np.stack([coarse.vector, *coarse.others])
        start = minima[np.argmin(problem.losses(minima))]
    with progress(settings.iterations, label, "iterations") as bar:
        return descend(
            problem, start, settings.iterations, settings.tolerance,
            lambda best: bar.update(1, best_loss=best, **problem.effort()),
        )  # fmt: skip


def _reweigh(problem: Problem, result: SearchResult, fit: Fit, label: str) -> tuple[SearchResult, Surrogate]:
    """The minimum in which outlying trials count less, from near it, and the surrogate around it.

    A surrogate says which, and about where the minimum then is; least squares goes there, until the weights stay. The
    first is of first order, which costs little where much is still to move. One of second order is made where its
    prediction of the losses was wrong, or where the weights stay by it.
    """
    kinds, settings = [e.kind for e in problem.experiments], fit.method.polish
    straight = marker_positions(problem.model, problem.markers, problem.model.qpos0)
    bends = np.array([np.square(e.positions - straight).sum(axis=2)[e.measured].mean() for e in problem.experiments])
    around = made = surrogate(problem, result.vector, result.residuals, second=False)
    made_at, is_last = result.vector, False  # is_last: whether it is of as high an order as there is
    for turn in range(REWEIGHINGS):
        weights, place = reweighted(around, kinds, bends, fit.weights.outlying)
        stays = turn > 0 and np.abs(weights - problem.trial_weights).max() < SAME_WEIGHT
        if stays and is_last:
            break
        if stays:
            around = made = surrogate(problem, result.vector, result.residuals)
            made_at, is_last = result.vector, True
            continue
        problem.trial_weights = weights
        tried = np.stack([result.vector, np.clip(result.vector + place, *problem.bounds())])
        start = tried[np.argmin(problem.losses(tried))]
        with progress(settings.iterations, label, "iterations") as bar:
            result = descend(
                problem, start, settings.iterations, settings.tolerance,
                lambda best, bar=bar: bar.update(1, best_loss=best, **problem.effort()),
            )  # fmt: skip
        assert result.residuals is not None, "least squares ends on residuals"
        moved, losses = result.vector - made_at, _trial_losses(problem, result.residuals)
        if np.abs(made.losses(moved[None])[0] - losses).sum() <= SEEN * losses.sum():
            around = made.moved(moved, weights)
        else:
            around = made = surrogate(problem, result.vector, result.residuals)
            made_at, is_last = result.vector, True
    if not is_last:
        around = surrogate(problem, result.vector, result.residuals)
    return result, around


def _trial_losses(problem: Problem, residuals: list[np.ndarray]) -> np.ndarray:
    """Of every trial by itself, whatever its weight in the sum. Shape (T,)."""
    return np.array([0.5 * block @ block for block in residuals]) / problem.trial_weights


def with_parameters(
    model: mujoco.MjModel,
    values: dict[str, float],
    factors: dict[str, np.ndarray] | None = None,
    rest: RestShape | None = None,
) -> mujoco.MjModel:
    """A copy of `model` with these scalars and these factors of its units, which hangs in the shape `rest`."""
    factors = factors or {}
    changed = model.__copy__()
    if values or factors:
        fields = candidate_fields(
            model,
            {name: np.array([value]) for name, value in values.items()},
            {name: factor[None] for name, factor in factors.items()},
        )
        set_fields(changed, fields)
    if rest is not None:
        fields: Fields = {}
        hang_in(fields, changed, rest)
        set_fields(changed, fields)
    return changed


def _at_bound(parameters, vector: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[str]:
    margin = BOUND_TOLERANCE * (high - low)
    return [p for p, z, a, b, m in zip(parameters, vector, low, high, margin, strict=True) if z < a + m or z > b - m]


def _factors_at_bound(factors: dict[str, np.ndarray], span: float) -> list[str]:
    return [
        f"{name} of unit {index + 1}"
        for name, values in factors.items()
        for index in np.flatnonzero(np.abs(values - 1) > span * (1 - 2 * BOUND_TOLERANCE))  # the range is 2 spans
    ]
