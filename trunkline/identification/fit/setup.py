"""From settings, trials and a model to what a stage of identification works on."""

from dataclasses import replace

import mujoco

from trunkline.errors import InputError
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.parameters.parameters import EVERY, MASS, names_of, parameter_named, parameter_of
from trunkline.identification.parameters.per_session import add_sessions, names_in
from trunkline.identification.simulate.experiment import Experiment, prepare
from trunkline.identification.simulate.markers import with_measured_markers
from trunkline.identification.simulate.resting import resting_shape
from trunkline.model.arm_model import CAPSTAN_FRICTION
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial, sessions_of

EVERY_ANGLE = f"tendon_angle{EVERY}"


def with_sessions(
    stage: str, config: IdentificationSettings, spec: mujoco.MjSpec, trials: list[Trial]
) -> mujoco.MjModel:
    """The model with room for what each session of `trials` has for itself, which `spec` gets too.

    Raises:
        InputError: the trials do not determine a parameter.
    """
    lines = add_sessions(spec, list(config.parameters), config.per_session, config.experiments, trials)
    for line in lines + unidentifiable_mass(config, trials):
        raise InputError(f"{stage}.{line}")
    return spec.compile()


def set_up(
    config: IdentificationSettings, trials: list[Trial], model: mujoco.MjModel
) -> tuple[mujoco.MjModel, list[Experiment], Fit]:
    """What `identify` works on: the model to begin with, its markers where they were measured if that is asked for,
    an experiment for each trial, and what to fit to those of the kinds to identify from.

    The friction of cables is not among it where no log shows how its arm came to rest, and none moves: then all rest in
    mid-band.
    """
    if config.markers == "measured":
        model = with_measured_markers(model, [t for t in trials if t.experiment in config.experiments])
    experiments = [prepare(trial, model, config.frames, config.command_delay) for trial in trials]
    fit = fit_of(config, trials[0].markers)
    names = names_in(model, config.parameters)
    fit.parameters = fit.parameters | {name: config.parameters[shared] for name, shared in names.items()}
    fitted = [e for e in experiments if e.kind in config.experiments]
    if not any(e.approach or not is_static(e.kind) for e in fitted):
        fit.parameters = {name: span for name, span in fit.parameters.items() if name != CAPSTAN_FRICTION}
    if config.rest_shape == "measured" and (others := sessions_of(trials)[1:]):
        expected = "expected one, or rest_shape: unchanged"
        raise InputError(f"rest_shape: measured: found {1 + len(others)} sessions, {expected}")
    if config.rest_shape == "measured":
        fit.rest = resting_shape(model, fitted, fit.markers)
    return model, experiments, fit


def fit_of(config: IdentificationSettings, markers: tuple[str, ...]) -> Fit:
    """What a stage's settings ask for, with the shape at rest that the model has."""
    return Fit(
        markers, config.parameters, tuple(config.per_joint), config.loss.kind, weights=config.loss, method=config,
        considered=config.considered,
    )  # fmt: skip


def with_every(config: IdentificationSettings, model: mujoco.MjModel) -> IdentificationSettings:
    """The settings with a parameter for each of the arm's tendons or sections where a name stands for all of them. The
    range of an angle is then about where the arm has each."""
    spans: dict[str, Bounds] = {}
    for name, span in config.parameters.items():
        for parameter in names_of(name, model) or [name]:
            has_middle = name == EVERY_ANGLE and parameter != name
            middle = parameter_named(parameter).read(model) if has_middle else 0.0
            spans[parameter] = Bounds(middle + span.low, middle + span.high)
    return replace(config, parameters=spans)


def unidentifiable_mass(config: IdentificationSettings, trials: list[Trial]) -> list[str]:
    """A line if the arm's mass is to be identified and no trial carries a load: forces scale with masses, so that only
    what was weighed tells their size."""
    fitted = [trial for trial in trials if trial.split == IDENTIFY and trial.experiment in config.experiments]
    if MASS not in config.parameters or any(trial.load for trial in fitted):
        return []
    reason = f"found no {' or '.join(config.experiments)} with split identify that carries a load"
    return [f"parameters.{MASS}: {reason}, expected one with its `load`, kg, in session.yaml, or no {MASS}"]


def check_parameters(stage: str, config: IdentificationSettings, model: mujoco.MjModel) -> None:
    """Refuse parameters of what the arm has not got: tendons, motors, joints' elements, units of some length."""
    for name in config.parameters:
        try:
            parameter_of(model, name).read(model)
        except InputError as error:
            raise InputError(f"params.yaml: {stage}.parameters.{name}: {error}") from error
