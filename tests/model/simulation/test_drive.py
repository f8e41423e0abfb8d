"""Driving by trajectories of commands: their last row decides where a frictionless arm rests, the way there when."""

import copy

import numpy as np
import pytest

from tests.support.matched_plant import small_model
from trunkline.frames import gravity_in_base
from trunkline.model.simulation.drive import LOOK, ROW, drive, has_friction
from trunkline.model.simulation.rest import longest_step, settle


@pytest.fixture(scope="module")
def model():
    model = small_model(4)
    model.dof_damping[:] *= 10
    return model


def test_a_trajectory_of_one_row_is_the_commands_sent_at_once(model):
    commands = model.tendon_length0 - [[0.01, -0.02, -0.02], [-0.02, 0.008, -0.02]]
    once, row = (drive(model, sent, gravity_in_base(0.5), 3.0).tips for sent in (commands, commands[:, None]))
    np.testing.assert_array_equal(once, row)


def test_a_slow_trajectory_arrives_late_at_the_same_place_and_is_waited_for(model):
    straight, command = model.tendon_length0, model.tendon_length0 - [0.01, -0.02, -0.02]
    waits = 3.0  # s at the straight arm's commands, longer than it takes to be found at rest
    hold = np.tile(straight, (round(waits / ROW), 1))
    shares = np.linspace(0, 1, round(1 / ROW) + 1)[:, None]
    slow = np.concatenate([hold, straight + shares * (command - straight)])[None]
    gravity = gravity_in_base(0.0)
    there = drive(model, command[None], gravity, 12.0, friction=False)
    late = drive(model, slow, gravity, 12.0, friction=False)
    assert late.rested.all()
    np.testing.assert_allclose(late.end, there.end, atol=1e-4)
    waited = late.tips[0, : round(waits / LOOK)]
    assert np.ptp(waited, axis=0).max() < 1e-3 < 0.1 * np.linalg.norm(there.end[0] - waited[-1])
    assert there.seconds_to_rest[0] < waits < late.seconds_to_rest[0]


def test_an_arm_too_stiff_for_the_longest_step_is_driven_in_shorter_ones():
    """MuJoCo steps springs explicitly; it warns, and what it says then is no answer."""
    stiff = small_model(4)
    stiff.jnt_stiffness[:] *= 1000
    gravity = gravity_in_base(0.5)
    command = stiff.tendon_length0 - [[0.01, -0.02, -0.02]]
    long = copy.copy(stiff)
    long.opt.timestep = longest_step(stiff)
    assert not drive(long, command, gravity, 3.0).rested[0]  # as long as its own
    driven = drive(stiff, command, gravity, 3.0)
    assert driven.rested[0]
    np.testing.assert_allclose(driven.end, settle(stiff, command, gravity).position, atol=1e-5)


def test_a_calmed_arm_rests_where_it_would_have_and_says_no_time_that_it_did_not_have(model):
    light = copy.copy(model)
    light.dof_damping[:] /= 20
    command, gravity = light.tendon_length0 - [[0.01, -0.02, -0.02]], gravity_in_base(0.5)
    swinging = drive(light, command, gravity, 1.0, friction=False)
    calmed = drive(light, command, gravity, 1.0, friction=False, calm=True)
    assert not swinging.rested[0]
    assert calmed.rested[0]
    assert np.isnan(calmed.seconds_to_rest[0])
    there = settle(light, command, gravity).position
    assert np.linalg.norm(swinging.end - there) > 1e-3
    np.testing.assert_allclose(calmed.end, there, atol=1e-5)
    np.testing.assert_array_equal(calmed.tips[:, :-1], swinging.tips)
    long = drive(model, command, gravity, 12.0, friction=False, calm=True)
    assert 0 < long.seconds_to_rest[0] < 12.0


def test_an_arm_with_friction_is_not_calmed(model):
    rubbing = copy.copy(model)
    rubbing.tendon_frictionloss[:] = 0.5
    assert has_friction(rubbing)
    command, gravity = rubbing.tendon_length0 - [[0.01, -0.02, -0.02]], gravity_in_base(0.5)
    with pytest.raises(ValueError, match="found friction"):
        drive(rubbing, command, gravity, 1.0, calm=True)
    drive(rubbing, command, gravity, 1.0, friction=False, calm=True)
