"""What the parts of the benchmark search for: the stages' problems, at the size that is asked for."""

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.identification.rival import Rival
from benchmarks.identification.timing import Spent
from trunkline.errors import InputError
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import identify, values_of, with_parameters
from trunkline.identification.fit.problem import Problem
from trunkline.identification.fit.setup import set_up
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.results.parameter_table import undetermined
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.loss import loss_of
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import CAD_MODEL, TRIALS, read_reported
from trunkline.pipeline.inputs import read_spec
from trunkline.recordings.trials.splits import IDENTIFY, VALIDATE

# every stage, and the model that it begins with
STAGES = {
    "identify_stiffness": CAD_MODEL,
    "identify_damping": Path("artifacts/identify_stiffness/arm.xml"),
    "identify_control": Path("artifacts/identify_damping/arm.xml"),
}
SAME_LOSS = 1.01  # within 1 % counts as the same


@dataclass
class Size:
    """How much is run: all trials of the session, if not `--quick`.

    trials, frames: of each problem, at most. budget: s for each search of a rival.
    seeds: runs against the recipe, whose luck differs. repeats: of each timing. rate_frames, growth_frames: frames
    simulated there. units: of the arms in `growth`.
    """

    trials: int = 99
    frames: int = 437
    budget: float = 300.0
    seeds: int = 3
    repeats: int = 3
    rate_frames: int = 60
    growth_frames: int = 40
    units: tuple[int, ...] = (6, 12, 24, 36)


QUICK = Size(trials=2, frames=90, budget=25.0, seeds=1, repeats=2, rate_frames=40, growth_frames=12, units=(6, 12, 24))


@dataclass
class Case:
    """What one stage searches for, and the trials of the same kinds that it never sees."""

    model: mujoco.MjModel
    experiments: list[Experiment]
    unseen: list[Experiment]
    fit: Fit

    def problem(self) -> Problem:
        """At the model's own time step, over whole trials."""
        return self.fit.problem(self.model, self.experiments)

    def values(self, vector: np.ndarray) -> str:
        """A candidate in words."""
        pairs = values_of(self.fit.parameters, vector).items()
        return ", ".join(f"{name} {value:.4g} {PARAMETERS[name].unit}" for name, value in pairs)

    def unseen_errors(self, vector: np.ndarray) -> str:
        """E_internal, position and tip error of a candidate on the unseen trials, in words."""
        replayed = replay(
            with_parameters(self.model, values_of(self.fit.parameters, vector)), self.unseen, self.fit.segments
        )
        table = scores(replayed, self.unseen, self.fit.loss, self.fit.weights)[VALIDATE]
        errors = f"E_internal {table['e_internal_mm']:.3f} mm, position {table['e_position_mm']:.2f} mm"
        return f"validate: {errors}, tip {table['e_tip_mm']:.2f} mm"


ReadCase = Callable[[str, Size], Case]


@dataclass
class Identified:
    """What `identify` found, without factors of joints.

    vector: of the scalars, as searched. loss: its, over whole trials. spent: by the whole stage, intervals included.
    undetermined: names of what the data leave open. watch: when which loss over whole trials was reached.
    """

    vector: np.ndarray
    loss: float
    spent: Spent
    undetermined: list[str]
    watch: Rival


@dataclass
class WatchedFit(Fit):
    """Notes in `watch` when each loss over all `frames` was known; those of the rough search count for nothing."""

    watch: Rival = field(default_factory=Rival)
    frames: int = 0

    def problem(self, model: mujoco.MjModel, experiments: list[Experiment], step_factor: float = 1.0) -> Problem:
        problem = super().problem(model, experiments, step_factor)
        if sum(e.frames for e in experiments) == self.frames and step_factor == 1:
            residuals = problem.residuals

            def noted(vectors: np.ndarray, near: np.ndarray | None = None, rough: bool = False) -> list[np.ndarray]:
                blocks = residuals(vectors, near, rough)
                self.watch.note(vectors, np.sum([loss_of(block) for block in blocks], axis=0))
                return blocks

            problem.residuals = noted
        return problem


def identified(case: Case) -> Identified:
    fit = WatchedFit(**vars(replace(case.fit, per_joint=())), frames=sum(e.frames for e in case.experiments))
    with contextlib.redirect_stdout(io.StringIO()):
        result = identify("", case.model, case.experiments, fit)
    spent = fit.watch.clock.read()
    vector = np.array([PARAMETERS[name].coordinate(value) for name, value in result.values.items()])
    vague = undetermined(result, case.fit.parameters)
    return Identified(vector, float(case.problem().losses(vector[None])[0]), spent, vague, fit.watch)


def read_case(stage: str, size: Size) -> Case:
    """The stage's problem of the demo session, as `stages/<stage>.py` sets it up, with fewer trials.

    Raises:
        InputError: if the pipeline has not run so far.
    """
    require_demo(STAGES[stage])
    config = load_config(import_module(f"stages.{stage}").Config, stage)
    model = read_spec(STAGES[stage]).compile()
    model, experiments, fit = set_up(config, read_reported(config), model)
    chosen = [e.shortened(size.frames) for e in experiments if e.kind in config.experiments]
    return Case(
        model=model,
        experiments=spread([e for e in chosen if e.split == IDENTIFY], size.trials),
        unseen=[e for e in chosen if e.split == VALIDATE],
        fit=fit,
    )


def require_demo(model: Path) -> None:
    """Refuse to begin without the demo session's trials and the `model` to begin with."""
    for path in (model, TRIALS / "trials.parquet"):
        if not path.is_file():
            raise InputError(f"{path}: no such file, expected what `make demo` writes; run it first")


def spread(items: list, count: int) -> list:
    """At most `count` of `items`, evenly spread from first to last."""
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, count).round().astype(int))]
