"""What the Panda's joints bear with arm and motors.

    τ = M(q) q̈ + c(q, q̇)

for all bodies of the composed model by `mj_inverse`, gravity in c. The cables pull between units and mount, so they are
none of it. Nor is friction in the Panda's joints: at rest it may help or hinder by what the wheel says, 1.2 N m at
most.
"""

import copy

import mujoco
import numpy as np

from trunkline.ar.hybrid.compose import panda_joints
from trunkline.errors import InputError
from trunkline.kinematics.panda.maker_model import JOINTS


def bare(model: mujoco.MjModel) -> mujoco.MjModel:
    """A composed model in which the Panda bears the arm alone: nothing touches, rubs, hangs or comes to a limit."""
    model, off = copy.copy(model), mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_EQUALITY | off.mjDSBL_LIMIT
    return model


def joint_torques(model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray, qacc: np.ndarray) -> np.ndarray:
    """Torques at the Panda's joints, N m. Shape (T, 7).

    Args:
        model: composed with the Panda; an object in it is not held by what touches it here.
        qpos: of all joints. Shape (T, nq). qvel, qacc: of all degrees of freedom. Shape (T, nv).

    Raises:
        InputError: the arm is not on a Panda.
    """
    joints = panda_joints(model)
    if len(joints) != len(JOINTS):
        raise InputError("robot.kind: found a fixed mount, expected panda: nothing else has joints that bear the arm")
    model = bare(model)
    data, dofs = mujoco.MjData(model), model.jnt_dofadr[joints]
    torques = np.empty((len(qpos), len(joints)))
    for row in range(len(qpos)):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[row], qvel[row], qacc[row]
        mujoco.mj_inverse(model, data)
        torques[row] = data.qfrc_inverse[dofs]
    return torques


def servo_commands(model: mujoco.MjModel, angles: np.ndarray, torques: np.ndarray) -> np.ndarray:
    """What the servos are sent to stand at `angles`, rad, bearing `torques`, N m: q + τ / k_p. All of shape (T, 7)."""
    motors = [model.actuator(f"{name}_position").id for name in JOINTS]
    return angles + torques / model.actuator_gainprm[motors, 0]
