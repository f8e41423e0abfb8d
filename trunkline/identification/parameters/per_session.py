"""Per-session parameters: those that each of several sessions of one arm has for itself, such as the mount's tilt.

The model is the first session's. What another has is a number in the MJCF, called `parameter@session`.
"""

from collections.abc import Container

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import SESSION_MARK, candidate_fields, parameter_named, set_fields
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial, sessions_of


def model_in(session: str, model: mujoco.MjModel) -> mujoco.MjModel:
    """The arm as it was in a session: `model` itself, or a copy with the numbers that it holds for that session."""
    values = {}
    for index in range(model.nnumeric):
        name, apart, owner = model.numeric(index).name.partition(SESSION_MARK)
        if apart and owner == session:
            values[name] = np.array([model.numeric_data[model.numeric_adr[index]]])
    if not values:
        return model
    copy = model.__copy__()
    set_fields(copy, candidate_fields(model, values))
    return copy


def values_in(session: str, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Of parameters' values those that hold in a session, by the shared names."""
    shared = {name: value for name, value in values.items() if SESSION_MARK not in name}
    return {name: values.get(f"{name}{SESSION_MARK}{session}", value) for name, value in shared.items()}


def per_session_names(parameters: list[str], per_session: list[str], sessions: list[str]) -> dict[str, str]:
    """Names of the per-session parameters of `sessions` among a stage's `parameters`, with the shared names."""
    selected = [name for name in parameters if name in per_session]
    return {f"{name}{SESSION_MARK}{session}": name for session in sessions for name in selected}


def names_in(model: mujoco.MjModel, parameters: Container[str] | None = None) -> dict[str, str]:
    """Names of the per-session parameters in a model, of those alone that belong to `parameters`, with the shared
    names."""
    numbers = [model.numeric(index).name for index in range(model.nnumeric)]
    shared = {name: name.partition(SESSION_MARK)[0] for name in numbers if SESSION_MARK in name}
    return {name: parameter for name, parameter in shared.items() if parameters is None or parameter in parameters}


def make_room(spec: mujoco.MjSpec, names: dict[str, str]) -> None:
    """Give the MJCF a number for each of `per_session_names` that it has not got: first what the model itself has."""
    model = spec.compile()
    for name, shared in names.items():
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name) < 0:
            spec.add_numeric(name=name, size=1, data=[parameter_named(shared).read(model)])


def add_sessions(
    spec: mujoco.MjSpec, parameters: list[str], per_session: list[str], kinds: list[str], trials: list[Trial]
) -> list[str]:
    """As `make_room`, for all sessions of `trials` but the first, whose model it is.

    Args:
        parameters: of a stage. per_session: those that each session has for itself. kinds: of experiment, to identify
            from.

    Returns:
        A line for each session whose own trials to identify from do not determine one of its per-session parameters.
    """
    names = per_session_names(parameters, per_session, sessions_of(trials)[1:])
    if names:
        make_room(spec, names)
    identified = {trial.session for trial in trials if trial.split == IDENTIFY and trial.experiment in kinds}
    return [
        f"per_session: {shared}: found no {' or '.join(kinds)} of the session {session} with split identify to tell "
        f"it, expected one, or {shared} taken out of `per_session`"
        for shared in dict.fromkeys(names.values())
        for session in sessions_of(trials)
        if session not in identified
    ]
