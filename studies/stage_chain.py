"""The stages of identification, one after the other, each on what the one before it found."""

import contextlib
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import mujoco

from trunkline.errors import InputError
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import Identification, identify
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import set_up
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import TRIALS, doubts, read_reported
from trunkline.recordings.trials.trial import Trial


@dataclass
class StageChain:
    """What stages end with: the last model, the last stage's trials, fit and result, CPU seconds by stage."""

    model: mujoco.MjModel
    experiments: list[Experiment]
    fit: Fit
    spent: list[float]
    result: Identification


def require_demo(model: Path) -> None:
    """Refuse to begin without the demo session's trials and the `model` to begin with."""
    for path in (model, TRIALS / "trials.parquet"):
        if not path.is_file():
            raise InputError(f"{path}: no such file, expected what `make demo` writes; run it first")


def committed(stage: str) -> IdentificationSettings:
    """The committed settings of a stage."""
    return load_config(import_module(f"stages.{stage}").Config, stage)


def run_stages(
    begin: tuple[str, mujoco.MjModel],
    settings: Callable[[str], IdentificationSettings],
    chains: dict[str, StageChain],
    change: Callable[[list[Trial]], list[Trial]] = lambda trials: trials,
    last: str = STAGES[-1],
) -> StageChain:
    """The stages up to `last`.

    Args:
        begin: what the first model is, and that model. settings: of a stage, by its name. change: of the trials.
        chains: those so far, by all that they depend on; a row that changes a later stage alone begins with them.
    """
    (key, model), spent = begin, []
    for stage in STAGES[: STAGES.index(last) + 1]:
        config = settings(stage)
        trials = change(read_reported(config))
        key += f"{stage} {config} {[trial.in_motion for trial in trials]}\n"
        if key not in chains:
            with contextlib.redirect_stdout(sys.stderr):
                chains[key] = _run_stage(stage, model, spent, config, trials)
        model, spent = chains[key].model, chains[key].spent
    return chains[key]


def _run_stage(
    stage: str, model: mujoco.MjModel, before: list[float], config: IdentificationSettings, trials: list[Trial]
) -> StageChain:
    """One stage more, from `model`; `before`: CPU seconds of the stages that led to it."""
    model, experiments, fit = set_up(config, trials, model)
    begun = time.process_time()
    result = identify(stage, model, [e for e in experiments if e.kind in config.experiments], fit)
    spent = [*before, time.process_time() - begun]
    for line in [*doubts(result, fit.parameters), result.values]:
        print(f"{stage}: {line}")
    return StageChain(result.models["identified"], experiments, fit, spent, result)
