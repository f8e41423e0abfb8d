"""Arms at rest: how to step them there, and spring references that hold one that is not straight then."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.arm.parameters import Fields

LONGEST_STEP = 0.005  # s
NEWTON_STEPS = 30  # far more than a stiffening spring needs


def longest_step(model: mujoco.MjModel) -> float:
    """Time step, s, for an arm that is damped so that it settles: the rest shape is the same as at any smaller one.

    MuJoCo softens a joint limit whose time constant is less than two steps (flag refsafe).
    """
    constants = model.jnt_solref[:, 0][model.jnt_solref[:, 0] > 0]  # the others are in another format
    return min([LONGEST_STEP, *constants / 2])


@dataclass(frozen=True)
class RestShape:
    """A shape at rest under gravity.

    pose: joint angles, rad. Shape (nq,). load: torque that gravity puts on each spring there, N m. Shape (nq,).
    """

    pose: np.ndarray
    load: np.ndarray


def rest_shape(model: mujoco.MjModel, pose: np.ndarray, gravity: np.ndarray) -> RestShape:
    """The shape `pose` (nq,) of an arm without pull, and what its springs bear there under `gravity` (3,) m/s²."""
    model = model.__copy__()
    model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return RestShape(np.array(pose), -data.qfrc_bias.copy())


def spring_references(fields: Fields, model: mujoco.MjModel, rest: RestShape) -> np.ndarray:
    """Joint angles q_0 at which each candidate's springs are slack, so that it rests in `rest`. Shape (C, nq).

    The torque of a spring is -(a x + b x² + c x³), x = q - q_0. At rest it balances the load, which bends it by x:
    the stiffer the arm, the less of its shape comes from gravity. Fields that `fields` lacks are the model's.
    """
    a = fields.get("jnt_stiffness", model.jnt_stiffness[None])
    poly = fields.get("jnt_stiffnesspoly", model.jnt_stiffnesspoly[None])
    b, c = poly[..., 0], poly[..., 1]
    bend = rest.load / a
    for _ in range(NEWTON_STEPS):
        bend = bend - (bend * (a + bend * (b + bend * c)) - rest.load) / (a + bend * (2 * b + 3 * bend * c))
    return rest.pose - bend
