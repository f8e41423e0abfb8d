"""A grasp from its beginning to its end: the first of `rehearsal.first_grasp`."""

import numpy as np
import pytest

from rehearsal.first_grasp import HOLD, LIFT, PLACEMENTS, Trial
from tests.rehearsal.arm import settings, stranger


@pytest.fixture(scope="module")
def trials() -> list:
    """The same grasp with the engine's own step, and with half of it."""
    found = []
    for substeps in (6, 12):
        trial = Trial(stranger(), settings(), PLACEMENTS[0], seed=1, substeps=substeps)
        found.append((trial, trial.run()))
    return found


def test_a_hanging_cylinder_is_wrapped_lifted_and_held(trials):
    trial, held = trials[0]
    assert held.held
    assert held.lifted > LIFT
    assert held.units >= 4
    assert held.slipped < 0.01
    force = trial.robot.truth().arm_thing.sum(axis=0)
    np.testing.assert_allclose(-force[2], trial.scene.object.mass * 9.80665, rtol=0.1)  # it bears all of the weight
    assert trial.robot.time > HOLD


def test_half_the_step_gives_the_same_grasp(trials):
    """Not the same place to the mm: which unit touches first decides how the coil lies."""
    (whole, held), (half, again) = trials
    assert again.held == held.held
    assert again.units >= 4
    assert np.linalg.norm(whole.robot.truth().thing - half.robot.truth().thing) < 0.02
