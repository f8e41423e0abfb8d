"""What a certificate's radius counts: draws that find no rest, and what other sources make of a held-out trial."""

from dataclasses import replace

import numpy as np
import pytest

from tests.report.certificate.test_budget import mounts, nothing_known, straight
from tests.support.matched_plant import small_model, static_pull, tilt
from tests.support.twins import twin_of
from trunkline.identification.simulate.experiment import SLACK
from trunkline.recordings.trials.conditions import Conditions
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE
from trunkline.report.certificate import budget as budgets
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.budget import (
    Inputs,
    UncertaintySource,
    budget,
    held_out,
    parameter_shifts,
    radius_of,
    sure_pulls,
)
from trunkline.report.certificate.certificate import FEWEST, inputs_of
from trunkline.report.certificate.facts import uncertainty_facts
from trunkline.report.certificate.held_out import at_rest, tip_residuals
from trunkline.report.certificate.poses import StaticPoses
from trunkline.report.certificate.words import open_lines
from trunkline.twin.posterior import Posterior

NOISE = 1e-3  # m


@pytest.fixture(scope="module")
def model():
    model = small_model(3)
    model.tendon_frictionloss[:] = 0
    return model


def along_x(distances) -> np.ndarray:
    """Offsets (D, 1, 3) of these lengths, m."""
    return np.array(distances, dtype=float)[:, None, None] * np.array([1.0, 0, 0])


@pytest.mark.parametrize(
    ("lost", "radius"),
    [(0, 96.0), (1, 97.0), (4, 100.0), (5, np.inf), (6, np.inf), (100, np.inf)],
)
def test_a_draw_without_rest_is_as_far_away_as_can_be(lost, radius):
    """Of 100 draws at 1, 2, 3 ... m, the first find no rest: 95 of 100 must lie within."""
    distances = np.arange(1.0, 101.0)
    distances[:lost] = np.nan
    assert radius_of(along_x(distances))[0] == radius


def test_a_radius_holds_95_of_100_draws_and_no_more_than_it_needs():
    offsets = np.random.default_rng(0).normal(size=(400, 5, 3))
    radius = radius_of(offsets)
    inside = (np.linalg.norm(offsets, axis=2) <= radius).mean(axis=0)
    assert ((inside >= 0.95) & (inside < 0.956)).all()


def test_a_pose_whose_draws_find_no_rest_is_counted_and_not_averaged(model):
    lines = [UncertaintySource("cameras", "normal", 1.0, "mm", np.inf, np.full(3, NOISE))]
    result = budgets.Budget(np.zeros((3, 3)), lines, np.zeros(3), np.array([0.004, np.inf, 0.008]))
    facts = uncertainty_facts(result, Conditions(0.0, 0.0, 0.0, 0.0), 0.5, 100)
    assert (facts["poses"], facts["without_rest"]) == (3, 1)
    assert facts["radius_mm"] == pytest.approx({"median": 6.0, "p95": 7.8, "max": 8.0})
    assert np.isfinite(facts["combined_mm"])


def hanging(model, count=1) -> StaticPoses:
    chain = arm_of(model).chain
    return StaticPoses(np.tile([0.0, 0.0, -9.81], (count, 1)), np.tile(chain.straight_lengths + SLACK, (count, 1)))


def pulled(model) -> StaticPoses:
    chain = arm_of(model).chain
    return StaticPoses(np.array([[0.0, 0.0, -9.81]]), chain.straight_lengths - np.array([[0.015, -SLACK, -SLACK]]))


def rubbing(model):
    other = model.__copy__()
    other.tendon_frictionloss[:] = 0.3
    return other


SOURCES = {
    "cameras": (False, False, NOISE, straight),
    "parameters": (False, True, 0.0, straight),
    "friction": (True, False, 0.0, pulled),
    "all": (True, True, NOISE, pulled),
}


@pytest.mark.parametrize(("rubs", "uncertain", "noise", "poses"), SOURCES.values(), ids=SOURCES)
def test_other_sources_make_of_a_held_out_trial_what_they_make_of_any_pose(
    model, monkeypatch, rubs, uncertain, noise, poses
):
    """Their variance is u² of the budget: else what is not theirs goes to what the model lacks, or what it lacks to
    them."""
    model = rubbing(model) if rubs else model
    parameters = mounts(0.0) if uncertain else nothing_known()
    moves = budgets.sensitivities(model, parameters, arm_of(model), poses(model))  # of tilts as small, all that is left
    drawn = np.random.default_rng(2).standard_normal((20_000, len(moves)))
    monkeypatch.setattr(budgets, "parameter_shifts", lambda *_: np.einsum("dp,pnk->dnk", drawn, moves))
    variances_seen = []
    monkeypatch.setattr(budgets, "discrepancy", lambda residuals, ways, variances: variances_seen.append(variances))
    held_out(model, parameters, noise, poses(model), np.array([0.01]), 2, np.random.default_rng(0))
    alone = budget(Inputs(model, parameters, None, noise), poses(model), 20_000, 1, np.random.default_rng(1))
    assert alone.combined[0] > 5e-4
    np.testing.assert_allclose(variances_seen[0], alone.combined**2, rtol=0.05)


def test_a_draw_of_the_parameters_without_rest_takes_no_part_in_their_variance(model, monkeypatch):
    shifts = np.zeros((3, 1, 3))
    shifts[:, 0, 0] = [0.003, np.nan, 0.004]
    variances_seen = []
    monkeypatch.setattr(budgets, "parameter_shifts", lambda *_: shifts)
    monkeypatch.setattr(budgets, "discrepancy", lambda residuals, ways, variances: variances_seen.append(variances))
    held_out(model, nothing_known(), 0.0, straight(model), np.array([0.01]), 3, np.random.default_rng(0))
    assert variances_seen[0][0] == pytest.approx((0.003**2 + 0.004**2) / 2)


def test_an_arm_that_finds_no_rest_moves_by_nobody_knows_what(model, monkeypatch):
    """Through the whole budget: of 40 draws, 3 find none, which is more than 5 of 100."""
    count = 40
    shifts = np.zeros((count, 1, 3))
    shifts[:3] = np.nan
    monkeypatch.setattr(budgets, "parameter_shifts", lambda *_: shifts)
    result = budget(Inputs(model, nothing_known(), None, NOISE), straight(model), count, 1, np.random.default_rng(0))
    assert result.radius[0] == np.inf
    shifts[1:3] = 0
    result = budget(Inputs(model, nothing_known(), None, NOISE), straight(model), count, 1, np.random.default_rng(0))
    assert 2 * NOISE < result.radius[0] < 5 * NOISE


def test_shifts_are_nan_where_a_drawn_arm_does_not_come_to_rest(model):
    """Springs of nothing at all hold no arm upside down."""
    far = np.full(1, 1e9)
    estimates = Posterior(["stiffness"], ["a"], np.log([1e-9]), np.array([1e-3]), far, np.eye(1), -far, far)
    arm = arm_of(model)
    up = StaticPoses(np.array([[3.0, 0.0, 9.0]]), arm.chain.straight_lengths[None] + SLACK)
    shifts = parameter_shifts(model, estimates, arm, up, 2, np.random.default_rng(0))
    assert shifts.shape == (2, 1, 3)
    assert not np.isfinite(shifts).any() or np.abs(shifts).max() > 0.05


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({}, True),
        ({"split": IDENTIFY}, False),
        ({"split": TEST}, False),
        ({"load": 0.05}, False),
        ({"experiment": "release"}, False),
        ({"measured": np.zeros((1, 4), bool)}, False),
        ({"measured": np.array([[True, False, False, False]])}, True),
    ],
)
def test_only_seen_trials_at_rest_that_were_held_out_and_bore_nothing_tell_what_the_model_lacks(change, counts):
    trial = replace(tilt(small_model(4), 30, VALIDATE), **change)
    assert (at_rest([trial]) == [trial]) is counts


def test_a_tip_that_nobody_saw_or_that_finds_no_rest_has_no_residual():
    model = small_model(4)
    measured = static_pull(model, [0, 15, 0], split=VALIDATE)
    moved = replace(measured, name="moved", positions=measured.positions + [0.003, 0, 0.004])
    hidden = replace(measured, name="hidden", measured=np.array([[True, True, True, False]]))
    lost = replace(measured, name="lost", commands=np.full((1, 3), np.nan))
    residuals = tip_residuals(model, [moved, hidden, lost, measured], 3)
    assert np.linalg.norm(residuals[0]) == pytest.approx(0.005, abs=5e-4)
    assert np.isnan(residuals).all(axis=1).tolist() == [False, True, True, False]
    assert np.linalg.norm(residuals[3]) < 1e-3


@pytest.mark.parametrize(("count", "usable"), [(FEWEST - 1, False), (FEWEST, True)])
def test_so_many_held_out_tips_must_have_been_seen(count, usable):
    model = small_model(4)
    trials = [tilt(model, angle, VALIDATE) for angle in (20, 30, 40, 50)]
    for trial in trials[count:]:
        trial.measured[:, 3] = False
    ingested = {"position_noise_mm": 0.3}
    inputs = inputs_of(twin_of(model), trials, ingested, 2, np.random.default_rng(0))
    assert (inputs.lacking is not None) is usable
    assert inputs.lacking is None or inputs.lacking.trials == count


ROW = {"at_bound": False, "undetermined": False, "interval_95_given_model": [-0.02, 0.03], "range": [-0.1, 0.1]}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, None),
        ({"interval_95_given_model": [-0.1, 0.03]}, "to one side alone"),
        ({"interval_95_given_model": [-0.02, 0.1]}, "to one side alone"),
        ({"interval_95_given_model": [-0.0999, 0.0999]}, None),
        ({"interval_95": [-0.1, 0.03]}, "to one side alone"),
        ({"interval_95_given_model": [-0.1, 0.03], "interval_95": [-0.09, 0.09]}, None),
        ({"undetermined": True}, "is not determined"),
        ({"undetermined": True, "interval_95_given_model": [-0.1, 0.1]}, "is not determined"),
        ({"at_bound": True}, "ended on a bound"),
        ({"at_bound": True, "undetermined": True}, "ended on a bound"),
    ],
)
def test_what_is_open_is_said_for_one_reason_the_first(change, says):
    lines = open_lines({"parameters": {"mount_tilt_x": ROW | change}})
    assert len(lines) == (says is not None)
    assert says is None or f"mount_tilt_x {'is told ' if 'side' in says else ''}{says}" in lines[0]


@pytest.mark.parametrize(
    ("radius", "most"),
    [([1, 1, 1, 1, 1, 1, 1, 1, 1, 1], 10), ([1, 1, 1, 1, 1, 1, 1, 1, 1, 9], 10), ([1, 1, 9, 1, 1, 1, 1, 1, 9, 9], 2),
     ([9, 1, 1, 1, 1, 1, 1, 1, 1, 1], 10), ([9, 9, 1, 1, 1, 1, 1, 1, 1, 1], 0), ([np.inf] * 10, 0), ([], 0)],
)  # fmt: skip
def test_pulls_are_sure_as_far_as_nine_of_ten_poses_with_less_are_near_enough(radius, most):
    """Poses of 1 to 10 mm of pull, in any order; 5 mm are near enough. Poses without pull say nothing of pulls."""
    radius = np.array([*radius, *[1] * 50], float)
    pulls = np.concatenate([1.0 + np.arange(len(radius) - 50), np.zeros(50)])
    order = np.random.default_rng(0).permutation(len(radius))
    assert sure_pulls(1e-3 * pulls[order], 1e-3 * radius[order], 5e-3) == pytest.approx(1e-3 * most)
