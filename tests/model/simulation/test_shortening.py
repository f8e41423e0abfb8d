"""A soft arm gets shorter under its tendons, by the tension that passes each unit over its EA."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.model.arm.test_sections import ACTUATION, SOLVER
from tests.support.forced_arm import MOTORS, forced_model
from trunkline.errors import InputError
from trunkline.model.arm.mjcf import Marker
from trunkline.model.arm.sections import Section, Sections
from trunkline.model.arm.tendons import Tendon
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.shortening import MOST, shares, shorten, shortened

SOFT = [Section(0.08, 2, 0.04, 0.02, joint_stiffness=2.0, axial_stiffness=200.0),
        Section(0.06, 2, 0.03, 0.01, joint_stiffness=1.0, axial_stiffness=50.0)]  # fmt: skip
TENDONS = [Tendon(0.0, 0.01), Tendon(180.0, 0.01, end=2), Tendon(90.0, 0.01, start=1, end=4)]


def soft_arm(sections=SOFT, actuation=MOTORS, tendons=TENDONS, joint_place: float = 0.5) -> Sections:
    return Sections(
        damping_ratio=0.1, tendons=tendons, hole_ratio=0.8, tip_load=0.0, joint_place=joint_place, actuation=actuation,
        markers={"end": Marker(0.14, (0.005, 0.0))}, kind="sections", sections=sections, joint_range_deg=60.0,
    )  # fmt: skip


def soft_model(**settings) -> mujoco.MjModel:
    return soft_arm(**settings).build(MOTORS, SOLVER, Path()).spec.compile()


def tip(model: mujoco.MjModel, site: str = "tip") -> np.ndarray:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data.site(site).xpos.copy()


def test_units_are_passed_from_a_tendons_first_hole_to_its_last():
    """Holes are in the middles of units; the third tendon's sheath ends at that of the first unit."""
    expected = [[1, 1, 0.5], [1, 0.5, 1], [1, 0, 1], [0.5, 0, 0.5]]
    np.testing.assert_allclose(shares(soft_model()), expected)


@pytest.mark.parametrize("joint_place", [0.0, 0.5])
def test_it_is_shorter_by_tension_over_stiffness(joint_place):
    """ΔL = Σ_i T_i L_i / EA_i of a bar in steps."""
    model = soft_model(joint_place=joint_place)
    np.testing.assert_array_equal(ArmModel(model).axial_stiffness, [200, 200, 50, 50])
    pulls = np.array([4.0, 2.0, 0.0])
    shorter = 4 * 0.08 / 200 + 2 * (0.04 + 0.02) / 200 + 4 * (0.03 + 0.015) / 50
    short = shortened(model, pulls)
    for site, aside in (("tip", 0.0), ("end_center", 0.005)):
        np.testing.assert_allclose(tip(model, site), [aside, 0, -0.14], atol=1e-12)
        np.testing.assert_allclose(tip(short, site), [aside, 0, -0.14 + shorter], atol=1e-12)
    assert short is not model


def test_what_lies_across_an_arm_and_its_mount_stay():
    model = soft_model()
    short = shortened(model, np.array([4.0, 2.0, 1.0]))
    for name in ("body_pos", "body_ipos", "jnt_pos", "site_pos"):
        np.testing.assert_array_equal(getattr(short, name)[:, :2], getattr(model, name)[:, :2])
    mount = [model.site(f"base_tendon_{k}").id for k in (1, 2)]
    np.testing.assert_array_equal(short.site_pos[mount], model.site_pos[mount])
    np.testing.assert_array_equal(short.body_pos[ArmModel(model).unit_bodies[0]], [0, 0, 0])


def test_commands_count_as_motors_pull():
    """Not below 0, not beyond their range; and no arm is pressed to nothing."""
    model = soft_model()
    at_most = tip(shortened(model, np.array([20.0, 0, 0])))
    np.testing.assert_allclose(tip(shortened(model, np.array([70.0, -5.0, 0]))), at_most)
    frail = soft_model(sections=[replace(section, axial_stiffness=1.0) for section in SOFT])
    assert tip(shortened(frail, np.array([20.0, 0, 0])))[2] == pytest.approx(-0.14 * (1 - MOST))


def test_it_may_be_shortened_again_and_again():
    model = soft_model()
    work = model.__copy__()
    for pulls in ([4.0, 0, 0], [0.0, 9.0, 1.0], [0.0, 0, 0]):
        shorten(work, model, np.array(pulls))
        np.testing.assert_array_equal(tip(work), tip(shortened(model, np.array(pulls))))
    np.testing.assert_array_equal(work.site_pos, model.site_pos)


def test_an_arm_of_stiff_units_is_left_as_it_is():
    model = forced_model()
    assert shortened(model, np.full(4, 9.0)) is model
    ArmModel(model).require_stiff_units("fk_dataset.model")
    with pytest.raises(InputError, match="^fk_dataset.model: found an arm with axial_stiffness, expected one without"):
        ArmModel(soft_model()).require_stiff_units("fk_dataset.model")


def test_the_description_says_it_of_all_sections_and_of_motors_commanded_by_force():
    with pytest.raises(ValueError, match="sections.1.axial_stiffness: missing, expected it of all sections or of none"):
        soft_arm(sections=[SOFT[0], replace(SOFT[1], axial_stiffness=None)])
    with pytest.raises(InputError, match="build_mjcf.arm.sections: found axial_stiffness beside motors that are comm"):
        soft_model(actuation=ACTUATION)
    assert not len(ArmModel(soft_model(sections=[replace(s, axial_stiffness=None) for s in SOFT])).axial_stiffness)


def test_a_load_at_the_tip_comes_along():
    arm = loaded_model(0.05)
    short = shortened(arm, np.array([4.0, 0.0, 0.0]))
    data = mujoco.MjData(short)
    mujoco.mj_kinematics(short, data)
    np.testing.assert_allclose(data.body("tip_load").xpos, data.site("tip").xpos, atol=1e-12)


def loaded_model(load: float) -> mujoco.MjModel:
    arm = soft_arm()
    arm.tip_load = load
    return arm.build(MOTORS, SOLVER, Path()).spec.compile()
