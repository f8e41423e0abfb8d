"""What every choice of model and method is worth: a Markdown table of errors on trials that no fit saw.

    python -m benchmarks.choices [--quick] [--only NAME ...] > choices.md

Needs the trials and the CAD model of the demo session (`make demo`). Each row changes one thing in the settings of
params.yaml and conf/, runs the three stages one after the other, each on what the one before it found, and scores the
last model on the `validate` split. CPU time is that of all threads in a stage's search, without reading trials.
Progress goes to stderr.
"""

import argparse
import contextlib
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

import mujoco
from omegaconf import OmegaConf

from benchmarks.identification.case import STAGES, bounds_of, require_demo, spread, weights_of
from benchmarks.identification.timing import Stopwatch
from trunkline.config import load_config
from trunkline.errors import InputError
from trunkline.identification.evaluation import replay, scores
from trunkline.identification.experiment import Experiment
from trunkline.identification.identify import Identification, identify
from trunkline.identification.run import CAD_MODEL, method_of, read_experiments, read_spec, undetermined
from trunkline.identification.settings import (
    DifferentialEvolutionSettings,
    IdentificationSettings,
    LeastSquaresSettings,
    Range,
)

LEAST_SQUARES = Path("conf/shared/optimizer/least_squares.yaml")
JOINT_FRICTION = Range(low=1e-4, high=0.1)  # rad of a joint's own spring
COMMAND_DELAY = 0.02  # s
KINDS = ("release", "curl")

Change = Callable[[str, IdentificationSettings], IdentificationSettings]  # of a stage's settings, by its name


def committed(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return config


def without(name: str, stage: str, config: IdentificationSettings) -> IdentificationSettings:
    """A parameter that stays what it is in the CAD model."""
    return replace(config, parameters={key: span for key, span in config.parameters.items() if key != name})


def with_joint_friction(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    if stage != "identify_damping":
        return config
    return replace(config, parameters=config.parameters | {"joint_friction": JOINT_FRICTION})


def with_command_delay(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, command_delay=COMMAND_DELAY)


def with_distances(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, loss=replace(config.loss, kind="distances"))


def with_least_squares(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, optimizer=LeastSquaresSettings(**OmegaConf.to_container(OmegaConf.load(LEAST_SQUARES))))


def with_factors_of_damping(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, per_joint=["damping"]) if stage == "identify_damping" else config


def without_factors(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    return replace(config, per_joint=[])


CHOICES: dict[str, tuple[str, Change]] = {
    "committed": ("as committed", committed),
    "no-hardening": ("without hardening", partial(without, "hardening")),
    "no-creep": ("friction_time at its CAD value", partial(without, "friction_time")),
    "joint-friction": ("with joint_friction", with_joint_friction),
    "delay": (f"command_delay {COMMAND_DELAY:g} s", with_command_delay),
    "distances": ("loss: distances", with_distances),
    "least-squares": ("optimizer: least_squares", with_least_squares),
    "joint-damping": ("per_joint damping too", with_factors_of_damping),
    "no-factors": ("per_joint none", without_factors),
}


def quick(stage: str, config: IdentificationSettings) -> IdentificationSettings:
    """A small size that shows that it runs; its numbers say nothing."""
    optimizer = config.optimizer
    if isinstance(optimizer, DifferentialEvolutionSettings):
        optimizer = replace(optimizer, generations=3)
    else:
        optimizer = replace(optimizer, starts=2, descents=1, iterations=2)
    return replace(
        config,
        frames=min(config.frames, 60),
        optimizer=optimizer,
        polish=replace(config.polish, iterations=2),
        fine=LeastSquaresSettings(method="least_squares", starts=0, descents=1, iterations=2, tolerance=0.1),
    )


def chain(settings: dict[str, IdentificationSettings], trials: int | None) -> tuple[mujoco.MjModel, list, list[float]]:
    """The three stages in order.

    Args:
        trials: of each kind and split, at most; None for all.

    Returns:
        The last model, the trials of the last stage with their segments, and CPU seconds by stage.
    """
    model, spent = read_spec(CAD_MODEL).compile(), []
    for stage, config in settings.items():
        with contextlib.redirect_stdout(sys.stderr):
            experiments, segments = read_experiments(config, model)
            experiments = fewer(experiments, trials) if trials else experiments
            clock = Stopwatch()
            result = found(stage, config, model, experiments, segments)
            spent.append(clock.read().cpu)
            for name in open_or_at_bound(result, config):
                print(f"{stage}: {name}")
        model = result.models["identified"]
    return model, [experiments, segments], spent


def found(stage: str, config, model, experiments: list[Experiment], segments) -> Identification:
    fitted = [e for e in experiments if e.kind in config.experiments]
    return identify(
        stage, model, fitted, segments, bounds_of(config), tuple(config.per_joint), config.loss.kind,
        weights_of(config), method_of(config),
    )  # fmt: skip


def open_or_at_bound(result: Identification, config: IdentificationSettings) -> list[str]:
    vague = [n for n, is_vague in zip(result.values, undetermined(result, bounds_of(config)), strict=True) if is_vague]
    return [f"{n} ended on a bound" for n in result.at_bound] + [f"{n} is not determined" for n in vague]


def fewer(experiments: list[Experiment], trials: int) -> list[Experiment]:
    """At most `trials` of each kind and split."""
    groups: dict[tuple[str, str], list[Experiment]] = {}
    for experiment in experiments:
        groups.setdefault((experiment.kind, experiment.split), []).append(experiment)
    return [experiment for group in groups.values() for experiment in spread(group, trials)]


def row(title: str, change: Change, is_quick: bool) -> str:
    """One line of the table."""
    settings = {}
    for stage in STAGES:
        config = load_config(import_module(f"stages.{stage}").Config, stage)
        settings[stage] = change(stage, quick(stage, config) if is_quick else config)
    model, (experiments, segments), spent = chain(settings, 2 if is_quick else None)
    unseen = [e for e in experiments if e.split == "validate"]
    last = settings["identify_control"]
    table = scores(replay(model, unseen, segments), unseen, last.loss.kind, weights_of(last))["validate"]
    by_kind = [table["by_experiment"][kind] for kind in KINDS]
    errors = [f"{scored[key]:.3f}" for key in ("e_internal_mm", "e_position_mm") for scored in by_kind]
    return "| " + " | ".join([title, *errors, *(f"{seconds:.0f}" for seconds in spent)]) + " |"


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.choices", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few trials, frames and iterations: only whether it runs")
    parser.add_argument("--only", nargs="+", choices=CHOICES, default=list(CHOICES), help="some of the rows")
    arguments = parser.parse_args()
    heads = [f"{error}, {kind}s (mm)" for error in ("E_internal", "position") for kind in KINDS]
    heads += [f"CPU {stage.removeprefix('identify_')} (s)" for stage in STAGES]
    try:
        require_demo(CAD_MODEL)
        print("| choice | " + " | ".join(heads) + " |\n|---|" + "---:|" * len(heads), flush=True)
        for name in arguments.only:
            print(row(*CHOICES[name], arguments.quick), flush=True)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
