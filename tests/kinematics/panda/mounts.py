"""The mount of a model of the Panda against the project's kinematics."""

import mujoco
import numpy as np

from trunkline.kinematics.panda.kinematics import mount_pose


def assert_mounts(model: mujoco.MjModel, q: np.ndarray, offset: float, atol: float) -> None:
    """At joint angles (N, 7), rad, with a mount so far from the flange, m."""
    data = mujoco.MjData(model)
    for pose, position, rotation in zip(q, *mount_pose(q, offset), strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("mount").xpos, position, atol=atol)
        np.testing.assert_allclose(data.site("mount").xmat.reshape(3, 3), rotation, atol=atol)
