"""Errors of a session whose trials are at rest and in motion."""

import numpy as np
import pytest

from tests.support.matched_plant import FRAME, curl, markers_of, release, small_model, tilt
from tests.support.noisy_trials import WEIGHTS, with_values
from tests.support.small_arm import small_spec
from tests.support.swings import FRAMES, LIKE, STEP, TIME, TIP, experiment, swing
from trunkline.identification.evaluation.evaluation import (
    Prediction,
    errors_of,
    halved_step,
    marker_positions,
    period_error,
    replay,
    scores,
)
from trunkline.identification.simulate.experiment import own_starts, prepare
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement, add_elements
from trunkline.model.arm_model import ArmModel


def test_half_the_step_moves_little_with_every_option_on():
    """Branches, sliders, holes, dead time, lag, rate limit and backlash, on a curl of an arm that has none of them but
    the lag: with an error like that of an identified arm, at the pipeline's step."""
    spec, plant = small_spec(6, dead_time=0.02, rate_limit=0.25, backlash=3e-4), small_model(6)
    maxwell = [MaxwellElement(0.3, 0.1), MaxwellElement(0.2, 1.0)]
    jenkins = [JenkinsElement(0.2, 0.02), JenkinsElement(0.1, 0.05)]
    add_elements(spec, Joints(maxwell, jenkins), 1e-5)
    add_holes(spec, GuideHoles(0.2, 4))
    spec.option.timestep = FRAME / 4
    model = spec.compile()
    model.dof_damping[: ArmModel(model).hinge_count] *= 4  # as the plant's
    model.tendon_frictionloss[ArmModel(model).cables] = plant.tendon_frictionloss[:] = 0
    experiments = [prepare(curl(plant, 30, frames=90), model, 90)]
    full, halved = (Prediction(replay(model, experiments, markers_of(model), f), experiments) for f in (1.0, 0.5))
    assert 0.3 < full.scores()["identify"]["e_internal_mm"] < 1.0  # 1 mm is 0.2 % of the arm's length
    change = halved_step(full, halved)
    assert 0 < change["identify"] < 0.05
    assert 0 < change["tip"]["identify"] < 0.05


def test_trials_that_a_model_does_not_survive_are_counted():
    model = small_model(4)
    experiments = [prepare(release(model, angle, frames=20), model, 20) for angle in (0.2, 0.3)]
    replayed = replay(model, experiments, markers_of(model))
    assert replayed.diverged == 0
    replayed.positions[1][-1, 0] = np.nan
    assert replayed.diverged == 1
    assert scores(replayed, experiments, "positions", WEIGHTS)["identify"]["e_position_mm"] > 1


def test_every_model_starts_where_its_own_geometry_puts_the_arm():
    cad = small_model(4)
    bent = with_values(cad, {"joint_place": 0.5})
    trials = [release(bent, 0.2, frames=20), tilt(bent, 30)]
    experiments = [prepare(trial, bent, 20) for trial in trials]
    started = own_starts(experiments, trials, bent, cad)
    off = [
        np.linalg.norm(marker_positions(cad, markers_of(cad), e.start) - trials[0].positions[0], axis=1).mean()
        for e in (started[0], experiments[0])
    ]
    assert off[0] < 0.5 * off[1]
    assert started[1] is experiments[1]
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
    replayed = replay(model, [experiment], markers_of(model))
    replayed.positions[0] = moved
    row = scores(replayed, [experiment])["identify"]
    assert row["e_position_mm"] == pytest.approx(5.0)
    assert row["e_tip_about_rest_mm"] == pytest.approx(0.0, abs=1e-9)
    assert row["e_late_speed_pct"] == pytest.approx(0.0, abs=1e-6)
    replayed.positions[0] = moved + 0.5 * wave
    row = scores(replayed, [experiment])["identify"]
    assert row["e_late_speed_pct"] == pytest.approx(50.0)
    off = 500 * np.sqrt(3) * np.abs(wave[:, 0, 0] - wave[-60:].mean()).mean()
    assert row["e_position_about_rest_mm"] == pytest.approx(off, rel=0.01)
    experiment.positions = experiment.positions + 0.01 * np.sin(8 * time)[:, None, None]
    assert "e_late_speed_pct" not in scores(replayed, [experiment])["identify"], "this arm never rests"


def faster(begin: float, end: float, factor: float) -> np.ndarray:
    """The swing, with a tip that moves `factor` times as fast from one time to another, s."""
    steps = np.diff(swing(), axis=0)
    steps[round(begin / STEP) : round(end / STEP), TIP] *= factor
    return np.concatenate([swing()[:1], swing()[0] + np.cumsum(steps, axis=0)])


@pytest.mark.parametrize(
    ("begin", "end", "factor", "expected"),
    [
        (0.0, 1.0, 3.0, 0.0),  # only before
        (1.0, 1.99, 1.5, 50.0),
        (1.0, 1.99, 0.25, 75.0),
        (2.0, 2.5, 5.0, 0.0),  # only after
    ],
)
def test_the_late_speed_is_that_of_the_second_second(begin, end, factor, expected):
    """Of a swing that does not do the same all along."""
    row = errors_of(faster(begin, end, factor), experiment(swing()), LIKE, None, None)
    assert row["e_late_speed_pct"] == pytest.approx(expected, abs=1e-9)


def off_at(rows: slice, *markers: int) -> np.ndarray:
    measured = np.ones((FRAMES, 3), bool)
    measured[rows, markers] = False
    return measured


def ends_with(swing_mm: float) -> np.ndarray:
    """A swing whose tip still moves by so much in its last half second."""
    positions = np.where((TIME < 2.0)[:, None, None], swing(), swing()[-1])
    positions[-1, TIP, 1] += swing_mm / 1e3
    return positions


REST = {"e_position_about_rest_mm", "e_tip_about_rest_mm"}
LATE = {"e_late_speed_pct"}


@pytest.mark.parametrize(
    ("positions", "measured", "expected"),
    [
        (swing(), None, REST | LATE),
        (ends_with(1.999), None, REST | LATE),
        (ends_with(2.001), None, set()),
        (ends_with(2.001), off_at(slice(-1, None), TIP), REST | LATE),  # nobody saw that it moved
        (swing(), off_at(slice(-50, None), TIP), set()),  # where it rests is not known
        (swing(), off_at(slice(-50, None), 0), set()),
        (swing(), off_at(slice(-49, None), 0), REST | LATE),
        (swing(), off_at(slice(100, 101), TIP), REST),
        (swing(), off_at(slice(199, 200), TIP), REST),
        (swing(), off_at(slice(99, 100), TIP), REST | LATE),
        (swing(), off_at(slice(200, 201), TIP), REST | LATE),
        (swing(), off_at(slice(100, 200), 0, 1), REST | LATE),  # it is the tip's
        (swing()[:100] * [1, 1, 0] + swing()[-1] * [0, 0, 1], None, set()),  # over before it is late
    ],
)
def test_a_swing_is_compared_about_its_rest_only_where_that_is_known(positions, measured, expected):
    row = errors_of(positions, experiment(positions, measured), LIKE, None, None)
    assert {name for name in row if "about_rest_mm" in name or "late" in name} == expected


@pytest.mark.parametrize(
    ("kind", "step", "frames", "expected"),
    [
        ("release", STEP, FRAMES, {"velocity", "period"}),
        ("curl", STEP, FRAMES, {"velocity"}),  # pulled, it does not swing by itself
        ("release", 0.0, FRAMES, set()),  # frames from here and there
        ("static_path", 0.0, FRAMES, set()),
        ("release", STEP, 1, set()),
    ],
)
def test_only_what_follows_in_time_has_a_velocity_and_only_what_hangs_a_period(kind, step, frames, expected):
    positions = swing()[:frames]
    row = errors_of(positions, experiment(positions, kind=kind, frame_step=step), LIKE, None, None)
    assert {word for word in ("velocity", "period") if any(word in name for name in row)} == expected


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_where_a_simulation_is_lost_it_is_the_arm_s_length_away(bad):
    """Along every axis, in every error, from there on."""
    real = np.zeros((FRAMES, 3, 3))
    simulated = real.copy()
    simulated[FRAMES // 2 :] = bad
    row = errors_of(simulated, experiment(real), LIKE, "positions", WEIGHTS)
    for name in ("e_internal", "e_position", "e_tip"):
        assert row[f"{name}_mm"] == pytest.approx(0.5 * 1e3 * np.sqrt(3) * LIKE.length)
        assert row[f"{name}_pct"] == pytest.approx(50 * np.sqrt(3))
    assert row["loss"] > 0
    assert np.isfinite(list(row.values())).all()
    assert "e_late_speed_pct" not in row, "an arm that stands still has no speed to be off from"


def test_an_arm_that_hangs_still_has_no_period():
    still = np.repeat(swing()[:1], FRAMES, axis=0)
    assert "e_swing_period_pct" not in errors_of(still, experiment(swing()), LIKE, None, None)
    assert "e_swing_period_pct" in errors_of(swing(), experiment(swing()), LIKE, None, None)
