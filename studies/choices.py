"""What every choice of model and method is worth: a Markdown table of errors on trials that no fit saw.

    python -m studies.choices [--quick] [--only NAME ...]

Needs the trials and the CAD model of the demo session (`make demo`). Each row changes one thing in the settings of
params.yaml and conf/, runs the three stages one after the other, each on what the one before it found, and scores the
last model on the `validate` split. CPU time is that of all threads in a stage's search, without reading trials. What
physics is worth: `python -m studies.effects`.

A row is kept in docs/results/choices.csv as soon as it is done; stopped, the study goes on from there. The table is
kept once it is whole. Progress goes to stderr.
"""

import argparse
import contextlib
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path

import mujoco

from studies.demo_session import STAGES, require_demo, spread
from studies.rows import Rows, digest
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import Identification, identify
from trunkline.identification.fit.optimizers import DifferentialEvolution, LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import set_up
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model_files import read_spec
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import CAD_MODEL, TRIALS, doubts, read_reported
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.recordings.trials.trial import Trial
from trunkline.settings import read_yaml
from upkeep.results import recorded

LEAST_SQUARES = Path("conf/shared/optimizer/least_squares.yaml")
JOINT_FRICTION = Bounds(low=1e-4, high=0.1)  # rad of a joint's own spring
MOUNT = Bounds(low=-0.1, high=0.1)  # rad by which the mount is turned in the tracked base frame
COMMAND_DELAY = 0.02  # s
KINDS = ("release", "curl")
ERRORS = {"E_internal": "e_internal_mm", "position": "e_position_mm", "tip": "e_tip_mm"}
QUICK_TRIALS = 2  # of each kind and split


@dataclass
class Choice:
    """A row: `settings` of a stage, by its name, and the trials as they are changed for it."""

    title: str
    settings: Callable[[str, IdentificationSettings], IdentificationSettings] = lambda stage, config: config
    trials: Callable[[list[Trial]], list[Trial]] = lambda trials: trials


def with_parameter(
    name: str, span: Bounds, in_stage: str, stage: str, config: IdentificationSettings
) -> IdentificationSettings:
    return replace(config, parameters=config.parameters | {name: span}) if stage == in_stage else config


def with_twisted_mount(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    """Only the tendons' directions tell the twist."""
    return with_parameter("mount_twist", MOUNT, "identify_control", stage, config)


def with_measured_markers(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, markers="measured") if stage == "identify_stiffness" else config


def with_command_delay(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, command_delay=COMMAND_DELAY)


def in_motion(trials: list[Trial]) -> list[Trial]:
    """With the velocity that the arm has in the frame of its start pose, in place of none."""
    return [replace(trial, in_motion=not is_static(trial.experiment)) for trial in trials]


def with_distances(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, loss=replace(config.loss, kind="distances"))


def variant(schema: type, file: Path):
    """A file of conf/shared/ as settings of type `schema`."""
    return schema(**{str(key): value for key, value in read_yaml(file).items()})


def with_least_squares(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, optimizer=variant(LeastSquares, LEAST_SQUARES))


def with_factors_of_damping(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, per_joint=["damping"]) if stage == "identify_damping" else config


CHOICES: dict[str, Choice] = {
    "committed": Choice("as committed"),
    "joint-friction": Choice(
        "with joint_friction", partial(with_parameter, "joint_friction", JOINT_FRICTION, "identify_damping")
    ),
    "delay": Choice(f"command_delay {COMMAND_DELAY:g} s", with_command_delay),
    "mount": Choice("with mount_twist", with_twisted_mount),
    "markers": Choice("markers: measured", with_measured_markers),
    "velocity": Choice("started with measured velocities", trials=in_motion),
    "distances": Choice("loss: distances", with_distances),
    "least-squares": Choice("optimizer: least_squares", with_least_squares),
    "joint-damping": Choice("per_joint damping too", with_factors_of_damping),
}


def quick(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    """A small size that shows that it runs; its numbers say nothing."""
    optimizer = config.optimizer
    if isinstance(optimizer, DifferentialEvolution):
        optimizer = replace(optimizer, generations=3)
    else:
        optimizer = replace(optimizer, starts=2, descents=1, iterations=2)
    return replace(
        config,
        frames=min(config.frames, 60),
        optimizer=optimizer,
        polish=replace(config.polish, iterations=2),
        fine=LeastSquares(starts=0, descents=1, iterations=2, tolerance=0.1),
    )


@dataclass
class Chain:
    """What stages end with: the last model, the last stage's trials, fit and result, CPU seconds by stage."""

    model: mujoco.MjModel
    experiments: list[Experiment]
    fit: Fit
    spent: list[float]
    result: Identification


def chain(choice: Choice, is_quick: bool, known: dict[str, Chain]) -> Chain:
    """The three stages in order, each on what the one before it found.

    Args:
        known: chains so far by all that they depend on; a row that changes a later stage alone begins with them.
    """
    model, spent, key = read_spec(CAD_MODEL).compile(), [], ""
    for stage in STAGES:
        config = choice.settings(stage, load_config(import_module(f"stages.{stage}").Config, stage))
        config = quick(stage, config) if is_quick else config
        trials = choice.trials(read_reported(config))
        key += f"{stage} {config} {[trial.in_motion for trial in trials]}\n"
        if key not in known:
            with contextlib.redirect_stdout(sys.stderr):
                known[key] = next_link(model, spent, stage, config, trials, is_quick)
        model, spent = known[key].model, known[key].spent
    return known[key]


def next_link(
    model: mujoco.MjModel,
    before: list[float],
    stage: str,
    config: IdentificationSettings,
    trials: list[Trial],
    is_quick: bool,
) -> Chain:
    """One stage more, from `model`; `before`: CPU seconds of the stages that led to it."""
    model, experiments, fit = set_up(config, trials, model)
    experiments = fewer(experiments, QUICK_TRIALS) if is_quick else experiments
    begun = time.process_time()
    result = identify(stage, model, [e for e in experiments if e.kind in config.experiments], fit)
    spent = [*before, time.process_time() - begun]
    for line in [*doubts(result, fit.parameters), result.values]:
        print(f"{stage}: {line}")
    return Chain(result.models["identified"], experiments, fit, spent, result)


def fewer(experiments: list[Experiment], trials: int) -> list[Experiment]:
    """At most `trials` of each kind and split."""
    groups: dict[tuple[str, str], list[Experiment]] = {}
    for experiment in experiments:
        groups.setdefault((experiment.kind, experiment.split), []).append(experiment)
    return [experiment for group in groups.values() for experiment in spread(group, trials)]


def cells(choice: Choice, is_quick: bool, known: dict[str, Chain]) -> dict[str, float]:
    """Of a row, by their heads."""
    found = chain(choice, is_quick, known)
    unseen = [e for e in found.experiments if e.split == VALIDATE]
    replayed = replay(found.model, unseen, found.fit.markers)
    table = scores(replayed, unseen, found.fit.loss, found.fit.weights)[VALIDATE]["by_experiment"]
    errors = {f"{error}, {kind}s (mm)": table[kind][key] for error, key in ERRORS.items() for kind in KINDS}
    stages = [stage.removeprefix("identify_") for stage in STAGES]
    return errors | {f"CPU {stage} (s)": seconds for stage, seconds in zip(stages, found.spent, strict=True)}


def table_of(rows: dict[str, dict]) -> str:
    """Of the rows, in the order of CHOICES."""
    shown = {name: rows[name] for name in CHOICES if name in rows}
    heads = [head for head in next(iter(shown.values())) if head.endswith(")")]
    lines = [f"| choice | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    for name, row in shown.items():
        values = [f"{row[head]:.0f}" if head.endswith("(s)") else f"{row[head]:.3f}" for head in heads]
        lines.append(f"| {CHOICES[name].title} | {' | '.join(values)} |")
    return "\n".join(lines)


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.choices", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few trials, frames and iterations: only whether it runs")
    parser.add_argument("--only", nargs="+", choices=CHOICES, default=list(CHOICES), help="some of the rows")
    arguments = parser.parse_args()
    require_demo(CAD_MODEL)
    known: dict[str, Chain] = {}
    if arguments.quick:
        print(table_of({name: cells(CHOICES[name], True, known) for name in arguments.only}))
        return 0
    committed = [load_config(import_module(f"stages.{stage}").Config, stage) for stage in STAGES]
    table = Rows("choices", digest(committed, CAD_MODEL, TRIALS), "name")
    is_whole = {*table.read(), *arguments.only} >= set(CHOICES)
    with recorded("choices", keep=is_whole, origin=table.origin):
        for name in [name for name in arguments.only if name not in table.read()]:
            table.add(name, **cells(CHOICES[name], False, known))
        rows = table.read()
        print(table_of(rows))
        if line := table.attempts():
            print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
