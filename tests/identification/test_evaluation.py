"""Errors of a session whose trials are at rest and in motion."""

import numpy as np
import pytest

from tests.support.matched_plant import FRAME, curl, release, segments_of, small_model, tilt
from tests.support.small_arm import small_spec
from trunkline.arm.holes import Holes, add_holes
from trunkline.arm.joints import Branch, Joints, Slider, add_elements
from trunkline.elements import arm_hinges, cables
from trunkline.identification.evaluation import (
    Prediction,
    halved_step,
    period_error,
    replay,
    scores,
    segment_positions,
)
from trunkline.identification.experiment import own_starts, prepare
from trunkline.identification.loss import LossWeights
from trunkline.identification.parameters import candidate_fields, set_fields

WEIGHTS = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.03)


def test_only_trials_in_motion_have_a_velocity():
    model = small_model(4)
    experiments = [prepare(trial, model, 20) for trial in (release(model, 0.2, frames=30), tilt(model, 30))]
    for order in (experiments, experiments[::-1]):
        found = scores(replay(model, order, segments_of(model)), order, "positions", WEIGHTS)["identify"]
        kinds = found["by_experiment"]
        assert "e_velocity_mm_s" not in kinds["static_tilt"]
        assert found["e_velocity_mm_s"] == kinds["release"]["e_velocity_mm_s"]


def test_half_the_step_moves_little_with_every_option_on():
    """Branches, sliders, holes, dead time, lag, rate limit and backlash, on a curl of an arm that has none of them but
    the lag: with an error like that of an identified arm, at the pipeline's step."""
    spec, plant = small_spec(6, dead_time=0.02, rate_limit=0.25, backlash=3e-4), small_model(6)
    add_elements(spec, Joints([Branch(0.3, 0.1), Branch(0.2, 1.0)], [Slider(0.2, 0.02), Slider(0.1, 0.05)]), 1e-5)
    add_holes(spec, Holes(0.2, 4))
    spec.option.timestep = FRAME / 4
    model = spec.compile()
    model.dof_damping[: arm_hinges(model)] *= 4  # as the plant's
    model.tendon_frictionloss[cables(model)] = plant.tendon_frictionloss[:] = 0
    experiments = [prepare(curl(plant, 30, frames=90), model, 90)]
    found, halved = (Prediction(replay(model, experiments, segments_of(model), f), experiments) for f in (1.0, 0.5))
    assert 0.3 < found.scores()["identify"]["e_internal_mm"] < 1.0  # 1 mm is 0.2 % of the arm's length
    change = halved_step(found, halved)
    assert 0 < change["identify"] < 0.05
    assert 0 < change["tip"]["identify"] < 0.05


def test_trials_that_a_model_does_not_survive_are_counted():
    model = small_model(4)
    experiments = [prepare(release(model, angle, frames=20), model, 20) for angle in (0.2, 0.3)]
    found = replay(model, experiments, segments_of(model))
    assert found.diverged == 0
    found.positions[1][-1, 0] = np.nan
    assert found.diverged == 1
    assert scores(found, experiments, "positions", WEIGHTS)["identify"]["e_position_mm"] > 1


def test_every_model_starts_where_its_own_geometry_puts_the_arm():
    cad, bent = small_model(4), small_model(4)
    set_fields(bent, candidate_fields(cad, {"joint_place": np.array([0.5])}))
    trials = [release(bent, 0.2, frames=20), tilt(bent, 30)]
    experiments = [prepare(trial, bent, 20) for trial in trials]
    own = own_starts(experiments, trials, bent, cad)
    off = [
        np.linalg.norm(segment_positions(cad, segments_of(cad), e.start) - trials[0].positions[0], axis=1).mean()
        for e in (own[0], experiments[0])
    ]
    assert off[0] < 0.5 * off[1]
    assert own[1] is experiments[1]
    assert own_starts(experiments, trials, bent, bent.__copy__()) is experiments


@pytest.mark.parametrize("longer", [1.0, 1.01, 0.98, 1.05])
def test_the_period_of_a_swing_that_dies_away(longer):
    """As a release: four to five swings, of which the cameras miss a part."""
    time = np.arange(437) / 120

    def swing(period: float) -> np.ndarray:
        wave = np.exp(-0.6 * time) * np.cos(2 * np.pi * time / period)
        return 0.1 * wave[:, None] * [0.6, 0.0, 0.8] + [0.0, 0.3, -0.4]

    measured = np.ones(437, dtype=bool)
    measured[100:110] = False
    real = np.where(measured[:, None], swing(0.8), np.nan)
    assert period_error(swing(0.8 * longer), real, measured) == pytest.approx(abs(longer - 1), abs=2e-3)


def test_a_swing_is_compared_about_where_each_trial_rests():
    model = small_model(4)
    (experiment,) = [prepare(release(model, 0.2, frames=437), model, 437)]
    time = experiment.frame_step * np.arange(len(experiment.positions))
    wave = (np.exp(-4 * time) * np.cos(8 * time))[:, None, None] * 0.05
    experiment.positions = experiment.positions[-1:] + wave
    moved = experiment.positions + [0.003, 0.004, 0.0]
    found = replay(model, [experiment], segments_of(model))
    found.positions[0] = moved
    row = scores(found, [experiment])["identify"]
    assert row["e_position_mm"] == pytest.approx(5.0)
    assert row["e_tip_about_rest_mm"] == pytest.approx(0.0, abs=1e-9)
    assert row["e_late_speed_pct"] == pytest.approx(0.0, abs=1e-6)
    found.positions[0] = moved + 0.5 * wave
    row = scores(found, [experiment])["identify"]
    assert row["e_late_speed_pct"] == pytest.approx(50.0)
    off = 500 * np.sqrt(3) * np.abs(wave[:, 0, 0] - wave[-60:].mean()).mean()
    assert row["e_position_about_rest_mm"] == pytest.approx(off, rel=0.01)
    experiment.positions = experiment.positions + 0.01 * np.sin(8 * time)[:, None, None]
    assert "e_late_speed_pct" not in scores(found, [experiment])["identify"], "this arm never rests"


def test_an_arm_that_hangs_still_has_no_period():
    model = small_model(4)
    experiments = [prepare(release(model, 0.2, frames=60), model, 60)]
    found = replay(model, experiments, segments_of(model))
    assert "e_swing_period_pct" in scores(found, experiments)["identify"]
    found.positions[0][:] = found.positions[0][:1]
    assert "e_swing_period_pct" not in scores(found, experiments)["identify"]
