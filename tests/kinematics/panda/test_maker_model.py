"""The wheel's Panda against this room's kinematics and limits, which are the project's."""

from importlib import import_module

import mujoco
import numpy as np
import pytest

from tests.kinematics.panda.mounts import assert_mounts
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN
from trunkline.kinematics.panda.limits import TORQUE
from trunkline.kinematics.panda.maker_model import shipped_panda

OFFSET = 0.05  # m


@pytest.fixture(scope="module")
def model():
    return shipped_panda(OFFSET).compile()


def test_kinematics_agree(model):
    assert_mounts(model, np.random.default_rng(0).uniform(Q_MIN, Q_MAX, (200, 7)), OFFSET, 1e-6)


def test_limits_are_this_rooms_and_nearly_the_wheels(model):
    np.testing.assert_array_equal(model.jnt_range, np.column_stack([Q_MIN, Q_MAX]))
    constants = import_module("dm_robotics.panda.arm_constants")
    np.testing.assert_array_equal(constants.EFFORT_LIMITS["max"], TORQUE)
    np.testing.assert_array_equal(constants.JOINT_LIMITS["max"], Q_MAX)
    wheel = mujoco.MjModel.from_xml_path(constants.XML_PATH)
    np.testing.assert_allclose(wheel.jnt_range, model.jnt_range, atol=3.1e-4)


def test_masses_are_the_wheels_and_no_joint_feeds_energy(model):
    wheel = mujoco.MjModel.from_xml_path(import_module("dm_robotics.panda.arm_constants").XML_PATH)
    np.testing.assert_array_equal(model.body_mass, wheel.body_mass[:-1])  # its last body is the flange
    np.testing.assert_array_equal(model.body_inertia, wheel.body_inertia[:-1])
    assert (model.dof_damping >= 0).all()
    assert not model.body_gravcomp.any()
