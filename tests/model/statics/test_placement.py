"""Where joint angles put the arm, beside MuJoCo's own kinematics."""

import mujoco
import numpy as np

from tests.support.bent_chain import hardening_stump
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.placement import joint_positions


def test_joints_and_tip_are_where_mujoco_has_them():
    model = hardening_stump()
    chain, data = read_chain(model), mujoco.MjData(model)
    rng = np.random.default_rng(3)
    every = rng.uniform(-0.3, 0.3, (4, model.nq))
    result = joint_positions(chain, every)
    for qpos, places in zip(every, result, strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        base = data.body("base")
        wanted = np.vstack([data.xanchor[::2], data.site("tip").xpos]) - base.xpos
        np.testing.assert_allclose(places, wanted @ base.xmat.reshape(3, 3), atol=1e-12)
