"""Joints that are round harden by their whole bend: in MuJoCo, in the statics, identified, and in the file."""

import mujoco
import numpy as np
import pytest

from tests.support.matched_plant import markers_of, small_model
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.identification.fit.identify import with_parameters
from trunkline.identification.parameters.parameters import PARAMETERS, candidate_fields, set_fields
from trunkline.identification.parameters.saving import save_model
from trunkline.identification.simulate.resting import rest_shape, spring_references
from trunkline.model.arm.joints import Joints, add_elements
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated

UNITS, HARDENING = 4, 3.0


@pytest.fixture(scope="module")
def model():
    rest = {"rest_bend_x": 0.02, "rest_bend_y": -0.03}
    return with_parameters(small_model(UNITS, Joints(round=True)), {"hardening": HARDENING} | rest)


def torques(model, bend):
    """Of the springs of the first joint, N m, bent by `bend` (2,) from where it is slack."""
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos_spring
    data.qpos[:2] += bend
    mujoco.mj_forward(model, data)
    return data.qfrc_spring[:2]


@pytest.mark.parametrize("direction", np.radians([0, 20, 45, 90, 135, 200, 315]))
def test_the_torque_is_the_same_in_all_directions(model, direction):
    toward = np.array([np.cos(direction), np.sin(direction)])
    for size in (0.1, 0.3):
        expected = -model.jnt_stiffness[0] * size * (1 + HARDENING * size**2)
        np.testing.assert_allclose(torques(model, size * toward), expected * toward, rtol=1e-12, atol=1e-15)


def test_hinges_that_harden_by_themselves_are_half_as_hard_between_their_axes():
    model = with_parameters(small_model(UNITS), {"hardening": HARDENING})
    result = torques(model, 0.3 * np.full(2, np.sqrt(0.5)))
    expected = model.jnt_stiffness[0] * 0.3 * (1 + HARDENING * 0.3**2 / 2)
    assert np.linalg.norm(result) == pytest.approx(expected)


def test_hardening_is_read_as_it_was_written_and_scales_with_stiffness(model):
    assert PARAMETERS["hardening"].read(model) == pytest.approx(HARDENING)
    stiffer = with_parameters(model, {"stiffness": 2 * float(model.jnt_stiffness[0])})
    np.testing.assert_allclose(torques(stiffer, [0.2, 0.1]), 2 * torques(model, [0.2, 0.1]))
    factors = np.array([1.5, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(
        torques(with_parameters(model, {}, {"stiffness": factors}), [0.2, 0.1]), 1.5 * torques(model, [0.2, 0.1])
    )


def test_the_file_has_them(model):
    spec = small_spec(UNITS)
    add_elements(spec, Joints(round=True), 1e-5)
    spec = mujoco.MjSpec.from_string(spec.to_xml())  # as a later stage reads it, with all lengths typed out
    saved = mujoco.MjModel.from_xml_string(save_model(spec, model))
    np.testing.assert_allclose(torques(saved, [0.2, 0.1]), torques(model, [0.2, 0.1]), rtol=1e-5)
    tendons, _ = ArmModel(model).diagonal_lengths(model.qpos_spring)
    np.testing.assert_allclose(saved.tendon_lengthspring[tendons], model.tendon_lengthspring[tendons], atol=1e-6)


def test_the_statics_rest_where_mujoco_does(model):
    chain = read_chain(model)
    pulls = np.array([[0.03, 0.02, -0.3], [-0.3, 0.035, 0.01]])
    gravity = np.array([[3.0, 1.0, -9.0]] * 2)
    result = actuated(chain, chain.straight_lengths - pulls, gravity)
    expected = settle(model, chain.straight_lengths - pulls, gravity)
    assert expected.rested.all()
    assert np.abs(expected.qpos).max() > 0.2
    np.testing.assert_allclose(result.position, expected.position, atol=1e-6)


def test_a_rest_shape_is_where_the_arm_hangs(model):
    pose = 0.1 * np.random.default_rng(0).uniform(-1, 1, 2 * UNITS)
    rest = rest_shape(model, pose, np.array([2.0, 1.0, -9.5]))
    hung = with_parameters(model, {}, rest=rest)
    hung.opt.gravity[:] = [2.0, 1.0, -9.5]
    data = mujoco.MjData(hung)
    data.qpos[:] = pose
    mujoco.mj_forward(hung, data)
    np.testing.assert_allclose(data.qfrc_spring, data.qfrc_bias, atol=1e-9)
    fields = candidate_fields(model, {"hardening": np.array([HARDENING])})
    np.testing.assert_allclose(spring_references(fields, model, rest)[0], hung.qpos_spring)


def test_a_joint_that_cannot_be_round_is_refused_by_name():
    spec = small_spec(UNITS)
    spec.joint("unit_02_y").stiffness = [1, 0, 0]
    with pytest.raises(InputError, match=r"round: body 'unit_02': found springs .*, expected two hinges"):
        add_elements(spec, Joints(round=True), 1e-5)


def test_markers_are_those_of_the_arm(model):
    plain = small_model(UNITS)
    assert markers_of(model) == markers_of(plain)
    fields = candidate_fields(plain, {"hardening": np.array([HARDENING])})
    assert "tendon_lengthspring" not in fields
    set_fields(plain, fields)
    assert PARAMETERS["hardening"].read(plain) == pytest.approx(HARDENING)
