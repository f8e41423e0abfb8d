"""From settings, trials and a model to what a stage of identification works on."""


import mujoco

from trunkline.errors import InputError
from trunkline.identification.experiment import Experiment, prepare
from trunkline.identification.fit import Fit
from trunkline.identification.markers import with_measured_markers
from trunkline.identification.parameters import PARAMETERS
from trunkline.identification.resting import resting_shape
from trunkline.identification.settings import IdentificationSettings
from trunkline.trials.splits import IDENTIFY
from trunkline.trials.trial import Trial


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


def fit_of(config: IdentificationSettings, segments: tuple[str, ...]) -> Fit:
    """What a stage's settings ask for, with the shape at rest that the model has."""
    return Fit(
        segments, config.parameters, tuple(config.per_joint), config.loss.kind, weights=config.loss, method=config
    )


def check_parameters(stage: str, config: IdentificationSettings, model: mujoco.MjModel) -> None:
    """Refuse parameters of tendons, motors and joints' elements that the arm has not got."""
    for name in config.parameters:
        part = PARAMETERS[name].part
        if PARAMETERS[name].belongs_to(model):
            continue
        if part == "tendons":
            found = "found it for an arm without tendons, expected parameters of joints alone"
            end = "; such an arm's pipeline ends with `dvc repro identify_damping`"
        elif part == "dead time":
            found, end = "found it for motors without, expected build_mjcf.actuation.dead_time of more than 0", ""
        elif part == "holes":
            found, end = "found it for cables that do not rub, expected build_mjcf.holes: rubbing", ""
        else:
            found, end = f"found it for joints without {part}, expected build_mjcf.joints with one", ""
        raise InputError(f"params.yaml: {stage}.parameters.{name}: {found}{end}")


def check_folds(stage: str, folds: int, fitted: list[Experiment]) -> None:
    """Refuse to leave out more groups of trials than there are trials to identify from."""
    trials = sum(e.split == IDENTIFY for e in fitted)
    if folds > trials:
        raise InputError(f"{stage}.cross_validation_folds: found {folds}, expected at most {trials}, one a trial")
