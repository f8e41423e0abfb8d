"""The compiled arm: lengths, masses, tendons and limits are those asked for, and it behaves like an arm."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.small_arm import LIMIT, hinges_about, small_mjcf, small_spec
from trunkline.frames import STANDARD_GRAVITY, gravity_in_base, rotation_from_wxyz
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import TPU_95A_DENSITY, TPU_95A_MODULUS, unit_properties
from trunkline.model.arm.mjcf import Solver, Tendons, build_spec, unit_name
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm.tendons import even_routes
from trunkline.model.arm_model import BACKLASH, ArmModel

UNITS = 24
CHAIN = spiral_chain(0.507, 0.080, 0.012, UNITS)
PROPERTIES = unit_properties(CHAIN, TPU_95A_MODULUS, TPU_95A_DENSITY, 0.24, 0.1)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return small_spec(UNITS).compile()


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def test_two_hinges_a_unit_and_three_tendons(model):
    assert (model.nq, model.nv, model.ntendon, model.nu) == (2 * UNITS, 2 * UNITS, 3, 3)
    names = [model.joint(i).name for i in range(4)]
    assert names == ["unit_01_x", "unit_01_y", "unit_02_y", "unit_02_x"], "in turn, so that the arm does not twist"
    assert hinges_about(model, 0).tolist()[:4] == [0, 3, 4, 7]
    assert hinges_about(model, 1).tolist()[:4] == [1, 2, 5, 6]
    assert unit_name(4) == "unit_05"


def test_the_straight_arm_hangs_along_minus_z(model):
    data = at_rest(model)
    np.testing.assert_allclose(data.site("tip").xpos, [0, 0, -0.507], atol=1e-12)
    starts = np.concatenate([[0], np.cumsum(CHAIN.lengths)])
    for index in (0, 11, 23):
        body, centre = data.body(unit_name(index)), data.site(f"{unit_name(index)}_center")
        assert body.xpos[2] == pytest.approx(-starts[index])
        assert centre.xpos[2] == pytest.approx(-(starts[index] + starts[index + 1]) / 2)
        np.testing.assert_allclose(body.xipos, centre.xpos)


def test_masses_stiffness_and_damping_arrive(model):
    moving = slice(2, None)  # after the world and the base
    np.testing.assert_allclose(model.body_mass[moving], PROPERTIES.masses)
    np.testing.assert_allclose(model.jnt_stiffness, np.repeat(PROPERTIES.stiffness, 2))
    np.testing.assert_allclose(model.dof_damping, np.repeat(PROPERTIES.damping, 2))
    np.testing.assert_allclose(model.jnt_range[:, 1], np.repeat(CHAIN.joint_range, 2))
    np.testing.assert_allclose(model.jnt_range[:, 0], -model.jnt_range[:, 1])
    assert model.jnt_limited.all()


def test_numbers_of_winches_are_in_the_file_where_they_have_any():
    spec = small_spec(rate_limit=0.3)
    spec.compile()
    model = mujoco.MjModel.from_xml_string(spec.to_xml())
    assert ArmModel(model).rate_limit == 0.3
    assert not ArmModel(model).places(BACKLASH).size
    assert ArmModel(model).backlash == 0.0


def test_tendon_lengths_at_rest_are_the_sum_of_straight_pieces(model):
    """Hole to hole in the plane of a tendon: radii shrink with the widths, heights are base face and unit centres."""
    radii = 0.85 / 2 * np.concatenate([[CHAIN.widths[0]], CHAIN.widths])
    heights = np.concatenate([[0], np.cumsum(CHAIN.lengths) - CHAIN.lengths / 2])
    expected = np.hypot(np.diff(radii), np.diff(heights)).sum()
    np.testing.assert_allclose(model.tendon_length0, expected)


def test_tendon_one_is_over_x_and_the_others_follow_counter_clockwise(model):
    data = at_rest(model)
    for number, angle in ((1, 0), (2, 120), (3, 240)):
        x, y, _ = data.site(f"unit_01_tendon_{number}").xpos
        assert np.degrees(np.arctan2(y, x)) % 360 == pytest.approx(angle, abs=1e-9)


def settle(model, controls, seconds=3.0, gravity=None):
    data = mujoco.MjData(model)
    if gravity is not None:
        model.opt.gravity = gravity
    data.act[:] = data.ctrl[:] = controls
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return data


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_pulled_tendon_bends_the_arm_to_its_side(number):
    """As long as no unit ends: where some do, hinges in a row are no round joints, and the tip goes aside by more."""
    model = small_spec(24).compile()
    controls = model.tendon_length0 + 0.05
    controls[number - 1] = model.tendon_length0[number - 1] - 0.02
    data = settle(model, controls)
    assert (np.abs(data.qpos) < model.jnt_range[:, 1]).all()
    angle = np.radians(120 * (number - 1))
    side = np.array([np.cos(angle), np.sin(angle)])
    tip = data.site("tip").xpos[:2]
    assert tip @ side > 0.05
    assert np.linalg.norm(tip - (tip @ side) * side) < 0.001  # and stays in that plane


def test_a_tendon_cannot_push():
    model = small_spec().compile()
    data = at_rest(model)
    data.act[:] = data.ctrl[:] = model.tendon_length0 + 0.1
    mujoco.mj_forward(model, data)
    assert (data.actuator_force == 0).all()
    data.act[:] = model.tendon_length0 - 1.0
    mujoco.mj_forward(model, data)
    assert (data.actuator_force == -80).all()


def test_the_command_is_followed_with_the_time_constant():
    model = small_spec().compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    for _ in range(50):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.act, 1 - np.exp(-0.05 / 0.05), rtol=1e-6)


def test_the_arm_curls_from_the_tip_and_its_units_close_on_each_other():
    model = small_spec(12).compile()
    rest = model.tendon_length0.copy()
    data = mujoco.MjData(model)
    data.act[:] = rest
    for step in range(3000):
        data.ctrl[:] = rest + [-0.1 * min(1, step / 1500), 0.2, 0.2]
        mujoco.mj_step(model, data)
    about_y = hinges_about(model, 1)
    bend = np.abs(data.qpos[about_y]) / model.jnt_range[about_y, 1]
    assert bend[0] < 0.1
    assert (np.diff(bend[:7]) > 0).all()
    assert ((bend[7:] > 0.99) & (bend[7:] < 1.05)).all()  # a soft stop, but a stop


def test_saving_and_loading_gives_the_same_model():
    spec = mujoco.MjSpec.from_string(small_mjcf())
    loaded, built = spec.compile(), small_spec().compile()
    assert spec.to_xml() == small_mjcf()
    for name in (
        "jnt_stiffness",
        "dof_damping",
        "dof_armature",
        "tendon_length0",
        "actuator_biasprm",
        "jnt_solimp",
    ):
        np.testing.assert_allclose(getattr(loaded, name), getattr(built, name), rtol=1e-5)
    moving = slice(2, None)  # MuJoCo does not save the mass of a body that cannot move: the base's
    np.testing.assert_allclose(loaded.body_mass[moving], built.body_mass[moving], rtol=1e-5)
    np.testing.assert_allclose(loaded.body_inertia[moving], built.body_inertia[moving], rtol=1e-5)


def test_gravity_points_down_in_the_file(model):
    assert model.opt.gravity.tolist() == [0, 0, -STANDARD_GRAVITY]


@pytest.mark.parametrize("tilt", np.radians([0, 30, 90, 120]))
def test_turning_gravity_is_turning_the_base(tilt):
    """Shape at rest in the base frame: gravity set to g(θ), against the mount turned by θ about +y in the world."""
    turned_gravity = small_spec().compile()
    slack = turned_gravity.tendon_length0 + 1
    first = settle(turned_gravity, slack, 4.0, gravity_in_base(tilt))

    spec = small_spec()
    spec.body("base").quat = [np.cos(tilt / 2), 0, np.sin(tilt / 2), 0]
    second = settle(spec.compile(), slack, 4.0)
    base = rotation_from_wxyz(second.body("base").xquat)
    in_base = base.inv().apply(second.xpos[1:])
    np.testing.assert_allclose(first.xpos[1:], in_base, atol=1e-6)


def test_any_number_of_tendons_and_a_chain_that_is_no_spiral():
    chain = ChainGeometry(np.full(6, 0.03), np.full(6, 0.04), np.full(6, 0.5), 1.0)
    properties = unit_properties(chain, TPU_95A_MODULUS, TPU_95A_DENSITY, 0.3, 0.1)
    tendons = Tendons(0.5, 60, 0.05, kp=2000, routes=even_routes(chain, 4, 0.8), kv=80)
    model = build_spec(chain, properties, tendons, Solver(0.001, 1e-5, *LIMIT, *LIMIT)).compile()
    assert (model.ntendon, model.nq) == (4, 12)
    np.testing.assert_allclose(
        model.tendon_length0, 0.18 - 0.015
    )  # straight holes, from the face to the last centre


@pytest.mark.parametrize("turned", np.radians([30, 45, 120]))
def test_an_arm_that_bends_between_its_hinges_axes_does_not_twist(turned):
    """Two hinges in a row turn a unit about its length by half the product of their angles; the next unit turns it
    back. In one order all along, 24 such units would twist by up to 24 · 0.1² / 2 = 0.12 rad."""
    model = small_spec(24).compile()
    data = mujoco.MjData(model)
    for axis, bend in enumerate((np.sqrt(2) * 0.1 * np.cos(turned), np.sqrt(2) * 0.1 * np.sin(turned))):
        data.qpos[hinges_about(model, axis)] = bend
    mujoco.mj_kinematics(model, data)
    tip = Rotation.from_matrix(data.xmat[model.site("tip").bodyid[0]].reshape(3, 3)).as_rotvec()
    assert np.linalg.norm(tip) > 2.5
    assert abs(tip[2]) < 0.005 * np.linalg.norm(tip)
