"""What the Panda's joints bear with arm, motors and load.

    τ = M(q) q̈ + c(q, q̇) - Jᵀ m (g - a)

the first two for all bodies of the composed model by `mj_inverse`, gravity in c; the last for a load, a point mass m at
a point of the arm that accelerates with a. The cables pull between units and mount, so they are none of it. Nor is
friction in the Panda's joints: at rest it may help or hinder by what the wheel says, 1.2 N m at most.
"""

import copy

import mujoco
import numpy as np

from trunkline.ar.hybrid.compose import panda_joints
from trunkline.errors import InputError
from trunkline.kinematics.panda.maker_model import JOINTS


def joint_torques(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    qvel: np.ndarray | None = None,
    qacc: np.ndarray | None = None,
    load: float = 0.0,
    site: str = "tip",
) -> np.ndarray:
    """Torques at the Panda's joints, N m. Shape (T, 7).

    Args:
        model: composed with the Panda; an object in it is not held by what touches it here.
        qpos: of all joints. Shape (T, nq). qvel, qacc: of all degrees of freedom, at rest by default. Shape (T, nv).
        load: kg, at `site`.

    Raises:
        InputError: the arm is not on a Panda.
    """
    joints = panda_joints(model)
    if len(joints) != len(JOINTS):
        raise InputError("robot.kind: found a fixed mount, expected panda: nothing else has joints that bear the arm")
    model, off = copy.copy(model), mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_EQUALITY | off.mjDSBL_LIMIT
    data, dofs = mujoco.MjData(model), model.jnt_dofadr[joints]
    still = np.zeros((len(qpos), model.nv))
    qvel, qacc = still if qvel is None else qvel, still if qacc is None else qacc
    torques = np.empty((len(qpos), len(joints)))
    for row in range(len(qpos)):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[row], qvel[row], qacc[row]
        mujoco.mj_inverse(model, data)
        torques[row] = data.qfrc_inverse[dofs]
        if load:
            torques[row] += load * _of_load(model, data, model.site(site).id, qacc[row])[dofs]
    return torques


def _of_load(model: mujoco.MjModel, data: mujoco.MjData, site: int, qacc: np.ndarray) -> np.ndarray:
    """Jᵀ (a - g) of a point, a = J q̈ + J̇ q̇, N m for each kg. Shape (nv,)."""
    linear, slope = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    point, body = data.site_xpos[site], model.site_bodyid[site]
    mujoco.mj_jac(model, data, linear, None, point, body)
    mujoco.mj_jacDot(model, data, slope, None, point, body)
    return linear.T @ (linear @ qacc + slope @ data.qvel - model.opt.gravity)


def servo_commands(model: mujoco.MjModel, angles: np.ndarray, torques: np.ndarray) -> np.ndarray:
    """What the servos are sent to stand at `angles`, rad, bearing `torques`, N m: q + τ / k_p. All of shape (T, 7)."""
    motors = [model.actuator(f"{name}_position").id for name in JOINTS]
    return angles + torques / model.actuator_gainprm[motors, 0]
