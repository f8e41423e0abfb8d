"""From what a log says was commanded to the lengths of cable, or tensions, that a model's motors are sent.

A log counts pulls from the straight arm's path lengths, L = L_0 - u. Drums may be of another size than session.yaml
has it, and cables tight or slack where commands are 0: a model that says so (`winding` w, `preload` p) is sent

    L = L_0 - w u - p

Motors that are commanded by force are sent T = s u, with `force_scale` s: that of an effort, or of a drum's torque.
"""

import mujoco
import numpy as np

from trunkline.identification.parameters.parameter import Fields
from trunkline.model.arm_model import FORCE_SCALE, PRELOAD, WINDING, ArmModel


def wound(model: mujoco.MjModel, controls: np.ndarray) -> np.ndarray:
    """What the actuators of `model` are sent where a log commands `controls`, m or N. Shapes (T, nu)."""
    return wound_by_each(model, {"numeric_data": model.numeric_data[None]}, controls[None])[0]


def wound_by_each(model: mujoco.MjModel, fields: Fields, controls: np.ndarray) -> np.ndarray:
    """As `wound`, by every candidate: (E, T, nu) of E trials → (E C, T, nu), a trial's candidates one after another."""
    arm, count = ArmModel(model), len(next(iter(fields.values())))
    each = np.repeat(controls, count, axis=0)
    forced = arm.commands == "force"
    scale = arm.places(FORCE_SCALE if forced else WINDING)
    if not len(scale):
        return each
    numbers = fields.get("numeric_data", np.repeat(model.numeric_data[None], count, axis=0))
    numbers = np.tile(numbers, (len(controls), 1))[:, None]
    if forced:
        return numbers[..., scale] * each
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    return straight - numbers[..., scale] * (straight - each) - numbers[..., arm.places(PRELOAD)]
