"""From settings and files to what a stage of identification works on: model, trials, and what to fit."""

from pathlib import Path

import mujoco

from trunkline.arm.parameters import PARAMETERS
from trunkline.errors import InputError
from trunkline.identification.experiment import Experiment, prepare
from trunkline.identification.identify import Fit, Method
from trunkline.identification.loss import LossWeights
from trunkline.identification.markers import with_measured_markers
from trunkline.identification.problem import Bounds
from trunkline.identification.resting import resting_shape
from trunkline.identification.search import DifferentialEvolution, LeastSquares, Optimizer
from trunkline.identification.settings import IdentificationSettings
from trunkline.trials.trial import Trial, read_trials

TRIALS = Path("data/processed/filter")


def read_spec(path: Path) -> mujoco.MjSpec:
    """The MJCF at `path`.

    Raises:
        InputError: if there is none, or MuJoCo refuses it.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the model of an earlier stage")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise InputError(f"{path}: not a model that MuJoCo reads: {str(error).splitlines()[0]}") from error


def set_up(
    config: IdentificationSettings, trials: list[Trial], model: mujoco.MjModel
) -> tuple[mujoco.MjModel, list[Experiment], Fit]:
    """What `identify` works on: the model to begin with, its markers where they were measured if that is asked for,
    an experiment for each trial, and what to fit to those of the kinds to identify from."""
    if config.markers == "measured":
        model = with_measured_markers(model, [t for t in trials if t.experiment in config.experiments])
    experiments = [prepare(trial, model, config.frames, config.command_delay) for trial in trials]
    fit = fit_of(config, trials[0].segments)
    if config.rest_shape == "measured":
        fitted = [e for e in experiments if e.kind in config.experiments]
        fit.rest = resting_shape(model, fitted, fit.segments)
    return model, experiments, fit


def read_reported(config: IdentificationSettings) -> list[Trial]:
    """The session's trials of the reported kinds, which all track the same segments."""
    trials = [t for t in read_trials(TRIALS) if t.experiment in config.reported]
    for kind in config.experiments:
        for split in ("identify", "validate"):
            if not any(t.experiment == kind and t.split == split for t in trials):
                raise InputError(f"session.yaml: found no {kind} trial with split {split}, expected at least one")
    segments = trials[0].segments
    for trial in trials:
        if trial.segments != segments:
            raise InputError(
                f"trial {trial.name}: found {len(trial.segments)} segments, expected the {len(segments)} of "
                f"{trials[0].name}"
            )
    return trials


def fit_of(config: IdentificationSettings, segments: tuple[str, ...]) -> Fit:
    """What a stage's settings ask for, with the shape at rest that the model has."""
    return Fit(
        segments=segments,
        parameters={name: Bounds(r.low, r.high) for name, r in config.parameters.items()},
        per_joint=tuple(config.per_joint),
        loss=config.loss.kind,
        weights=LossWeights(**{key: value for key, value in vars(config.loss).items() if key != "kind"}),
        method=_method(config),
    )


def _method(config: IdentificationSettings) -> Method:
    return Method(
        optimizer=_optimizer(config.optimizer),
        rough_step_factor=config.rough.step_factor,
        rough_frames=config.rough.frames,
        rough_trials=config.rough.trials,
        polish_iterations=config.polish.iterations,
        polish_tolerance=config.polish.tolerance,
        fine=_optimizer(config.fine),
        per_joint_range=config.per_joint_range,
        per_joint_deviation=config.per_joint_deviation,
        seed=config.seed,
    )


def _optimizer(config) -> Optimizer:
    kind = {"least_squares": LeastSquares, "differential_evolution": DifferentialEvolution}[config.method]
    return kind(**{key: value for key, value in vars(config).items() if key != "method"})


def check_parameters(stage: str, config: IdentificationSettings, model: mujoco.MjModel) -> None:
    """Refuse parameters of tendons and motors that the arm has not got."""
    for name in config.parameters:
        if not model.ntendon and PARAMETERS[name].fields[0].startswith(("tendon_", "actuator_")):
            found = "found it for an arm without tendons, expected parameters of joints alone"
            raise InputError(f"params.yaml: {stage}.parameters.{name}: {found}")


def check_folds(stage: str, folds: int, fitted: list[Experiment]) -> None:
    """Refuse to leave out more groups of trials than there are trials to identify from."""
    trials = sum(e.split == "identify" for e in fitted)
    if folds > trials:
        raise InputError(f"{stage}.cross_validation_folds: found {folds}, expected at most {trials}, one a trial")
