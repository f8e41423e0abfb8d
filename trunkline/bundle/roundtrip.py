"""Whether two models move alike: the same curl, under gravity from several directions."""

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.frames import gravity_in_base


def curl(model: mujoco.MjModel, duration: float, pull: float) -> np.ndarray:
    """Controls that pull tendon 1 up to `pull` m and let go again while the others pay out as much.

    Returns:
        Tendon lengths to command, m. Shape (steps, nu).
    """
    if model.nu == 0 or np.any(model.actuator_trntype != mujoco.mjtTrn.mjTRN_TENDON):
        raise InputError(f"calibrated MJCF: found {model.nu} actuators, expected one on each tendon")
    phase = np.arange(round(duration / model.opt.timestep)) / round(duration / model.opt.timestep)
    direction = np.where(np.arange(model.nu) == 0, 1.0, -1.0)
    rest = model.tendon_length0[model.actuator_trnid[:, 0]]
    return rest - pull * np.sin(np.pi * phase)[:, None] ** 2 * direction


def simulate(model: mujoco.MjModel, controls: np.ndarray, tilt: float) -> tuple[np.ndarray, int]:
    """Positions of all bodies in the base frame, and how many warnings MuJoCo counted (Unity throws on one).

    Args:
        controls: shape (steps, nu). tilt: gravity angle, rad.

    Returns:
        Positions in m, shape (steps, nbody, 3), and the count.
    """
    data = mujoco.MjData(model)
    gravity = model.opt.gravity.copy()
    model.opt.gravity = gravity_in_base(tilt)
    data.act[:] = controls[0, model.actuator_actadr >= 0]  # the motors' filters start at rest
    positions = np.empty((len(controls), model.nbody, 3))
    for step, control in enumerate(controls):
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        positions[step] = data.xpos
    model.opt.gravity = gravity
    return positions, int(sum(warning.number for warning in data.warning))


def deviation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Largest distance between corresponding bodies at each step, m. Shape (steps,)."""
    return np.linalg.norm(first - second, axis=-1).max(axis=-1)
