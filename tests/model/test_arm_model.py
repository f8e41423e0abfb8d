"""What is cached of a model, and what is read from it each time."""

import gc
import weakref

import numpy as np

from tests.support.small_arm import small_spec
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement, add_elements
from trunkline.model.arm_model import CAPSTAN_FRICTION, SLIP, SLIP_LENGTH, ArmModel


def full_arm() -> ArmModel:
    spec = small_spec(4, backlash=0.001)
    add_elements(spec, Joints([MaxwellElement(0.3, 0.5)], [JenkinsElement(0.2, 0.02)]), 1e-5)
    add_holes(spec, GuideHoles(0.1, 2))
    return ArmModel(spec.compile())


def test_parts_are_those_of_the_arm():
    arm = full_arm()
    assert (arm.hinge_count, len(arm.branches), len(arm.sliders), len(arm.diagonals)) == (8, 1, 1, 0)
    assert arm.unit_of_hinge.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert arm.cable_names == ["tendon_1", "tendon_2", "tendon_3"]
    assert arm.guide_holes.shape == (3, 2)
    assert not set(arm.guide_holes.flat) & set(arm.cables)
    assert [arm.model.actuator(motor).trnid[0] for motor in arm.actuators] == arm.cables.tolist()
    assert arm.model.site(arm.cable_sites(arm.cables[1])[0]).name == "base_tendon_2"


def test_numbers_are_read_when_they_are_asked_for():
    arm = full_arm()
    assert (arm.capstan_friction, arm.backlash, arm.rate_limit, arm.preload.size) == (0.1, 0.001, 0.0, 0)
    arm.model.numeric_data[arm.places(CAPSTAN_FRICTION)] = 0.2
    assert ArmModel(arm.model).capstan_friction == arm.capstan_friction == 0.2
    assert arm.switch_off("no such number", CAPSTAN_FRICTION)
    assert not arm.switch_off(CAPSTAN_FRICTION, "no such number")
    assert (arm.capstan_friction, arm.backlash) == (0.0, 0.001)
    assert ArmModel(small_spec().compile()).number(SLIP_LENGTH) == 0.0
    assert ArmModel(small_spec().compile()).slip_length == SLIP


def test_what_was_looked_up_is_shared_by_all_of_one_model_and_goes_with_it():
    arm = full_arm()
    assert ArmModel(arm.model).cables is arm.cables
    assert ArmModel(arm.model.__copy__()).cables is not arm.cables
    model = weakref.ref(arm.model)
    del arm
    gc.collect()
    assert model() is None


def test_cables_that_are_cut_down_stay_cables():
    arm = full_arm()
    cables = arm.cables.copy()
    arm.switch_off_cables()
    np.testing.assert_array_equal(ArmModel(arm.model).cables, cables)
    assert (arm.model.tendon_num[cables] == 1).all()
    assert arm.capstan_friction == 0.0
