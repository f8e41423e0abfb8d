"""Polynomial springs made straight: the slope is the least-squares one, and the manifest's numbers say so."""

import mujoco
import numpy as np
import pytest
from small_arm import small_spec

from trunkline.bundle.linearize import linearize_joints


def test_the_slope_is_the_least_squares_one():
    spec = small_spec()
    joint = spec.joint("unit_03_x")
    a, b, c = 0.8, 0.3, 2.0
    joint.stiffness, joint.damping = [a, b, c], [a, b, c]
    draws = np.random.default_rng(0)
    angles, speeds = draws.uniform(-0.5, 0.4, (50, 16)), draws.normal(0, 3, (50, 16))
    stiffness, damping = linearize_joints(spec, angles, speeds)
    model = spec.compile()
    index = model.joint("unit_03_x").id
    q, v = angles[:, index], speeds[:, index]
    spring, damper = a * q + b * q**2 + c * q**3, a * v + b * v * np.abs(v) + c * v**3
    assert stiffness.written == pytest.approx(np.linalg.lstsq(q[:, None], spring, rcond=None)[0][0])
    assert damping.written == pytest.approx(np.linalg.lstsq(v[:, None], damper, rcond=None)[0][0])
    assert model.jnt_stiffness[index] == stiffness.written
    assert not model.jnt_stiffnesspoly[index].any()
    assert (stiffness.element, stiffness.found) == ("unit_03_x", (a, b, c))


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
    assert linearize_joints(small_spec(), np.ones((2, 16)), np.ones((2, 16))) == []
