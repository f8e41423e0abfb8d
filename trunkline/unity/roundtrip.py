"""Whether two models move alike: the same curl, under gravity from several directions."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.unity.pulls import controls

SLACK = 1e-4  # m, of every tendon at first: at none, the last digit decides whether it damps the arm


@dataclass
class ReplayedMotion:
    """What a model did.

    Attributes:
        positions: of all bodies in the base frame, m. Shape (steps, nbody, 3).
        tip: of the site `tip`, likewise. Shape (steps, 3).
        angles, speeds: qpos and qvel, rad and rad/s. Shapes (steps, nq), (steps, nv).
        warnings: how many MuJoCo counted; Unity stops the scene at one.
    """

    positions: np.ndarray
    tip: np.ndarray
    angles: np.ndarray
    speeds: np.ndarray
    warnings: int = 0


def curl(model: mujoco.MjModel, duration: float, pull: float) -> np.ndarray:
    """Commands that draw tendon 1 in by up to `pull` m and let go again while the others pay out as much.

    Returns:
        Of each of the model's steps, m. Shape (steps, nu).
    """
    if model.nu == 0 or np.any(model.actuator_trntype != mujoco.mjtTrn.mjTRN_TENDON):
        raise InputError(f"calibrated MJCF: found {model.nu} actuators, expected one on each tendon")
    phase = np.arange(round(duration / model.opt.timestep)) / round(duration / model.opt.timestep)
    direction = np.where(np.arange(model.nu) == 0, 1.0, -1.0)
    rest = model.tendon_length0[model.actuator_trnid[:, 0]]
    return rest + SLACK - pull * np.sin(np.pi * phase)[:, None] ** 2 * direction


def simulate(model: mujoco.MjModel, commands: np.ndarray, tilt: float) -> ReplayedMotion:
    """Step a model from rest in its straight shape.

    Args:
        commands: m, whatever the model's controls are. Shape (steps, nu).
        tilt: gravity angle, rad.
    """
    batch = batch_of(model, 1)
    batch.expand("opt.gravity")[:] = gravity_in_base(tilt)
    sent = controls(model, commands)
    hold(batch, model, sent[0])
    recorded = move(batch, sent[None], ("xpos", "site_xpos", "qpos", "qvel"))
    positions, sites, angles, speeds = (recorded[name][0] for name in ("xpos", "site_xpos", "qpos", "qvel"))
    return ReplayedMotion(positions, sites[:, model.site("tip").id], angles, speeds, int(batch.warning.sum()))


def deviation(first: ReplayedMotion, second: ReplayedMotion) -> np.ndarray:
    """Largest distance between corresponding bodies at each step, m. Shape (steps,)."""
    return np.linalg.norm(first.positions - second.positions, axis=-1).max(axis=-1)
