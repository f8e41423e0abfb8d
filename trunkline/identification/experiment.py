"""A trial set up for simulation: where it starts, what drives it, what it is compared with."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.identification.pose_fit import PoseFit, fit_pose
from trunkline.recording.trial import Trial

SLACK = 0.3  # m of tendon paid out where nothing pulls, more than any bend takes up


@dataclass
class Experiment:
    """One simulation per candidate, of T frames at `frame_step` seconds; a static trial has T = 1.

    Attributes:
        name, kind, split: as in the trial; kind is its experiment.
        gravity: m/s², base frame. Shape (3,).
        start: joint angles of the first frame, at rest. Shape (nq,).
        controls: commanded tendon lengths from each frame to the next, m. Shape (T, nu).
        positions: measured segments, m, base frame. Shape (T, S, 3).
        measured: where they count. Shape (T, S).
        fit: how well the start matches the first frame.
    """

    name: str
    kind: str
    split: str
    gravity: np.ndarray
    start: np.ndarray
    controls: np.ndarray
    positions: np.ndarray
    measured: np.ndarray
    frame_step: float
    fit: PoseFit

    @property
    def frames(self) -> int:
        return len(self.positions)


def prepare(trial: Trial, model: mujoco.MjModel, frames: int) -> Experiment:
    """Set up one trial: from its detected start, for at most `frames` frames.

    Raises:
        InputError: if a tracked segment or a commanded tendon is not in the model, or nothing is left to compare.
    """
    check_names(trial, model)
    first = 0 if trial.experiment == "static_tilt" else int(np.searchsorted(trial.time, trial.start - 1e-9))
    window = slice(first, first + frames)
    positions, measured = trial.positions[window], trial.measured[window]
    if not measured.any():
        raise InputError(f"trial {trial.name}: found no measured frame after its start at {trial.start:.2f} s")
    quaternions = None if trial.quaternions is None else trial.quaternions[first]
    seen = np.where(measured[0][:, None], positions[0], np.nan)
    fit = fit_pose(model, trial.segments, seen, quaternions)
    return Experiment(
        name=trial.name,
        kind=trial.experiment,
        split=trial.split,
        gravity=trial.gravity,
        start=fit.qpos,
        controls=commanded_lengths(trial, model)[window],
        positions=positions,
        measured=measured,
        frame_step=float(np.median(np.diff(trial.time))) if len(trial.time) > 1 else 0.0,
        fit=fit,
    )


def commanded_lengths(trial: Trial, model: mujoco.MjModel) -> np.ndarray:
    """Tendon lengths that the trial commands, m; slack where it commands nothing. Shape (T, nu)."""
    lengths = np.empty((len(trial.time), model.nu))
    for index in range(model.nu):
        tendon = model.actuator_trnid[index, 0]
        name = model.tendon(tendon).name
        pull = trial.commands[:, trial.tendons.index(name)] if name in trial.tendons else -SLACK
        lengths[:, index] = model.tendon_length0[tendon] - pull
    return lengths


def check_names(trial: Trial, model: mujoco.MjModel) -> None:
    """Refuse a trial whose segments or tendons the model does not have."""
    sites = {model.site(i).name.removesuffix("_center") for i in range(model.nsite)} - {"base"}
    tendons = [model.tendon(i).name for i in range(model.ntendon)]
    for kind, found, expected in (("segment", trial.segments, sites), ("tendon", trial.tendons, tendons)):
        unknown = [name for name in found if name not in expected]
        if unknown:
            units = sorted(name for name in expected if "_tendon_" not in name and name != "tip")
            raise InputError(
                f"trial {trial.name}: {kind} {unknown[0]!r} is not in the arm, expected {kind}s among "
                f"{units[0]} to {units[-1]}; map the log's names under `segments` in session.yaml"
                if units
                else f"trial {trial.name}: {kind} {unknown[0]!r} is not in the arm, which has none"
            )
