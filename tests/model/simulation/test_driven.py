"""When a drive came to rest, and whether a model has friction, by hand."""

import numpy as np
import pytest

from tests.support.small_arm import small_spec
from trunkline.model.arm.joints import JenkinsElement, Joints, add_elements
from trunkline.model.arm_model import BACKLASH, CAPSTAN_FRICTION, ArmModel
from trunkline.model.simulation.drive import LOOK, NEAR, Driven, has_friction

A_LITTLE = 1e-12


@pytest.mark.parametrize(
    ("away", "rested", "calmed", "seconds"),
    [
        ([0.0, 0.0, 0.0, 0.0], True, False, 0.0),  # it never left
        ([1.0, 0.0, 0.0, 0.0], True, False, LOOK),
        ([1.0, 0.0, 1.0, 0.0], True, False, 3 * LOOK),  # it came by before
        ([NEAR, NEAR, NEAR, 0.0], True, False, 0.0),  # that near is there
        ([NEAR + A_LITTLE, 0.0, 0.0, 0.0], True, False, LOOK),
        ([1.0, 0.0, 0.0, 0.0], False, False, np.nan),
        ([1.0, 1.0, 1.0, 0.0], True, True, np.nan),  # only damped it came there
        ([1.0, 1.0, 0.0, 0.0], True, True, 2 * LOOK),
        ([1.0, 1.0, 1.0, 0.0], True, False, 3 * LOOK),
        ([0.0, 0.0, np.nan, np.nan], False, False, np.nan),  # lost on its way
    ],
)
def test_the_time_to_rest_is_from_when_on_a_tip_stays_near_its_end(away, rested, calmed, seconds):
    """Beside another drive, which rests at once."""
    tips = np.zeros((2, len(away), 3))
    tips[0, :, 1] = away
    result = Driven(tips, np.array([rested, True]), calmed).seconds_to_rest
    np.testing.assert_equal(result, [seconds, 0.0])


def plain():
    """An arm with everything that can rub, none of which does."""
    spec = small_spec(2, backlash=3e-4)
    add_elements(spec, Joints([], [JenkinsElement(0.2, 0.02)]), 1e-5)
    spec.add_numeric(name=CAPSTAN_FRICTION, data=[0.2], size=1)
    model = spec.compile()
    model.tendon_frictionloss[:], model.dof_frictionloss[:] = 0, 0
    for slider in ArmModel(model).sliders:
        model.tendon_stiffness[slider.tendon] = 0
    ArmModel(model).switch_off(CAPSTAN_FRICTION, BACKLASH)
    return model


def set_cable(model):
    model.tendon_frictionloss[ArmModel(model).cables[0]] = 0.1


def set_joint(model):
    model.dof_frictionloss[1] = 1e-3


def set_slider(model):
    model.tendon_stiffness[ArmModel(model).sliders[0].tendon] = 0.2


def set_holes(model):
    model.numeric_data[ArmModel(model).places(CAPSTAN_FRICTION)] = 0.2


def set_winches(model):
    model.numeric_data[ArmModel(model).places(BACKLASH)] = 3e-4


@pytest.mark.parametrize("rubs", [set_cable, set_joint, set_slider, set_holes, set_winches])
def test_each_kind_of_friction_alone_makes_where_it_rests_depend_on_the_way(rubs):
    model = plain()
    assert not has_friction(model)
    rubs(model)
    assert has_friction(model)
