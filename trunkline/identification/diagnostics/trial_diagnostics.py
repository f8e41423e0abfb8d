"""Diagnostics of a trial with too much influence: the change of its data with which the model would agree."""

from dataclasses import replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.frames import tilt_of_gravity
from trunkline.identification.evaluation.evaluation import replay
from trunkline.identification.fit.fit import Fit
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.loss import LOSSES, loss_of
from trunkline.identification.simulate.pose_fit import QUIET_FRAMES, start_frames
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static
from trunkline.recordings.trials.start import robust_length
from trunkline.recordings.trials.trial import Trial

BETTER = 0.6  # of the loss: what explains a trial leaves less than this
LONGEST_SHIFT = 0.3  # s by which a start may be off
TURNS = np.radians([-40, -30, -20, -10, 10, 20, 30, 40])  # of gravity, that are tried
PULLS = (0.5, 0.7, 0.85, 1.15, 1.4, 2.0)  # factors of a command, that are tried
LEVEL_TOLERANCE = np.radians(5.0)  # between a static trial's level and its measured tilt
UNUSUAL = 3.0  # times the median over the trials
SWAYING = 0.03  # share of the top speed


def trial_diagnostics(
    trial: Trial, experiment: Experiment, others: list[Experiment], model: mujoco.MjModel, fit: Fit
) -> list[str]:
    """A sentence for each likely fault of a trial; none if nothing that is tried explains it.

    Args:
        trial, experiment: the same trial. others: experiments to compare with, it may be among them.
        model: what was identified.
    """
    simulated = replay(model, [experiment], fit.markers).positions[0]
    if not np.isfinite(simulated).all():
        return ["it diverges"]
    sentences = [
        started_off(simulated, experiment, fit),
        exchanged_labels(simulated, experiment, fit),
        another_level(simulated, trial, experiment, model, fit),
        unusual_start(experiment, others),
        moving_start(trial, experiment),
    ]
    return [sentence for sentence in sentences if sentence]


def started_off(simulated: np.ndarray, experiment: Experiment, fit: Fit) -> str:
    """Whether the motion (T, S, 3) m fits better when it begins earlier or later."""
    frames = experiment.frames
    if is_static(experiment.kind):
        return ""
    most = min(round(LONGEST_SHIFT / experiment.frame_step), frames // 2)
    losses = {}
    for shift in range(-most, most + 1):
        # a start that is `shift` frames later: the simulation's first frame is compared with the measured one of then
        here, there = slice(max(-shift, 0), frames - max(shift, 0)), slice(max(shift, 0), frames - max(-shift, 0))
        losses[shift] = _loss(simulated[here], experiment.positions[there], experiment.measured[there], fit)
    best = min(losses, key=lambda shift: losses[shift])
    if losses[best] > BETTER * losses[0] or abs(best) < 2:
        return ""
    return f"starting it {abs(best) * experiment.frame_step:.2f} s {'later' if best > 0 else 'earlier'} fits better"


def exchanged_labels(simulated: np.ndarray, experiment: Experiment, fit: Fit) -> str:
    """Whether it fits better with two markers' labels exchanged."""
    markers = experiment.positions.shape[1]
    apart = np.linalg.norm(simulated[:, :, None] - experiment.positions[:, None], axis=-1)  # (T, simulated, measured)
    both = experiment.measured[:, None] & experiment.measured[:, :, None]
    cost = np.where(both, apart, 0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    same = np.diag(cost)
    gain = same[:, None] + same - cost - cost.T
    first, second = np.unravel_index(np.argmax(gain), gain.shape)
    if gain[first, second] <= 0:
        return ""
    order = np.arange(markers)
    order[[first, second]] = second, first
    before = _loss(simulated, experiment.positions, experiment.measured, fit)
    after = _loss(simulated, experiment.positions[:, order], experiment.measured[:, order], fit)
    if after > BETTER * before:
        return ""
    return f"{fit.markers[first]!r} and {fit.markers[second]!r} look exchanged"


def another_level(simulated: np.ndarray, trial: Trial, experiment: Experiment, model: mujoco.MjModel, fit: Fit) -> str:
    """Whether it looks like a trial at another tilt, or with another pull."""
    tilt = tilt_of_gravity(trial.gravity)
    if is_static(trial.experiment):
        if trial.level is not None and abs(tilt - np.radians(trial.level)) > LEVEL_TOLERANCE:
            return f"its level is {trial.level:.0f} degrees, gravity in its base frame says {np.degrees(tilt):.0f}"
        axis = np.cross(trial.gravity, [0, 0, -1])
        axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-3 else np.array([1.0, 0, 0])
        tried = [replace(experiment, gravity=Rotation.from_rotvec(-turn * axis).apply(trial.gravity)) for turn in TURNS]
        words = [f"gravity turned by {np.degrees(turn):.0f} degrees fits better" for turn in TURNS]
    elif EXPERIMENTS[trial.experiment].needs_motors:
        length0 = experiment.controls[0]
        tried = [replace(experiment, controls=length0 + factor * (experiment.controls - length0)) for factor in PULLS]
        words = [f"{factor:g} times its pull fits better" for factor in PULLS]
    else:
        return ""
    losses = [
        _loss(positions, experiment.positions, experiment.measured, fit) if np.isfinite(positions).all() else np.inf
        for positions in replay(model, tried, fit.markers).positions
    ]
    best = int(np.argmin(losses))
    before = _loss(simulated, experiment.positions, experiment.measured, fit)
    return words[best] if losses[best] < BETTER * before else ""


def unusual_start(experiment: Experiment, others: list[Experiment]) -> str:
    """Whether no pose of the model is near the one that it starts in."""
    usual = float(np.median([np.nanmean(e.fit.residuals) for e in others if e.kind == experiment.kind]))
    distance = float(np.nanmean(experiment.fit.residuals))
    if distance < UNUSUAL * usual:
        return ""
    times = distance / usual
    return f"the pose that it starts in is {1e3 * distance:.1f} mm from any of the model, {times:.1f} times the median"


def moving_start(trial: Trial, experiment: Experiment) -> str:
    """Whether it is simulated from rest while the arm moves."""
    frame = start_frames(trial)[0] - QUIET_FRAMES
    if is_static(trial.experiment) or trial.in_motion or frame < 1:
        return ""
    first = max(frame - 2 * QUIET_FRAMES, 0)
    measured = trial.measured[frame] & trial.measured[first]
    moved = (trial.positions[frame] - trial.positions[first])[None] / (trial.time[frame] - trial.time[first])
    speed = float(robust_length(moved, measured[None])[0])
    steps = np.diff(experiment.positions, axis=0) / experiment.frame_step
    top = float(robust_length(steps, experiment.measured[1:] & experiment.measured[:-1]).max())
    if not measured.any() or speed < SWAYING * top:
        return ""
    return f"the arm moves at {1e3 * speed:.0f} mm/s when it is let go, and is simulated from rest"


def _loss(simulated: np.ndarray, positions: np.ndarray, measured: np.ndarray, fit: Fit) -> float:
    return float(loss_of(LOSSES[fit.loss](simulated[None], positions, measured, fit.weights))[0])
