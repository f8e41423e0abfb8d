"""Joints that are round harden and end by their whole bend: in MuJoCo, in the statics, identified, and in the file."""

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
from trunkline.model.statics.energy import Pull, evaluate
from trunkline.model.statics.equilibria import actuated
from trunkline.model.statics.placement import new_state

UNITS, HARDENING, END = 4, 3.0, 0.4


@pytest.fixture(scope="module")
def model():
    rest = {"rest_bend_x": 0.02, "rest_bend_y": -0.03}
    return with_parameters(small_model(UNITS, Joints(round=True)), {"hardening": HARDENING} | rest)


def ending_model(rounded):
    """Its joints end at `END`; those of so few units would at 180°."""
    spec = small_spec(UNITS)
    for joint in spec.joints:
        joint.range = [-END, END]
    add_elements(spec, Joints(round=rounded), 1e-5)
    return spec.compile()


@pytest.fixture(scope="module")
def ending():
    return ending_model(rounded=True)


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


def end_of(model, direction, torque):
    """How far the first joint bends under a torque, N m, towards `direction`: its whole bend, rad, without springs."""
    chain = read_chain(model)
    chain = chain._replace(stiffness=0 * chain.stiffness, diagonal=0 * chain.diagonal)
    state, nothing = new_state(UNITS, 3), np.zeros((4, 3))
    pull = Pull(*nothing, np.zeros((UNITS, 2)), 0.0, np.zeros((UNITS, 3)))
    toward = np.array([np.cos(direction), np.sin(direction)])
    low, high, q = 0.0, np.pi / 2, np.zeros(2 * UNITS)
    for _ in range(50):
        q[:2] = 0.5 * (low + high) * toward
        evaluate(chain, q, np.zeros(3), pull, state)
        low, high = (q[:2] @ toward, high) if state.gradient[:2] @ toward < torque else (low, q[:2] @ toward)
    return low


def test_a_joint_ends_at_the_same_bend_along_axes_and_diagonals_and_hardly_later_between_them(ending):
    for torque in (0.01, 0.3, 3.0):
        along = end_of(ending, 0.0, torque)
        assert along > END
        np.testing.assert_allclose([end_of(ending, k * np.pi / 4, torque) for k in range(1, 8)], along, rtol=1e-9)
        for k in range(8):
            between = end_of(ending, (k + 0.5) * np.pi / 4, torque) / along
            assert 1.0 < between < 1 / np.cos(np.pi / 8), "an octagon, less than 8.3 % beyond the circle"


def test_hinges_that_end_by_themselves_let_a_joint_bend_further_between_their_axes():
    square = ending_model(rounded=False)
    assert not square.tendon_limited.any()
    assert end_of(square, np.pi / 4, 0.01) > 1.4 * end_of(square, 0.0, 0.01)


@pytest.mark.parametrize("toward", np.radians([45, 135, -45, -135]))
def test_an_arm_bent_along_a_diagonal_rests_in_mujoco_where_the_statics_say(ending, toward):
    chain = read_chain(ending)
    gravity = 150 * np.array([[np.cos(toward), np.sin(toward), 0.0]])  # a heavy arm that hangs sideways
    loose = chain.straight_lengths + chain.length
    result, expected = actuated(chain, loose[None], gravity), settle(ending, loose[None], gravity)
    angles, end = expected.qpos.reshape(-1, 2), np.sqrt(2) * END
    diagonals = np.abs(np.stack([angles.sum(axis=1), angles[:, 0] - angles[:, 1]]))
    assert expected.rested.all()
    assert np.abs(angles).max() < END, "no hinge is at its limit: only the diagonals are"
    assert end < diagonals.max() < 1.1 * end
    np.testing.assert_allclose(result.position, expected.position, atol=1e-6)


@pytest.mark.parametrize(("turn", "within"), [(np.pi / 8, 0.08), (np.pi / 4, 0.05)])
def test_a_pull_that_is_turned_about_the_axis_bends_the_arm_alike(ending, turn, within):
    """Its units' whole bends, and how far the tip gets: where it gets to also depends on the twist of hinges in a row.
    With the hinges' limits alone, bends differ by 40 % and the tip by 16 % of the arm's length."""
    bends, reached = [], []
    for direction in (0, turn):
        gravity = 150 * np.array([[np.cos(direction), np.sin(direction), 0.0]])
        chain = read_chain(ending)
        result = actuated(chain, chain.straight_lengths[None] + chain.length, gravity)
        bends.append(np.linalg.norm(result.qpos[0].reshape(-1, 2), axis=1)[:3])
        reached.append([np.hypot(*result.position[0, :2]), result.position[0, 2]])
    assert bends[0].min() > END, "the units are at their limits"
    np.testing.assert_allclose(bends[1], bends[0], rtol=within)
    np.testing.assert_allclose(reached[1], reached[0], atol=within * chain.length)


@pytest.mark.parametrize("ends", [([-0.3, 0.3], [-0.4, 0.4]), ([-0.3, 0.4], [-0.3, 0.4])])
def test_limits_with_a_preferred_axis_stay_those_of_the_hinges(ends):
    spec = small_spec(UNITS)
    for name, end in zip(("unit_02_x", "unit_02_y"), ends, strict=True):
        spec.joint(name).range = end
    add_elements(spec, Joints(round=True), 1e-5)
    limited = {spec.tendons[t.id].name: bool(spec.compile().tendon_limited[t.id]) for t in spec.tendons}
    diagonals = ("unit_01_x_diagonal_1", "unit_02_y_diagonal_1", "unit_03_x_diagonal_1")
    assert [limited[name] for name in diagonals] == [True, False, True]


def test_limits_in_degrees_are_those_in_radians():
    degrees = small_spec(UNITS)
    degrees.compiler.degree = True
    for joint in degrees.joints:
        joint.range = [-np.degrees(END), np.degrees(END)]
    add_elements(degrees, Joints(round=True), 1e-5)
    model, (tendons, _) = degrees.compile(), ArmModel(degrees.compile()).diagonal_lengths(np.zeros(2 * UNITS))
    np.testing.assert_allclose(model.tendon_range[tendons, 1], np.tile(np.sqrt(2) * model.jnt_range[::2, 1], 2))
    np.testing.assert_allclose(model.jnt_range[:, 1], END)


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
