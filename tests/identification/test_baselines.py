"""What a model's errors stand beside: predictions without forces, and the floor that noise leaves."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.matched_plant import markers_of, release, small_model, tilt
from trunkline.identification.evaluation.baselines import hanging_still, references
from trunkline.identification.evaluation.error_tables import marker_table, trial_table
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.simulate.experiment import prepare


@pytest.fixture(scope="module")
def model():
    return small_model(4)


def trials_of(model, noise=0.0):
    swings = [("identify", 0.2), ("validate", 0.3)]
    tilts = [tilt(model, 30, "identify", noise), tilt(model, 60, "identify", noise), tilt(model, 45, "validate", noise)]
    return [*(release(model, bend, split, 40, noise) for split, bend in swings), *tilts]


def beside(model, trials):
    experiments = [prepare(trial, model, 30) for trial in trials]
    replayed = replay(model, experiments, markers_of(model))
    return experiments, replayed, references(trials, experiments, model, replayed)


def test_each_null_model_is_what_its_name_says(model):
    trials = trials_of(model)
    experiments, replayed, baselines = beside(model, trials)
    assert set(baselines) == {"null", "null_straight", "null_held", "noise_floor"}
    straight = baselines["null_straight"].replay.positions[0]
    np.testing.assert_allclose(straight[..., :2], 0, atol=1e-12)  # along -z
    assert np.all(np.diff(straight[0, :, 2]) < 0)
    start = baselines["null_held"]
    for e, positions in zip(start.experiments, start.replay.positions, strict=True):
        trial = next(t for t in trials if t.name == e.name)
        np.testing.assert_allclose(positions, np.broadcast_to(trial.positions[0], positions.shape), atol=2e-4)
    rest = baselines["null"].replay.positions[2]
    np.testing.assert_allclose(rest[0], np.mean([e.positions[-1] for e in experiments[2:4]], axis=0))
    moving = experiments[0]
    errors = Prediction(start.replay, start.experiments).scores()["identify"]
    away = np.linalg.norm(moving.positions - trials[0].positions[0], axis=-1)
    assert errors["e_tip_mm"] == pytest.approx(1e3 * away[:, replayed.tip].mean(), abs=0.2)


def test_a_held_start_says_nothing_of_trials_at_rest(model):
    _, _, baselines = beside(model, trials_of(model))
    assert {e.kind for e in baselines["null_held"].experiments} == {"release"}
    _, _, still = beside(model, trials_of(model)[2:])
    assert "null_held" not in still


def test_a_session_without_trials_to_identify_from_rests_in_its_own_mean_shape(model):
    trials = [replace(trial, split="test") for trial in trials_of(model)[2:]]
    experiments, replayed, _ = beside(model, trials)
    (shape, *_) = hanging_still(experiments, replayed, experiments).positions
    np.testing.assert_allclose(shape[0], np.mean([e.positions[-1] for e in experiments], axis=0))


def test_the_floor_rises_with_noise_and_has_no_velocity(model):
    floors = []
    for noise in (0.0, 1e-3):
        _, _, baselines = beside(model, trials_of(model, noise))
        floors.append(baselines["noise_floor"].scores()["validate"])
        assert all(len(p) <= 12 for p in baselines["noise_floor"].replay.positions)
    assert floors[0]["e_position_mm"] < 0.1
    assert 3 * floors[0]["e_position_mm"] < floors[1]["e_position_mm"] < 2.0
    assert "e_velocity_mm_s" not in floors[1]
    assert {"e_internal_mm", "e_tip_mm", "e_tip_pct"} <= set(floors[1]["by_experiment"]["release"])


def test_tables_say_which_trial_is_bad_and_where_along_the_arm(model):
    trials = trials_of(model)
    shift = np.zeros((1, 4, 3))
    shift[:, -1, 0] = 0.02  # the tip of one trial, 20 mm aside
    trials[1] = replace(trials[1], positions=trials[1].positions + shift)
    experiments = [prepare(trial, model, 30) for trial in trials]
    measured = experiments[1].measured.copy()
    measured[:, 1] = False
    experiments[1].measured = measured
    replayed = replay(model, [prepare(trial, model, 30) for trial in trials_of(model)], markers_of(model))
    table = trial_table({"model": Prediction(replayed, experiments)}).set_index("trial")
    assert table.e_tip_mm.idxmax() == trials[1].name
    assert table.loc[trials[1].name].e_tip_mm == pytest.approx(20, abs=1)
    assert table.loc[trials[1].name].e_position_mm == pytest.approx(20 / 3, abs=1)  # of the three that were seen
    assert np.isnan(table.loc[trials[2].name].e_velocity_mm_s)
    validate = Prediction(replayed, experiments).of(lambda e: e.split == "validate" and e.kind == "release")
    along = marker_table({"model": validate}, markers_of(model))
    assert list(along.marker) == list(markers_of(model))
    assert np.all(np.diff(along.from_base_mm) > 0)
    assert along.e_position_mm.iloc[-1] == pytest.approx(20, abs=1)
    assert np.isnan(along.e_position_mm.iloc[1])
    assert along.e_position_mm.iloc[[0, 2]].max() < 1
