"""How far what a model fixes, and no stage identifies, may have moved what they did: consider parameters.

S. F. Schmidt, Application of state-space methods to navigation problems (Advances in Control Systems 3, 1966); G. J.
Bierman, Factorization Methods for Discrete Sequential Estimation (1977), chapter VIII; JCGM 100:2008, 5.1. A quantity c
of standard deviation σ, at which the model has a value c_0, moves the minimum of ½ Σ r² to first order by

    S_c = -(Σ JᵀJ)⁻¹ Σ JᵀJ_c,    J_c = r(c_0 + σ) - r(c_0),

and adds S_c S_cᵀ to the covariance of the parameters. Here J_c are differences as large as σ: one evaluation each.

What an earlier stage identified is considered too. What moved it, moves the later stage by both ways at once, and may
cancel: S_c is then that of J_c + J_E S_c,E, with J_E by differences along the axes of its covariance.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtri, stdtrit

from trunkline.identification.fit.linearisation import Linearisation
from trunkline.identification.fit.problem import Problem
from trunkline.identification.fit.surrogate import reaches
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.parameters.tolerances import Perturbation, Tolerances, changes, of_parameter
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.winch import wind
from trunkline.recordings.trials.experiments import is_static

Key = tuple[str, str]  # source and label of a quantity
Moves = dict[Key, np.ndarray]  # S_c, on the axes of the search, (P,)
Effects = dict[Key, list[np.ndarray] | None]  # per trial the residuals' change (R,); None where the arm diverges
EARLIER = "earlier"  # source of what the trials of an earlier stage left open
# times the time step: what a step itself changes is in both of two simulations, and goes as they are subtracted
COARSER = 2.0
AT_ONCE = 12  # candidates, as the positions of all of them are kept until they are compared
SCALES = (1.0, 0.125)  # shares of a deviation by which residuals are changed, in turn, where the arm diverges with one
LEVEL = ndtri(0.975)  # of what is considered: its deviations are stated, not estimated (JCGM 100, G.4)


@dataclass
class Earlier:
    """What an earlier stage identified, of P parameters on the axes of the search.

    stage, names. estimate: (P,). scatter: columns that are independent of each other, which its trials leave open given
    its model; their products with themselves add up to the covariance. Shape (P, C). moves: (P,) each.
    """

    stage: str
    names: list[str]
    estimate: np.ndarray
    scatter: np.ndarray
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
        return cls(stage, names, estimate, _root(correlation * np.outer(deviation, deviation)), moves)

    def without(self, names) -> "Earlier":
        """But for parameters that a later stage identifies anew."""
        staying = [i for i, name in enumerate(self.names) if name not in names]
        return Earlier(
            self.stage, [self.names[i] for i in staying], self.estimate[staying], self.scatter[staying],
            {key: move[staying] for key, move in self.moves.items()},
        )  # fmt: skip


@dataclass
class _Steps:
    """An earlier stage's parameters that this one takes over, moved along the axes of their covariance.

    root: columns whose products with themselves add up to it, with the stage's moves. Shape (P, P). shifts: by how much
    residuals change with each column, per trial (R, P).
    """

    stage: Earlier
    root: np.ndarray
    shifts: list[np.ndarray] = field(default_factory=list)

    @classmethod
    def of(cls, stage: Earlier) -> "_Steps":
        parts = np.column_stack([stage.scatter, *stage.moves.values()])
        return cls(stage, _root(parts @ parts.T))

    def changes(self, scale: float) -> list[Perturbation]:
        """One for each column, times `scale`."""
        return [_shifted(self.stage, str(number + 1), scale * step) for number, step in enumerate(self.root.T)]

    def change(self, move: np.ndarray) -> list[np.ndarray]:
        """Residuals' change with the parameters' `move` (P,) on the axes of the search. Per trial (R,)."""
        steps = np.linalg.pinv(self.root) @ move
        return [block @ steps for block in self.shifts]


def considered(
    problem: Problem, linear: Linearisation, sizes: Tolerances, earlier: list[Earlier]
) -> tuple[Moves, list[str]]:
    """By how much the minimum of `problem` moves with one standard deviation of each quantity.

    Args:
        linear: of the residuals, at the minimum.

    Returns:
        The moves, and a line on each quantity that is left out, as the arm diverges with the least of it.
    """
    vector, fine = linear.vector, problem
    if not fine.rubs:  # else the motors' damping answers otherwise
        problem = replace(fine, step_factor=COARSER * fine.step_factor)
    base = problem.simulate(vector[None])
    if base.diverged.any():  # a stiff arm
        problem, base = fine, fine.simulate(vector[None])
    blocks = [block[0] for block in problem.compare(base.positions)]
    if problem.rubs:  # the arm sticks and slips as a parameter changes, and only long differences mean something
        linear = replace(linear, jacobians=_differences(problem, vector, reaches(problem)))
    moving = any(not is_static(e.kind) for e in problem.experiments)
    pulled = any(not e.slack(problem.model) for e in problem.experiments)
    stages = [_Steps.of(stage) for part in earlier if (stage := part.without(problem.parameters)).names]

    def model_changes(scale: float) -> list[Perturbation]:
        of_model = changes(problem.model, sizes.scaled(scale), moving, pulled)
        return [*of_model, *(change for stage in stages for change in stage.changes(scale))]

    columns = _of_models(problem, vector, blocks, model_changes) | _of_trials(problem, vector, blocks, sizes)
    lines = [
        f"considered.{source}{label and f' {label}'}: found that the arm diverges with {SCALES[-1]:g} of it, left out"
        for (source, label), column in columns.items()
        if column is None
    ]
    for stage in stages:
        nothing = [np.zeros_like(block) for block in blocks]
        steps = [columns.pop((stage.stage.stage, change.label)) or nothing for change in stage.changes(1.0)]
        stage.shifts = [np.stack(parts, axis=1) for parts in zip(*steps, strict=True)]
    columns |= _of_markers(problem, vector, base.positions, blocks, sizes)
    columns |= _by_kind(problem, linear, sizes, stages)
    answered = {
        key: linear.answers([block[:, None] for block in column])[0]
        for key, column in columns.items()
        if column is not None
    }
    for stage in stages:
        part = stage.stage
        scatter = {(EARLIER, f"{part.stage} {number + 1}"): move for number, move in enumerate(part.scatter.T)}
        response = linear.answers(stage.shifts).T @ np.linalg.pinv(stage.root)  # (parameters here, parameters there)
        for key, move in (scatter | part.moves).items():
            answered[key] = answered.get(key, 0) + response @ move
    return answered, lines


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


def _shifted(stage: Earlier, label: str, step: np.ndarray) -> Perturbation:
    """All parameters of an earlier stage at once, by `step` (P,) on the axes of the search."""
    places = zip(stage.names, stage.estimate + step, strict=True)
    parts = [of_parameter(name, float(parameter_named(name).value(place)), stage.stage) for name, place in places]

    def write(fields, candidate, model):
        for part in parts:
            part.write(fields, candidate, model)

    return Perturbation(stage.stage, label, tuple(dict.fromkeys(name for part in parts for name in part.fields)), write)


def _of_models(
    problem: Problem, vector: np.ndarray, blocks: list[np.ndarray], listed: Callable[[float], list[Perturbation]]
) -> Effects:
    """Residuals' changes with each change of the model in `listed`, whose argument is its size."""
    columns: Effects = {(change.source, change.label): None for change in listed(1.0)}
    for scale in SCALES:
        missing = [change for change in listed(scale) if columns[change.source, change.label] is None]
        for begin in range(0, len(missing), AT_ONCE):
            some = missing[begin : begin + AT_ONCE]
            simulated = problem.simulate(np.repeat(vector[None], len(some), axis=0), near=vector, changes=some)
            compared = problem.compare(simulated.positions)
            for number in np.flatnonzero(~simulated.diverged):
                moved = [(after[number] - block) / scale for after, block in zip(compared, blocks, strict=True)]
                columns[some[number].source, some[number].label] = moved
    return columns


def _of_trials(problem: Problem, vector: np.ndarray, blocks: list[np.ndarray], sizes: Tolerances) -> Effects:
    """Residuals' changes with what acts in trials beside the model: gravity, zeros of cables, winches, tensions."""
    columns: Effects = dict.fromkeys(_trial_changes(problem, sizes))
    for scale in SCALES:
        for key, change in _trial_changes(problem, sizes.scaled(scale)).items():
            if columns[key] is None:
                other = replace(problem, experiments=[change(e) for e in problem.experiments])
                simulated = other.simulate(vector[None])
                if not simulated.diverged.any():
                    compared = other.compare(simulated.positions)
                    columns[key] = [(after[0] - block) / scale for after, block in zip(compared, blocks, strict=True)]
    return columns


def _trial_changes(problem: Problem, sizes: Tolerances) -> dict[Key, Callable[[Experiment], Experiment]]:
    """What `_of_trials` changes, of one trial each."""
    listed: dict[Key, Callable[[Experiment], Experiment]] = {}
    for axis, name in enumerate("xy" if sizes.gravity else ""):
        turn = Rotation.from_rotvec(sizes.gravity * np.eye(3)[axis])
        listed["gravity", name] = lambda e, turn=turn: replace(e, gravity=turn.apply(e.gravity))
    pulled = [e for e in problem.experiments if not e.slack(problem.model)]
    lengths = ArmModel(problem.model).commands == "length"
    for cable in range(problem.model.nu if sizes.zero and pulled and lengths else 0):
        offset = sizes.zero * np.eye(problem.model.nu)[cable]
        listed["zero", str(cable + 1)] = lambda e, d=offset: replace(e, controls=e.controls + d)
    for motor in range(1, problem.model.nu if sizes.gain and pulled and not lengths else 0):  # it pulls by so much more
        factor = 1 + sizes.gain * np.eye(problem.model.nu)[motor]
        listed["gain", str(motor + 1)] = lambda e, f=factor: replace(e, controls=e.controls * f)
    driven = any(not is_static(e.kind) for e in pulled)
    if sizes.backlash and driven and lengths and not ArmModel(problem.model).backlash:
        listed["backlash", ""] = lambda e: _with_play(e, sizes.backlash)
    return listed


def _with_play(experiment: Experiment, play: float) -> Experiment:
    """A trial whose winches have `play` m of backlash."""
    if is_static(experiment.kind):
        return experiment
    drums, cables = experiment.controls[:1].copy(), experiment.controls[:1].copy()
    delivered = wind(experiment.controls[None], drums, cables, np.array([np.inf]), np.array([play]))
    return replace(experiment, controls=delivered[0])


def _of_markers(
    problem: Problem, vector: np.ndarray, positions: list[np.ndarray], blocks: list[np.ndarray], sizes: Tolerances
) -> Effects:
    """Residuals' changes with the places of markers in their bodies' frames and of the base's marker, along each axis.

    One simulation has all markers moved along an axis, and each is compared with the others where they were."""
    count, columns = len(problem.markers), Effects()
    sites = ArmModel(problem.model).marker_sites(problem.markers)

    def along(axis: int) -> Perturbation:
        def write(fields, candidate, model):
            fields["site_pos"][candidate, sites, axis] += sizes.marker_place

        return Perturbation("marker_place", "xyz"[axis], ("site_pos",), write)

    for axis, name in enumerate("xyz" if sizes.base_place else ""):
        moved = problem.compare([places - sizes.base_place * np.eye(3)[axis] for places in positions])
        columns["base_place", name] = [after[0] - block for after, block in zip(moved, blocks, strict=True)]
    if not sizes.marker_place:
        return columns
    simulated = problem.simulate(np.repeat(vector[None], 3, axis=0), near=vector, changes=[along(k) for k in range(3)])
    for axis, name in enumerate("xyz"):
        alone = []
        for before, after in zip(positions, simulated.positions, strict=True):
            places = np.repeat(before, count, axis=0)  # (S, T, S, 3)
            places[range(count), :, range(count)] = after[axis].transpose(1, 0, 2)
            alone.append(places)
        moved = problem.compare(alone)
        for number, marker in enumerate(problem.markers):
            column = [after[number] - block for after, block in zip(moved, blocks, strict=True)]
            columns["marker_place", f"{marker} {name}"] = column
    return columns


def _by_kind(problem: Problem, linear: Linearisation, sizes: Tolerances, stages: list[_Steps]) -> Effects:
    """Residuals' changes with parameters that differ from one kind of experiment to another, in the trials of each."""
    kinds, columns = dict.fromkeys(e.kind for e in problem.experiments), Effects()
    for name, size in sizes.by_kind.items():
        column: list[np.ndarray] = []
        if name in problem.parameters:
            index = list(problem.parameters).index(name)
            column = [size * jacobian[:, index] for jacobian in linear.jacobians]
        for stage in stages:
            if name in stage.stage.names:
                column = stage.change(size * np.eye(len(stage.stage.names))[stage.stage.names.index(name)])
        for kind in kinds if column else ():
            there = [e.kind == kind for e in problem.experiments]
            columns["by_kind", f"{name} {kind}"] = [part * here for part, here in zip(column, there, strict=True)]
    return columns
