"""Shapes at rest: whatever its stiffness, an arm stays where it was seen to hang."""

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import plain_spec
from trunkline.frames import gravity_in_base
from trunkline.identification.parameters.parameters import candidate_fields, set_fields
from trunkline.identification.simulate.resting import rest_shape, spring_references
from trunkline.model.simulation.rest import longest_step

POSE = np.array([0.02, -0.05, 0.01, 0.03, -0.04, 0.06, 0.0, 0.1])


@pytest.fixture
def spec():
    return plain_spec(damping=5.0, timestep=0.002, load=0.2)


@pytest.mark.parametrize("tilt", [0.0, 0.5])
@pytest.mark.parametrize("hardening", [0.0, 40.0])
def test_every_candidate_rests_in_the_shape(spec, tilt, hardening):
    model = spec.compile()
    gravity = gravity_in_base(tilt)
    rest = rest_shape(model, POSE, gravity)
    fields = candidate_fields(model, {"stiffness": np.array([0.8, 4.0]), "hardening": np.full(2, hardening)})
    fields["qpos_spring"] = spring_references(fields, model, rest)
    model.opt.gravity[:] = gravity
    for candidate in (0, 1):
        set_fields(model, fields, candidate)
        data = mujoco.MjData(model)
        data.qpos[:] = POSE
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qfrc_passive, data.qfrc_bias, atol=1e-9)
        data.qpos[:] = POSE + 0.05
        mujoco.mj_step(model, data, 10000)
        np.testing.assert_allclose(data.qpos, POSE, atol=1e-3)


def test_a_stiff_arm_owes_its_shape_to_itself_and_a_soft_one_to_gravity(spec):
    model = spec.compile()
    rest = rest_shape(model, POSE, gravity_in_base(0.5))
    fields = {"jnt_stiffness": np.array([[1.0], [1e6]]) * np.ones(8)}
    soft, stiff = spring_references(fields, model, rest)
    np.testing.assert_allclose(stiff, POSE, atol=1e-5)
    assert np.abs(soft - POSE).max() > 0.1


def test_the_step_to_rest_is_half_the_time_constant_of_the_hardest_limit(spec):
    model = spec.compile()
    model.jnt_solref[:, 0] = 0.05
    assert longest_step(model) == 0.005
    model.jnt_solref[2, 0] = 0.003
    model.jnt_solref[3] = [-1000.0, -10.0]  # stiffness and damping: no time constant
    assert longest_step(model) == pytest.approx(0.0015)
    limited = spec.copy()
    limited.add_tendon(limited=True, range=[-1, 1], solref_limit=[0.002, 1]).wrap_joint(limited.joints[0].name, 1)
    assert longest_step(limited.compile()) == pytest.approx(0.001)
