"""One function for the three stages: they differ in their experiments, their parameters and their loss."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.arm.parameters import PARAMETERS, candidate_fields, set_fields
from trunkline.identification.certainty import Certainty, certainty
from trunkline.identification.experiment import Experiment
from trunkline.identification.loss import LossWeights
from trunkline.identification.problem import Bounds, Problem
from trunkline.identification.search import Convergence, Found, evolve, jacobian, polish
from trunkline.progress import progress

BOUND_TOLERANCE = 0.01  # of the range: closer to an end counts as on it; least squares stays just inside


@dataclass
class Coarse:
    """Search for one scalar per parameter, by differential evolution and a least-squares polish of its result.

    population: candidates a generation. generations: at most. tolerance: relative spread of the losses at the end.
    step_factor: how much coarser than the model's own time step. frames: of every trial, from its start.
    polish_iterations: 0 for none.
    """

    population: int
    generations: int
    tolerance: float
    step_factor: float
    frames: int
    polish_iterations: int


@dataclass
class Fine:
    """Search for factors of every joint around the coarse result.

    method: "least_squares", "differential_evolution" or "none". range: how far a factor may be from 1.
    population, generations: of differential evolution. iterations: of least squares. tolerance: of either.
    """

    method: str
    range: float
    population: int
    generations: int
    iterations: int
    tolerance: float


@dataclass
class Identification:
    """Result of a stage.

    models: "initial", "coarse" and "identified", each a compiled model.
    values: identified scalars. factors: per-joint factors (units,) by parameter, empty if there are none.
    certainty: of the scalars, in ln(value), before joints got factors.
    factor_certainty: of all factors, given the scalars; None without factors.
    at_bound: names of what ended on a bound. converged: which searches stopped for that reason.
    """

    models: dict[str, mujoco.MjModel]
    values: dict[str, float]
    factors: dict[str, np.ndarray]
    certainty: Certainty
    factor_certainty: Certainty | None
    at_bound: list[str]
    converged: dict[str, bool]
    convergence: dict[str, Convergence]
    evaluations: int
    diverged: int
    steps: int


def identify(
    label: str,
    model: mujoco.MjModel,
    experiments: list[Experiment],
    segments: tuple[str, ...],
    parameters: dict[str, Bounds],
    per_joint: tuple[str, ...],
    loss: str,
    weights: LossWeights,
    coarse: Coarse,
    fine: Fine,
    seed: int,
) -> Identification:
    """Fit the parameters to the `identify` split among `experiments`; the others are never looked at.

    Args:
        label: shown with the progress.
        model: the model that the stage begins with.
        parameters: scalars of the whole arm and their ranges.
        per_joint: those of them that then get a factor for each joint.
        loss: "distances" (the paper's) or "positions".
    """
    seen = [e for e in experiments if e.split == "identify"]
    short = [_shortened(e, coarse.frames) for e in seen]
    rough = Problem(model, short, segments, parameters, loss, weights, coarse.step_factor)
    low, high = rough.bounds(0.0)
    start = np.log(np.clip([PARAMETERS[p].read(model) for p in parameters], np.exp(low), np.exp(high)))
    with progress(coarse.generations, f"{label} coarse", "generations") as bar:
        found = evolve(
            rough, low, high, start, coarse.population, coarse.generations, coarse.tolerance, seed,
            lambda best: bar.update(1, best_loss=best, **rough.effort()),
        )  # fmt: skip
    searches = {"coarse": found}
    exact = Problem(model, seen, segments, parameters, loss, weights)
    if coarse.polish_iterations:
        found = _polish(exact, low, high, found.vector, coarse.polish_iterations, coarse.tolerance, f"{label} polish")
        searches["polish"] = found
    scalars = found.vector
    values = dict(zip(parameters, np.exp(scalars).tolist(), strict=True))
    coarse_model = _with(model, values, {})
    scalar_certainty = certainty(*(found.linearisation or jacobian(exact, scalars, high)))
    problems = [rough, exact]

    factors: dict[str, np.ndarray] = {}
    factor_certainty = None
    if per_joint and fine.method != "none":
        joints = Problem(coarse_model, seen, segments, {}, loss, weights, per_joint=per_joint)
        searches["per_joint"] = found = _fine(joints, fine, seed, label)
        highest = joints.bounds(fine.range)[1]
        factor_certainty = certainty(*(found.linearisation or jacobian(joints, found.vector, highest)))
        factors = dict(zip(per_joint, found.vector.reshape(len(per_joint), -1), strict=True))
        problems.append(joints)

    return Identification(
        models={"initial": model, "coarse": coarse_model, "identified": _with(coarse_model, {}, factors)},
        values=values,
        factors=factors,
        certainty=scalar_certainty,
        factor_certainty=factor_certainty,
        at_bound=_at_bound(parameters, scalars, low, high) + _factors_at_bound(factors, fine.range),
        converged={name: search.converged for name, search in searches.items()},
        convergence={name: search.convergence for name, search in searches.items()},
        evaluations=sum(p.evaluations for p in problems),
        diverged=sum(p.diverged for p in problems),
        steps=sum(p.steps for p in problems),
    )


def _shortened(experiment: Experiment, frames: int) -> Experiment:
    window = slice(0, frames)
    return Experiment(
        **vars(experiment)
        | {name: getattr(experiment, name)[window] for name in ("controls", "positions", "measured")}
    )


def _polish(problem: Problem, low, high, start, iterations: int, tolerance: float, label: str) -> Found:
    with progress(iterations, label, "iterations") as bar:
        return polish(
            problem, low, high, start, iterations, tolerance,
            lambda best: bar.update(1, best_loss=best, **problem.effort()),
        )  # fmt: skip


def _fine(problem: Problem, fine: Fine, seed: int, label: str) -> Found:
    """Factors of every joint, started from 1."""
    low, high = problem.bounds(fine.range)
    start = np.ones(len(low))
    if fine.method == "least_squares":
        return _polish(problem, low, high, start, fine.iterations, fine.tolerance, f"{label} per joint")
    with progress(fine.generations, f"{label} per joint", "generations") as bar:
        return evolve(
            problem, low, high, start, fine.population, fine.generations, fine.tolerance, seed,
            lambda best: bar.update(1, best_loss=best, **problem.effort()),
        )  # fmt: skip


def _with(model: mujoco.MjModel, values: dict[str, float], factors: dict[str, np.ndarray]) -> mujoco.MjModel:
    """A copy of `model` with these parameters."""
    changed = model.__copy__()
    if values or factors:
        fields = candidate_fields(
            model,
            {name: np.array([value]) for name, value in values.items()},
            {name: factor[None] for name, factor in factors.items()},
        )
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
