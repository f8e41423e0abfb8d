"""The poses that a certificate is for: at rest, under commands and a tilt as large as the session has them."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.frames import STANDARD_GRAVITY
from trunkline.identification.parameters.per_session import model_in
from trunkline.identification.simulate.experiment import SLACK, commanded_controls
from trunkline.kinematics.dataset.sampling import around_the_arm
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import base_frame
from trunkline.model.statics.chain import Chain
from trunkline.recordings.trials.conditions import PULLED, Conditions
from trunkline.recordings.trials.trial import Trial

LOOSE_EVERY = 5  # poses of which one is without a pull


@dataclass
class StaticPoses:
    """What N poses at rest are asked for with.

    gravity: m/s², base frame. Shape (N, 3). commands: path lengths to which the motors are sent, m. Shape (N, K).
    """

    gravity: np.ndarray
    commands: np.ndarray

    def __len__(self) -> int:
        return len(self.gravity)

    def __getitem__(self, rows) -> "StaticPoses":
        return StaticPoses(self.gravity[rows], self.commands[rows])


def posed(trials: list[Trial], model: mujoco.MjModel) -> StaticPoses:
    """The poses of trials at rest, the last one of each, with gravity as the mount of `model` has it."""
    order = ArmModel(model).actuators
    commands = [commanded_controls(trial, model)[-1][order] for trial in trials]
    gravity = np.array([_gravity(trial, model) for trial in trials]).reshape(-1, 3)
    return StaticPoses(gravity, np.array(commands).reshape(-1, model.nu))


def _gravity(trial: Trial, model: mujoco.MjModel) -> np.ndarray:
    """What pulled at the arm in a trial, base frame of the session whose mount `model` has, m/s². Shape (3,)."""
    session_model = model_in(trial.session, model)
    if session_model is model:
        return trial.gravity
    return base_frame(model)[1] @ base_frame(session_model)[1].T @ trial.gravity


def draw_poses(chain: Chain, conditions: Conditions, count: int, rng: np.random.Generator) -> StaticPoses:
    """Poses within `conditions`, everything drawn evenly.

    In most of them one or two neighbouring motors pull, the others are slack, and the mount is tilted as far as it was
    in trials with a pull; in the others, one in `LOOSE_EVERY`, all are slack and the mount is tilted as far as it ever
    was. To any side.
    """
    pulled = (rng.random(count) >= 1 / LOOSE_EVERY) & (conditions.pull > PULLED)
    largest = np.where(pulled, conditions.pulled_tilt_deg, conditions.tilt_deg)
    tilt, side = np.radians(largest * rng.uniform(0, 1, count)), rng.uniform(0, 2 * np.pi, count)
    across = np.sin(tilt)
    gravity = STANDARD_GRAVITY * np.stack([across * np.cos(side), across * np.sin(side), -np.cos(tilt)], axis=1)
    pulls, order = np.full((count, chain.tendons), -SLACK), around_the_arm(chain)
    for row in (pulls[index] for index in np.flatnonzero(pulled)):
        levels = rng.uniform(0, conditions.pull, 2)
        while levels.sum() > conditions.pulls:
            levels = rng.uniform(0, conditions.pull, 2)
        first, several = int(rng.integers(chain.tendons)), chain.tendons > 1 and rng.random() < 0.5
        row[order[first]] = levels[0]
        if several:
            row[order[(first + 1) % chain.tendons]] = levels[1]
    return StaticPoses(gravity, chain.straight_lengths - pulls)
