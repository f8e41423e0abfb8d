"""Trials beside their simulation, frame by frame."""

from typing import NamedTuple

import numpy as np

from trunkline.identification.evaluation.evaluation import replay
from trunkline.identification.simulate.experiment import Experiment, prepare
from trunkline.identification.simulate.pose_fit import start_frames
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.trial import Trial
from trunkline.tools.evaluate.model import Written

SHAPE_TIME = 0.1  # s that a shape at rest is shown for, where a trial has several


class Track(NamedTuple):
    """T frames of a trial as it is compared, of S markers, K tendons, and all N bodies of the arm from the base on.

    time: s from the first frame. Shape (T,). measured: m, NaN where not seen. Shape (T, S, 3). quaternions: of those,
    wxyz, or None. simulated: the same markers by the model, m; NaN if it does not survive the trial. bodies: all of
    them by the model, (T, N, 3). commands, pulls: as commanded, m or N, and as measured, m. Each (T, K).
    """

    trial: Trial
    time: np.ndarray
    measured: np.ndarray
    quaternions: np.ndarray | None
    simulated: np.ndarray
    bodies: np.ndarray
    commands: np.ndarray
    pulls: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """Of each marker, mm. Shape (T, S)."""
        return 1e3 * np.linalg.norm(self.simulated - self.measured, axis=-1)


def tracks(arm: ArmModel, trials: list[Trial], written: Written) -> list[Track]:
    """Of trials that track the same markers, simulated as `trunkline evaluate` does it."""
    experiments = [prepare(trial, arm.model, written.frames, written.command_delay) for trial in trials]
    replayed = replay(arm.model, experiments, tuple(arm.markers))
    columns = [arm.markers.index(name) for name in trials[0].markers]
    return [
        _track(trial, experiment, positions, columns)
        for trial, experiment, positions in zip(trials, experiments, replayed.positions, strict=True)
    ]


def _track(trial: Trial, experiment: Experiment, bodies: np.ndarray, columns: list[int]) -> Track:
    first = 0 if is_static(trial.experiment) else start_frames(trial)[0] + 1
    rows = slice(first, first + experiment.frames)
    return Track(
        trial,
        np.arange(experiment.frames) * (experiment.frame_step or SHAPE_TIME),
        np.where(experiment.measured[..., None], experiment.positions, np.nan),
        None if trial.quaternions is None else trial.quaternions[rows],
        bodies[:, columns],
        bodies,
        trial.commands[rows],
        trial.tendon_positions[rows],
    )
