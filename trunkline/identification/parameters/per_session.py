"""What each of several sessions of one arm has for itself, such as how the mount sits in its tracked base.

The model is the first session's. What another has is a number in the MJCF, called `parameter@session`.
"""

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import APART, PARAMETERS, candidate_fields, set_fields
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial, sessions_of


def model_in(session: str, model: mujoco.MjModel) -> mujoco.MjModel:
    """The arm as it was in a session: `model` itself, or a copy with the numbers that it holds for that session."""
    values = {}
    for index in range(model.nnumeric):
        name, apart, owner = model.numeric(index).name.partition(APART)
        if apart and owner == session:
            values[name] = np.array([model.numeric_data[model.numeric_adr[index]]])
    if not values:
        return model
    own = model.__copy__()
    set_fields(own, candidate_fields(model, values))
    return own


def values_in(session: str, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Of parameters' values those that hold in a session, by the shared names."""
    return {name: values.get(f"{name}{APART}{session}", value) for name, value in values.items() if APART not in name}


def other_sessions(trials: list[Trial]) -> list[str]:
    """All but the first, in the order of the trials."""
    return sessions_of(trials)[1:]


def names_apart(parameters: list[str], per_session: list[str], sessions: list[str]) -> dict[str, str]:
    """Names of what `sessions` have for themselves of a stage's `parameters`, with the shared ones."""
    own = [name for name in parameters if name in per_session]
    return {f"{name}{APART}{session}": name for session in sessions for name in own}


def names_in(model: mujoco.MjModel, parameters) -> dict[str, str]:
    """Names that a model holds of what sessions have for themselves of `parameters`, with the shared ones."""
    held = [model.numeric(index).name for index in range(model.nnumeric)]
    return {name: name.partition(APART)[0] for name in held if APART in name and name.partition(APART)[0] in parameters}


def make_room(spec: mujoco.MjSpec, names: dict[str, str]) -> None:
    """Give the MJCF a number for each of `names_apart` that it has not got: first what the model itself has."""
    model = spec.compile()
    for name, shared in names.items():
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name) < 0:
            spec.add_numeric(name=name, size=1, data=[PARAMETERS[shared].read(model)])


def untold_apart(names: dict[str, str], trials: list[Trial], kinds: list[str]) -> list[str]:
    """Which sessions of `trials` have something for themselves, of which `names_apart` has the `names`, that none of
    their own trials to identify from tells, a line each.

    Args:
        kinds: of experiment, to identify from.
    """
    told = {trial.session for trial in trials if trial.split == IDENTIFY and trial.experiment in kinds}
    return [
        f"per_session: {shared}: found no {' or '.join(kinds)} of the session {session} with split identify to tell "
        f"it, expected one, or {shared} taken out of `per_session`"
        for shared in dict.fromkeys(names.values())
        for session in sessions_of(trials)
        if session not in told
    ]
