"""Polynomial springs made straight: the slope is the least-squares one, and the way back is exact."""

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import small_spec
from trunkline.model.arm.joints import Joints, add_elements
from trunkline.model.arm_model import ArmModel
from trunkline.unity.linearize import Laws, compile_with, linearize


def test_the_slope_is_the_least_squares_one():
    spec = small_spec()
    joint = spec.joint("unit_03_x")
    a, b, c = 0.8, 0.3, 2.0
    joint.stiffness, joint.damping = [a, b, c], [a, b, c]
    draws = np.random.default_rng(0)
    angles, speeds = draws.uniform(-0.5, 0.4, (50, 16)), draws.normal(0, 3, (50, 16))
    laws = linearize(spec, angles, speeds)
    (stiffness,), (damping,) = laws.springs, laws.dampers
    model = spec.compile()
    index = model.joint("unit_03_x").id
    q, v = angles[:, index], speeds[:, index]
    spring, damper = a * q + b * q**2 + c * q**3, a * v + b * v * np.abs(v) + c * v**3
    assert stiffness.line == pytest.approx(np.linalg.lstsq(q[:, None], spring, rcond=None)[0][0])
    assert damping.line == pytest.approx(np.linalg.lstsq(v[:, None], damper, rcond=None)[0][0])
    assert model.jnt_stiffness[index] == stiffness.line
    assert not model.jnt_stiffnesspoly[index].any()
    assert (stiffness.joint, stiffness.coefficients) == ("unit_03_x", (a, b, c))


def test_the_law_it_replaces_is_the_simulator_s():
    spec = small_spec()
    a, b, c = 0.8, 0.3, 2.0
    spec.joint("unit_01_x").stiffness, spec.joint("unit_01_x").damping = [a, b, c], [a, b, c]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = -0.4, -1.5
    mujoco.mj_forward(model, data)
    spring = -(a * -0.4 + b * 0.4**2 + c * -(0.4**3))
    damper = -(a * -1.5 + b * -1.5 * 1.5 + c * -(1.5**3))
    assert data.qfrc_passive[0] == pytest.approx(spring + damper)


def test_a_linear_model_is_left_alone():
    laws = linearize(small_spec(), np.ones((2, 16)), np.ones((2, 16)))
    assert laws == Laws([], [], [])
    assert not laws


def test_springs_and_dampers_come_back_exactly():
    spec, draws = small_spec(), np.random.default_rng(1)
    for joint in spec.joints[3:9]:
        joint.stiffness = draws.uniform(0.1, 1, 3)
    for joint in spec.joints[7:]:
        joint.damping = draws.uniform(0.1, 1, 3)
    calibrated = spec.compile()
    laws = linearize(spec, np.ones((2, 16)), np.ones((2, 16)))
    assert (len(laws.springs), len(laws.dampers), len(laws.diagonals)) == (6, 9, 0)
    spec.compile()
    restored = compile_with(spec.to_xml(), laws)
    replaced = calibrated.jnt_stiffnesspoly.any(axis=1), calibrated.dof_dampingpoly.any(axis=1)
    assert (restored.jnt_stiffness[replaced[0]] == calibrated.jnt_stiffness[replaced[0]]).all()
    assert (restored.dof_damping[replaced[1]] == calibrated.dof_damping[replaced[1]]).all()
    assert (restored.jnt_stiffnesspoly == calibrated.jnt_stiffnesspoly).all()
    assert (restored.dof_dampingpoly == calibrated.dof_dampingpoly).all()


def test_a_round_joint_s_diagonals_come_back_too():
    spec, angles = small_spec(), np.random.default_rng(2).uniform(-0.3, 0.4, (50, 16))
    for joint in spec.joints:
        joint.stiffness, joint.springref = [0.5, 0, 1.5], 0.01
    add_elements(spec, Joints(round=True), 1e-5)
    calibrated = spec.compile()
    laws = linearize(spec, angles, np.ones((50, 16)))
    assert (len(laws.springs), len(laws.dampers), len(laws.diagonals)) == (16, 0, 16)
    both = angles[:, 2] + angles[:, 3]
    assert laws.diagonals[1].tendon == "unit_02_y_diagonal_1"
    assert laws.diagonals[1].line == pytest.approx(0.25 * both**4 @ np.ones(50) / (both @ both))
    spec.compile()
    restored = compile_with(spec.to_xml(), laws)
    assert (restored.tendon_stiffnesspoly == calibrated.tendon_stiffnesspoly).all()
    assert (restored.tendon_stiffness == calibrated.tendon_stiffness).all()
    diagonals, _ = ArmModel(calibrated).diagonal_lengths(calibrated.qpos_spring)
    np.testing.assert_allclose(restored.tendon_lengthspring[diagonals], calibrated.tendon_lengthspring[diagonals])
