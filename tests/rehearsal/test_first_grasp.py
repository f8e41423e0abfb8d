"""Grasps from their beginning to their end: the first and the last of `rehearsal.first_grasp`."""

import numpy as np
import pytest

from rehearsal.first_grasp import HOLD, LIFT, PLACEMENTS, GraspTrial
from tests.rehearsal.arm import settings, stranger


@pytest.fixture(scope="module")
def trials() -> list:
    """The same grasp with the engine's own step, and with half of it."""
    pairs = []
    for substeps in (6, 12):
        trial = GraspTrial(stranger(), settings(), PLACEMENTS[0], seed=1, substeps=substeps)
        pairs.append((trial, trial.run()))
    return pairs


def test_a_hanging_cylinder_is_wrapped_lifted_and_held(trials):
    trial, outcome = trials[0]
    assert outcome.success
    assert outcome.lifted > LIFT
    assert outcome.units >= 4
    assert outcome.slipped < 0.01
    force = trial.robot.truth().arm_object.sum(axis=0)
    np.testing.assert_allclose(-force[2], trial.scene.object.mass * 9.80665, rtol=0.1)  # it bears all of the weight
    assert trial.robot.time > HOLD


def test_half_the_step_gives_the_same_grasp(trials):
    """Not the same place to the mm: which unit touches first decides how the coil lies."""
    (whole, first), (half, again) = trials
    assert again.success == first.success
    assert again.units >= 4
    assert np.linalg.norm(whole.robot.truth().object - half.robot.truth().object) < 0.02


def test_a_basket_is_lifted_off_its_table_by_its_bar_and_held():
    trial = GraspTrial(stranger(), settings(), PLACEMENTS[-1], seed=1)
    outcome, basket = trial.run(), trial.scene.object
    assert basket.shape == "basket"
    assert outcome.success
    assert outcome.lifted > LIFT
    assert outcome.slipped < 0.02
    truth = trial.robot.truth()
    assert truth.grip[2] > truth.object[2] + 0.15  # it hangs below its bar
    np.testing.assert_allclose(-truth.arm_object.sum(axis=0)[2], basket.mass * 9.80665, rtol=0.1)
    np.testing.assert_array_equal(truth.object_world, 0)
