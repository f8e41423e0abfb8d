"""Controls that are pulls from the straight arm, in place of commands: 0, at which Unity starts, pulls nothing.

A position actuator's force is g c - g l - k_v v, for a command c and the length l of its tendon's path. With c = L - p
it is g L - g p - g l - k_v v: the same actuator, its control the pull p, for the price of a constant in its bias. L is
the rest length, that of the straight arm's path, or some micrometres more, as a file has six digits of g L and 0 must
not pull. `input`, which MuJoCo writes beside position actuators from 4.0 on and older versions refuse, goes with it.
"""

import math

import mujoco
import numpy as np

DIGITS = 6  # that libmujoco writes of a number
EXACT = 1e-6  # of the last digit: what is one but for rounding stays


def as_pulls(spec: mujoco.MjSpec) -> None:
    """Make every actuator's control, and its activation, a pull, in place."""
    model = spec.compile()
    for actuator in spec.actuators:
        rest = model.tendon_length0[model.tendon(actuator.target).id]
        gain, bias, limits = actuator.gainprm.copy(), actuator.biasprm.copy(), actuator.ctrlrange.copy()
        bias[0] = rounded_up(bias[0] + gain[0] * rest)
        rest = (bias[0] - actuator.biasprm[0]) / gain[0]
        gain[0] = -gain[0]
        actuator.gainprm, actuator.biasprm, actuator.ctrlspec = gain, bias, 0
        if actuator.ctrllimited == mujoco.mjtLimited.mjLIMITED_TRUE:
            actuator.ctrlrange = rest - limits[::-1]


def takes_pulls(model: mujoco.MjModel) -> bool:
    """Whether its controls are pulls: of those, more pulls more."""
    return bool(model.nu) and bool(np.all(model.actuator_gainprm[:, 0] < 0))


def rest_lengths(model: mujoco.MjModel) -> np.ndarray:
    """L of each actuator of a model that takes pulls, the command that the pull 0 stands for, m. Shape (nu,)."""
    return model.actuator_biasprm[:, 0] / -model.actuator_gainprm[:, 0]


def controls(model: mujoco.MjModel, commands: np.ndarray) -> np.ndarray:
    """What a model is sent for `commands` (..., nu), m: themselves, or the pulls that they are."""
    return rest_lengths(model) - commands if takes_pulls(model) else commands


def rounded_up(value: float) -> float:
    """The next number of `DIGITS` digits that is not below it."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) + 1 - DIGITS) if value else 1.0
    return math.ceil(value / unit - EXACT) * unit
