"""Noisy trials of a model whose parameters are known, for counting how often intervals hold the truth.

Noise is the laboratory's, as the filter stage leaves it: 0.3 mm white per axis and 0.3°, positions low-passed at 20 Hz,
static tilts averaged over their frames. Without the low-pass, steps from frame to frame are noisy, and the velocity
term, which is relative to the measured step, then favours too much damping by 1 %, with an interval of 1 %.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from tests.support.matched_plant import FRAME, curl, release, tilt
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.identification.parameters.parameters import candidate_fields, set_fields
from trunkline.identification.simulate.loss import LossWeights
from trunkline.recordings.trials.trial import Trial

TRIALS = 6
NOISE = 0.3e-3, np.radians(0.3)  # m and rad, per axis
LOW_PASS = butter(4, 20.0, fs=1 / FRAME, output="sos")
MARGIN = 30  # frames, beyond which the low-pass's ends are not felt
STILL_FRAMES = 60  # over which a static trial is averaged
WEIGHTS = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.03)


@dataclass
class Stage:
    """True values, and noise-free trials of so many frames of a model that has them."""

    true: dict[str, float]
    trials: Callable[[mujoco.MjModel, int], list[Trial]]


def tilts(truth: mujoco.MjModel, frames: int) -> list[Trial]:
    return [tilt(truth, angle) for angle in np.linspace(20, 90, TRIALS)]


def releases(truth: mujoco.MjModel, frames: int) -> list[Trial]:
    bends = np.linspace(0.15, 0.35, TRIALS) * np.resize([1, -1], TRIALS)
    return [release(truth, bend, frames=frames) for bend in bends]


def curls(truth: mujoco.MjModel, frames: int) -> list[Trial]:
    """From gentle ones to some that reach the force range: the last four of six."""
    levels = np.linspace(20, 60, TRIALS)
    return [curl(truth, level, frames=frames, tendon=index % 3) for index, level in enumerate(levels)]


STAGES = {
    "stiffness": Stage({"stiffness": 2.0, "hardening": 1.5}, tilts),
    "damping": Stage({"damping": 0.07, "tendon_friction": 0.5, "friction_time": 0.03}, releases),
    "control": Stage({"kp": 600.0, "kv": 25.0, "force_range": 1.6, "time_constant": 0.05}, curls),
}


def with_values(model: mujoco.MjModel, values: dict[str, float]) -> mujoco.MjModel:
    """A copy of `model` with these parameters."""
    changed = model.__copy__()
    set_fields(changed, candidate_fields(model, {name: np.array([value]) for name, value in values.items()}))
    return changed


def measured(trial: Trial, rng: np.random.Generator) -> Trial:
    """A noise-free trial as motion capture and filter see it."""
    moving, markers, _ = trial.positions.shape
    frames = STILL_FRAMES if moving == 1 else moving
    noise = rng.normal(0, NOISE[0], (frames + 2 * MARGIN, markers, 3))
    noise = sosfiltfilt(LOW_PASS, noise, axis=0)[MARGIN:-MARGIN]
    turns = rng.normal(0, NOISE[1], (frames, markers, 3))
    if moving == 1:
        noise, turns = noise.mean(axis=0, keepdims=True), turns.mean(axis=0, keepdims=True)
    turned = rotation_from_wxyz(trial.quaternions.reshape(-1, 4)) * Rotation.from_rotvec(turns.reshape(-1, 3))
    quaternions = wxyz_from_rotation(turned).reshape(trial.quaternions.shape)
    return replace(trial, positions=trial.positions + noise, quaternions=quaternions)
