"""How far what a model fixes, and no stage identifies, may have moved what they did: consider parameters.

S. F. Schmidt, Application of state-space methods to navigation problems (Advances in Control Systems 3, 1966); G. J.
Bierman, Factorization Methods for Discrete Sequential Estimation (1977), chapter VIII; JCGM 100:2008, 5.1. A quantity c
of standard deviation σ, at which the model has a value c_0, moves the minimum of ½ Σ r² to first order by

    S_c = -(Σ JᵀJ)⁻¹ Σ JᵀJ_c,    J_c = r(c_0 + σ) - r(c_0),

and adds S_c S_cᵀ to the covariance of the parameters. Here J_c are differences as large as σ: one evaluation each.

What an earlier stage identified is considered too. What moved it, moves the later stage by both ways at once, and may
cancel: S_c is then that of J_c + J_E S_c,E, with J_E by differences along the axes of its covariance.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtri, stdtrit

from trunkline.errors import InputError
from trunkline.identification.fit.linearisation import Linearisation
from trunkline.identification.fit.problem import Problem
from trunkline.identification.fit.surrogate import reaches
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.parameters.tolerances import Perturbation, Tolerances, changes, of_parameter
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.winch import wind
from trunkline.recordings.trials.experiments import is_static

Moves = dict[tuple[str, str], np.ndarray]  # by source and label of a quantity: S_c, on the axes of the search, (P,)
Effect = tuple[tuple[str, str], list[np.ndarray]]  # source and label, and per trial the residuals' change (R,)
EARLIER = "earlier"  # source of what the trials of an earlier stage left open
# times the time step: what a step itself changes is in both of two simulations, and goes as they are subtracted
COARSER = 2.0
AT_ONCE = 12  # candidates, as the positions of all of them are kept until they are compared
LEVEL = ndtri(0.975)  # of what is considered: its deviations are stated, not estimated (JCGM 100, G.4)


@dataclass
class Earlier:
    """What an earlier stage identified, of P parameters on the axes of the search.

    stage, names. estimate: (P,). covariance: over its trials, given its model. Shape (P, P). moves: (P,) each.
    """

    stage: str
    names: list[str]
    estimate: np.ndarray
    covariance: np.ndarray
    moves: Moves

    @classmethod
    def from_table(cls, stage: str, table: dict) -> "Earlier":
        """From a stage's parameters.json."""
        rows, names = table["parameters"], list(table["parameters"])
        estimate = np.array([float(parameter_named(name).coordinate(rows[name]["value"])) for name in names])
        ends = [parameter_named(name).coordinate(rows[name]["interval_95_given_model"]) for name in names]
        half = np.abs(np.array(ends) - estimate[:, None]).max(axis=1)
        deviation = half / stdtrit(max(len(table["fitted_to"]) - 1, 1), 0.975)
        correlation = np.array([[table["correlation"][a][b] for b in names] for a in names])
        moves = {
            (source, label): np.array([row[name] for name in names])
            for source, rows in table.get("considered", {}).items()
            for label, row in rows.items()
        }
        return cls(stage, names, estimate, correlation * np.outer(deviation, deviation), moves)

    def without(self, names) -> "Earlier":
        """But for parameters that a later stage identifies anew."""
        left = [i for i, name in enumerate(self.names) if name not in names]
        return Earlier(
            self.stage, [self.names[i] for i in left], self.estimate[left], self.covariance[np.ix_(left, left)],
            {key: move[left] for key, move in self.moves.items()},
        )  # fmt: skip


def considered(problem: Problem, linear: Linearisation, sizes: Tolerances, earlier: list[Earlier]) -> Moves:
    """By how much the minimum of `problem` moves with one standard deviation of each quantity.

    Args:
        linear: of the residuals, at the minimum.
    """
    vector, fine = linear.vector, problem
    if not fine.rubs:  # else the motors' damping answers otherwise
        problem = replace(fine, step_factor=COARSER * fine.step_factor)
    base = problem.simulate(vector[None])
    if base.diverged.any():  # a stiff arm
        problem, base = fine, fine.simulate(vector[None])
    blocks = problem.compare(base.positions)
    if problem.rubs:  # the arm sticks and slips as a parameter changes, and only long differences mean something
        jacobians = _differences(problem, vector, reaches(problem))
        linear = replace(linear, jacobians=jacobians)
    columns: dict[tuple[str, str], list[np.ndarray]] = {}
    moving = any(not is_static(e.kind) for e in problem.experiments)
    pulled = any(not e.slack(problem.model) for e in problem.experiments)
    of_model = changes(problem.model, sizes, moving, pulled)
    roots, of_earlier = [], []
    for stage in (part.without(problem.parameters) for part in earlier):
        root = _root(stage.covariance + sum(np.outer(move, move) for move in stage.moves.values()))
        roots.append((stage, root))
        of_earlier += [_shifted(stage, step) for step in root.T]
    shifts = []
    for change, column in _changed(problem, vector, blocks, [*of_model, *of_earlier]):
        if change.source == EARLIER:
            shifts.append(column)
        else:
            columns[change.source, change.label] = column
    columns |= dict(_of_trials(problem, vector, blocks, sizes))
    columns |= dict(_of_markers(problem, vector, base.positions, blocks, sizes))
    columns |= dict(_by_kind(problem, linear, sizes, roots, shifts))
    answered = {key: linear.answers([block[:, None] for block in column])[0] for key, column in columns.items()}
    begin = 0
    for stage, root in roots:
        to_axes = np.linalg.pinv(root)  # of the stage's parameters, to so many of its steps
        stacked = [np.stack(parts, axis=1) for parts in zip(*shifts[begin : begin + root.shape[1]], strict=True)]
        begin += root.shape[1]
        if not stacked:
            continue
        response = linear.answers(stacked).T @ to_axes  # of this stage to the earlier one's parameters
        for number, scatter in enumerate(_root(stage.covariance).T):
            key = (EARLIER, f"{stage.stage} {number + 1}")
            answered[key] = answered.get(key, 0) + response @ scatter
        for key, move in stage.moves.items():
            answered[key] = answered.get(key, 0) + response @ move
    return answered


def half_widths(given_model: np.ndarray, moves: Moves) -> np.ndarray:
    """Of 95 % intervals, from those given the model (P,) and what is considered. Shape (P,)."""
    squares = sum((np.square(move) for move in moves.values()), np.zeros(len(given_model)))
    return np.sqrt(np.square(given_model) + LEVEL**2 * squares)


def _differences(problem: Problem, vector: np.ndarray, steps: np.ndarray) -> list[np.ndarray]:
    """Derivatives (R, P) per trial, by differences to both sides."""
    ends = [problem.residuals(vector + sign * np.diag(steps), near=vector) for sign in (1, -1)]
    return [((up - down) / (2 * steps[:, None])).T for up, down in zip(*ends, strict=True)]


def _root(covariance: np.ndarray) -> np.ndarray:
    """Columns whose products with themselves add up to the covariance (P, P). Shape (P, P)."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0))


def _shifted(stage: Earlier, step: np.ndarray) -> Perturbation:
    """All parameters of an earlier stage at once, by `step` (P,) on the axes of the search."""
    places = zip(stage.names, stage.estimate + step, strict=True)
    parts = [of_parameter(name, float(parameter_named(name).value(place)), EARLIER) for name, place in places]

    def write(fields, candidate, model):
        for part in parts:
            part.write(fields, candidate, model)

    return Perturbation(
        EARLIER, stage.stage, tuple(dict.fromkeys(name for part in parts for name in part.fields)), write
    )


def _changed(
    problem: Problem, vector, blocks, listed: list[Perturbation]
) -> Iterator[tuple[Perturbation, list[np.ndarray]]]:
    """By how much residuals change with each: per trial (R,). None of what diverges."""
    for begin in range(0, len(listed), AT_ONCE):
        some = listed[begin : begin + AT_ONCE]
        simulated = problem.simulate(np.repeat(vector[None], len(some), axis=0), near=vector, changes=some)
        compared = problem.compare(simulated.positions)
        for number, change in enumerate(some):
            if simulated.diverged[number]:
                raise InputError(
                    f"considered.{change.source}: found that the arm diverges, expected a smaller deviation"
                )
            yield change, [moved[number] - block[0] for moved, block in zip(compared, blocks, strict=True)]


def _of_trials(
    problem: Problem, vector, blocks, sizes: Tolerances
) -> Iterator[tuple[tuple[str, str], list[np.ndarray]]]:
    """Residuals' changes with what acts in trials beside the model: gravity, zeros of cables, winches."""
    listed: list[tuple[tuple[str, str], Callable[[Experiment], Experiment]]] = []
    for axis, name in enumerate("xy" if sizes.gravity else ""):
        turn = Rotation.from_rotvec(sizes.gravity * np.eye(3)[axis])
        listed.append((("gravity", name), lambda e, turn=turn: replace(e, gravity=turn.apply(e.gravity))))
    pulled = [e for e in problem.experiments if not e.slack(problem.model)]
    for cable in range(problem.model.nu if sizes.zero and pulled else 0):
        offset = sizes.zero * np.eye(problem.model.nu)[cable]
        listed.append((("zero", str(cable + 1)), lambda e, d=offset: replace(e, controls=e.controls + d)))
    driven = any(not is_static(e.kind) for e in pulled)
    if sizes.backlash and driven and not ArmModel(problem.model).backlash:
        listed.append((("backlash", ""), lambda e: _with_play(e, sizes.backlash)))
    if not listed:
        return
    trials = problem.experiments
    several = replace(
        problem, experiments=[change(e) for _, change in listed for e in trials],
        trial_weights=np.tile(problem.trial_weights, len(listed)) * len(listed),
    )  # fmt: skip
    moved = several.residuals(vector[None])
    for number, (key, _) in enumerate(listed):
        of_change = moved[number * len(trials) : (number + 1) * len(trials)]
        yield key, [after[0] - block[0] for after, block in zip(of_change, blocks, strict=True)]


def _with_play(experiment: Experiment, play: float) -> Experiment:
    """A trial whose winches have `play` m of backlash."""
    if is_static(experiment.kind):
        return experiment
    drums, cables = experiment.controls[:1].copy(), experiment.controls[:1].copy()
    delivered = wind(experiment.controls[None], drums, cables, np.array([np.inf]), np.array([play]))
    return replace(experiment, controls=delivered[0])


def _of_markers(problem: Problem, vector, positions, blocks, sizes: Tolerances) -> Iterator[Effect]:
    """Residuals' changes with the places of markers in their bodies' frames and of the base's marker, along each axis.

    One simulation has all markers moved along an axis, and each is compared with the others where they were."""
    count = len(problem.markers)
    sites = ArmModel(problem.model).marker_sites(problem.markers)
    for axis, name in enumerate("xyz" if sizes.base_place else ""):
        offset = sizes.base_place * np.eye(3)[axis]
        moved = problem.compare([places - offset for places in positions])
        yield ("base_place", name), [after[0] - block[0] for after, block in zip(moved, blocks, strict=True)]
    if not sizes.marker_place:
        return

    def along(axis: int) -> Perturbation:
        def write(fields, candidate, model):
            fields["site_pos"][candidate, sites, axis] += sizes.marker_place

        return Perturbation("marker_place", "xyz"[axis], ("site_pos",), write)

    simulated = problem.simulate(np.repeat(vector[None], 3, axis=0), near=vector, changes=[along(k) for k in range(3)])
    for axis, name in enumerate("xyz"):
        alone = []
        for before, after in zip(positions, simulated.positions, strict=True):
            places = np.repeat(before, count, axis=0)  # (S, T, S, 3)
            places[range(count), :, range(count)] = after[axis].transpose(1, 0, 2)
            alone.append(places)
        moved = problem.compare(alone)
        for marker in range(count):
            key = ("marker_place", f"{problem.markers[marker]} {name}")
            yield key, [after[marker] - block[0] for after, block in zip(moved, blocks, strict=True)]


def _by_kind(problem: Problem, linear: Linearisation, sizes: Tolerances, roots, shifts) -> Iterator[Effect]:
    """Residuals' changes with parameters that differ from one kind of experiment to another, in the trials of each."""
    kinds = dict.fromkeys(e.kind for e in problem.experiments)
    for name, size in sizes.by_kind.items():
        column: list[np.ndarray] = []
        if name in problem.parameters:
            index = list(problem.parameters).index(name)
            column = [size * jacobian[:, index] for jacobian in linear.jacobians]
        begin = 0
        for stage, root in roots:
            if name in stage.names:
                steps = np.linalg.pinv(root)[:, stage.names.index(name)] * size
                of_stage = zip(*shifts[begin : begin + root.shape[1]], strict=True)
                column = [steps @ np.stack(parts) for parts in of_stage]
            begin += root.shape[1]
        for kind in kinds if column else ():
            there = [e.kind == kind for e in problem.experiments]
            yield ("by_kind", f"{name} {kind}"), [part * here for part, here in zip(column, there, strict=True)]
