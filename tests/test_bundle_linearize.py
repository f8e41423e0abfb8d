"""Polynomial springs made straight: the slope is the least-squares one, and the manifest's numbers say so."""

import mujoco
import numpy as np
import pytest
from small_arm import small_spec

from trunkline.bundle.linearize import linearize_joints


def best_slope(force, reach):
    samples = np.linspace(-reach, reach, 20001)
    return float(np.dot(force(samples), samples) / np.dot(samples, samples))


def test_the_slope_is_the_least_squares_one():
    spec = small_spec()
    joint = spec.joint("unit_03_x")
    a, b, c = 0.8, 0.3, 2.0
    joint.stiffness, joint.damping = [a, b, c], [a, b, c]
    stiffness, damping = linearize_joints(spec, speed=4.0)
    reach = joint.range[1]
    assert stiffness.written == pytest.approx(
        best_slope(lambda q: a * q + b * q**2 + c * q**3, reach), rel=1e-3
    )
    assert damping.written == pytest.approx(
        best_slope(lambda v: a * v + b * v * abs(v) + c * v**3, 4.0), rel=1e-3
    )
    model = spec.compile()
    index = model.joint("unit_03_x").id
    assert model.jnt_stiffness[index] == pytest.approx(stiffness.written)
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
    assert linearize_joints(small_spec(), speed=5.0) == []
