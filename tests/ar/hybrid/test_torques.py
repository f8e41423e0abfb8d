"""Joint torques against the slope of potential energy and against energy's rate, and their refusal."""

import mujoco
import numpy as np
import pytest

from tests.ar.hybrid.conftest import hybrid_settings
from trunkline.ar.hybrid.compose import compose
from trunkline.ar.hybrid.torques import joint_torques, servo_commands
from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import FixedMount

Q = np.array([0.3, 0.5, -0.2, -1.6, 0.4, 1.9, 0.1])


@pytest.fixture(scope="module")
def model(arm):
    return compose(arm, hybrid_settings(robot="panda").robot, touch=False).compile()


def pose(model, q):
    qpos = model.qpos0.copy()
    qpos[:7] = q
    return qpos


def still(model):
    return np.zeros((2, 1, model.nv))


def potential(model, q):
    data = mujoco.MjData(model)
    data.qpos[:] = pose(model, q)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return -model.opt.gravity @ (model.body_mass @ data.xipos)


def test_static_torques_are_the_slope_of_potential_energy(model):
    step = 1e-6 * np.eye(7)
    slope = [(potential(model, Q + offset) - potential(model, Q - offset)) / 2e-6 for offset in step]
    torques = joint_torques(model, pose(model, Q)[None], *still(model))
    np.testing.assert_allclose(torques[0], slope, atol=1e-6)
    assert np.abs(torques).max() > 20


def test_moving_torques_do_the_work_that_energy_gains(model):
    """Along a motion of the Panda's joints alone, the arm's held straight: power τ·q̇ = dE/dt less friction's."""
    time, step = 0.37, 1e-5

    def motion(t):
        phase = 2 * t + np.arange(7)
        return Q + 0.2 * np.sin(phase), 0.4 * np.cos(phase), -0.8 * np.sin(phase)

    def energy(t):
        q, v, _ = motion(t)
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:7] = pose(model, q), v
        mujoco.mj_forward(model, data)
        product = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, product, data.qvel)
        return data.qvel @ product / 2 + potential(model, q)

    q, v, a = motion(time)
    qvel, qacc = np.zeros((2, 1, model.nv))
    qvel[0, :7], qacc[0, :7] = v, a
    torques = joint_torques(model, pose(model, q)[None], qvel, qacc)[0]
    friction = model.dof_damping[:7] @ v**2
    gained = (energy(time + step) - energy(time - step)) / (2 * step)
    assert torques @ v == pytest.approx(gained + friction, rel=1e-5)


def test_servos_stand_where_they_are_sent(model):
    """Sent q + τ/k_p, no joint of the Panda is out of balance."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose(model, Q)
    torques = joint_torques(model, data.qpos[None], *still(model))
    data.ctrl[:7] = servo_commands(model, Q[None], torques)[0]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator[:7] + data.qfrc_passive[:7] - data.qfrc_bias[:7], 0, atol=1e-9)


def test_a_fixed_mount_bears_nothing(arm):
    model = compose(arm, FixedMount("fixed")).compile()
    with pytest.raises(InputError, match=r"robot\.kind"):
        joint_torques(model, model.qpos0[None], *still(model))
