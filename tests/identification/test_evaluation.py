"""Errors of a session whose trials are at rest and in motion."""

import numpy as np

from tests.support.matched_plant import release, segments_of, small_model, tilt
from trunkline.identification.evaluation import replay, scores
from trunkline.identification.experiment import prepare
from trunkline.identification.loss import LossWeights

WEIGHTS = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.03)


def test_only_trials_in_motion_have_a_velocity():
    model = small_model(4)
    experiments = [prepare(trial, model, 20) for trial in (release(model, 0.2, frames=30), tilt(model, 30))]
    for order in (experiments, experiments[::-1]):
        found = scores(replay(model, order, segments_of(model)), order, "positions", WEIGHTS)["identify"]
        kinds = found["by_experiment"]
        assert "e_velocity_mm_s" not in kinds["static_tilt"]
        assert found["e_velocity_mm_s"] == kinds["release"]["e_velocity_mm_s"]


def test_trials_that_a_model_does_not_survive_are_counted():
    model = small_model(4)
    experiments = [prepare(release(model, angle, frames=20), model, 20) for angle in (0.2, 0.3)]
    found = replay(model, experiments, segments_of(model))
    assert found.diverged == 0
    found.positions[1][-1, 0] = np.nan
    assert found.diverged == 1
    assert scores(found, experiments, "positions", WEIGHTS)["identify"]["e_position_mm"] > 1
