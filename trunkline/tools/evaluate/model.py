"""The model that is evaluated: what it must have, and what the stage that wrote it says of it."""

import json
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import NAMES, SESSION_MARK
from trunkline.identification.parameters.per_session import names_in
from trunkline.identification.results.scoring import fingerprint
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import settings_of
from trunkline.pipeline.inputs import read_spec
from trunkline.recordings.trials.trial import Trial, sessions_of

TABLE = "parameters.json"
MOST_TURN = np.radians(30)  # of the mount in the tracked base, as it may be identified; more is another frame


@dataclass
class Written:
    """What is known of a model beside its MJCF. frames: compared of each trial, at most. command_delay: s.

    fitted_to: digests of the trials that it was fitted to, by name; empty where nothing is known.
    """

    frames: int
    command_delay: float
    fitted_to: dict[str, str]

    def saw(self, trial: Trial) -> bool:
        """Whether it was fitted to this very recording, filtered as it is here."""
        return self.fitted_to.get(trial.name) == fingerprint(trial)

    def session_of(self, trials: list[Trial]) -> str:
        """Which of the sessions that it was fitted to `trials` without a session's name are of: as it saw one of them.
        Empty where it saw none, or was fitted to one session."""
        for trial in trials:
            digest = fingerprint(trial)
            for name, fitted in self.fitted_to.items():
                if fitted == digest and name != trial.name and name.endswith(f"/{trial.name}"):
                    return name.removesuffix(f"/{trial.name}")
        return ""

    def namesakes(self, model: mujoco.MjModel, trials: list[Trial]) -> list[str]:
        """Sessions of `trials` of whose names `model` has numbers, though it was fitted to none of their trials."""
        named = {name.partition(SESSION_MARK)[2] for name in names_in(model, NAMES)}
        fitted_sessions = {trial.session for trial in trials if self.saw(trial)}
        return [session for session in sessions_of(trials) if self.fitted_to and session in named - fitted_sessions]


def written_beside(path: Path, root: Path) -> Written:
    """From parameters.json beside the model, and of what it was fitted to from those of the stages before too; without
    one, frames and delay from the settings in `root`."""
    folder, before = path.parent, ()
    if not (folder / TABLE).is_file():
        settings = settings_of("identify_damping", root)
        return Written(settings.frames, settings.command_delay, {})
    if folder.name in STAGES:
        before = STAGES[: STAGES.index(folder.name)]
    files = [folder.parent / stage / TABLE for stage in before if (folder.parent / stage / TABLE).is_file()]
    fitted_to: dict[str, str] = {}
    for file in (*files, folder / TABLE):
        try:
            table = json.loads(file.read_text(encoding="utf-8"))
            compared = table["compared"]
            fitted_to |= table.get("fitted_to", {})
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: {error!r}, expected what a stage of identification writes") from error
    return Written(compared["frames"], compared["command_delay"], fitted_to)


def read_arm(path: Path) -> mujoco.MjModel:
    """The MJCF at `path`, compiled: a chain of hinges that hangs from the world's origin.

    Raises:
        InputError: one line that says what it lacks.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the MJCF of an arm")
    model = read_spec(path).compile()
    sites = [model.site(index).name for index in range(model.nsite)]
    for name, where in (("base_center", "in the mount"), ("tip", "on the last unit")):
        if name not in sites:
            raise InputError(f"{path}: found no site {name!r}, expected one {where}")
    if not model.njnt or np.any(model.jnt_type != mujoco.mjtJoint.mjJNT_HINGE):
        raise InputError(f"{path}: found {model.njnt} joints, not all hinges, expected a chain of hinges")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mount = data.site("base_center")
    turn = float(Rotation.from_matrix(mount.xmat.reshape(3, 3)).magnitude())
    if not np.allclose(mount.xpos, 0, atol=1e-9) or turn > MOST_TURN:
        actual = f"found it at {np.round(mount.xpos, 4).tolist()} m and turned by {np.degrees(turn):.1f}°"
        expected = f"expected it in the world's origin and turned by {np.degrees(MOST_TURN):.0f}° at most"
        raise InputError(f"{path}: site 'base_center': {actual}, {expected}")
    return model
