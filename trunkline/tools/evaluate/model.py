"""The model that is evaluated: how the stage that wrote it compared it, and with what."""

from dataclasses import dataclass, replace
from pathlib import Path

import mujoco

from trunkline.identification.parameters.parameters import SESSION_MARK
from trunkline.identification.parameters.per_session import names_in
from trunkline.identification.results.scoring import fingerprint
from trunkline.pipeline.config import settings_of
from trunkline.recordings.trials.trial import Trial, sessions_of
from trunkline.twin.twin import Twin


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

    def as_fitted(self, trials: list[Trial]) -> list[Trial]:
        """`trials` of a session without a name, as of the one that it was fitted to, where they are of that."""
        session = self.session_of(trials) if len(sessions_of(trials)) == 1 else ""
        return [replace(t, session=session, name=f"{session}/{t.name}") for t in trials] if session else trials

    def namesakes(self, model: mujoco.MjModel, trials: list[Trial]) -> list[str]:
        """Sessions of `trials` of whose names `model` has numbers, though it was fitted to none of their trials."""
        named = {name.partition(SESSION_MARK)[2] for name in names_in(model)}
        fitted_sessions = {trial.session for trial in trials if self.saw(trial)}
        return [session for session in sessions_of(trials) if self.fitted_to and session in named - fitted_sessions]


def written_beside(twin: Twin, root: Path) -> Written:
    """From the tables of the stages that the model comes from; without one, and of a package, frames and delay from the
    settings in `root`."""
    provenance = twin.provenance
    if provenance.tables and not provenance.package:  # a package's tables are without what was compared
        compared = list(provenance.tables.values())[-1]["compared"]
        return Written(compared["frames"], compared["command_delay"], provenance.fitted_to)
    settings = settings_of("identify_damping", root)
    return Written(settings.frames, settings.command_delay, provenance.fitted_to)
