"""How often a tip is where the certificate says: what counts as inside, which poses are asked for, and what is told."""

from dataclasses import replace

import numpy as np
import pytest

from tests.report.certificate.sample import ASKED, metrics, sample_trials, table
from tests.support.matched_plant import small_model
from tests.support.twins import twin_of
from trunkline.recordings.trials.conditions import Conditions
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.budget import COVERAGE, Budget, radius_of
from trunkline.report.certificate.certificate import certify
from trunkline.report.certificate.coverage import Coverage, covered, from_beyond, is_inside, share_of
from trunkline.report.certificate.discrepancy import discrepancy
from trunkline.report.certificate.page import _measured
from trunkline.report.certificate.poses import StaticPoses, draw_poses

CONDITIONS = Conditions(60.0, 0.0, 0.02, 0.03)


def stated(radius, tips=None) -> Budget:
    count = len(radius)
    return Budget(np.zeros((count, 3)) if tips is None else tips, [], np.zeros(count), np.array(radius, float))


@pytest.mark.parametrize(
    ("off", "radius", "expected"),
    [
        (0.009, 0.01, True),
        (0.01, 0.01, True),
        (0.0101, 0.01, False),
        (np.nan, 0.01, False),  # the arm did not rest
        (0.001, np.inf, False),  # the twin did not in more than 5 % of its draws: it states nothing
        (0.001, np.nan, False),
    ],
)
def test_only_a_tip_at_rest_within_a_radius_that_is_stated_counts(off, radius, expected):
    tips = np.array([[0.0, off, 0.0]])
    assert is_inside(tips, stated([radius])).tolist() == [expected]


def test_a_pose_in_which_the_twin_itself_finds_no_rest_is_outside():
    assert is_inside(np.zeros((1, 3)), stated([0.01], np.full((1, 3), np.nan))).tolist() == [False]


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"),
    [(95, 100, 0.888250, 0.978456), (10, 10, 0.722467, 1.0), (0, 10, 0.0, 0.277533)],
)
def test_the_interval_is_wilson_s(hits, count, low, high):
    """(p + z²/2n ± z sqrt(p (1 - p)/n + z²/4n²)) / (1 + z²/n) with z = 1.959964."""
    share = share_of(np.arange(count) < hits)
    assert share == pytest.approx({"share": hits / count, "low": low, "high": high, "poses": count}, abs=1e-6)


def test_pulled_poses_are_counted_apart():
    """Those that only hang are all inside, and carry the whole."""
    inside, pulled = np.array([True] * 5 + [False] * 5), np.arange(10) >= 4
    metrics = Coverage(inside, pulled).metrics()
    assert (metrics["share"], metrics["poses"], metrics["stated"]) == (0.5, 10, COVERAGE)
    assert (metrics["pulled"]["share"], metrics["pulled"]["poses"]) == (pytest.approx(1 / 6), 6)
    assert metrics["pulled"]["high"] < metrics["high"]
    assert "pulled" not in Coverage(inside, np.zeros(10, bool)).metrics()


@pytest.mark.parametrize("count", [0, 1, 7, 40])
def test_half_of_the_pulled_poses_come_from_beyond_and_none_that_hangs(count):
    pulled = np.arange(50) < count
    back = from_beyond(pulled, np.random.default_rng(3))
    assert back.sum() == count // 2
    assert not back[~pulled].any()


def test_most_poses_are_pulled_and_the_rig_is_sent_what_the_twin_is():
    """The rig is asked for pulls from the straight arm's path length, more than 0 for motors that pull."""
    chain, requests = arm_of(small_model(3)).chain, []
    poses = draw_poses(chain, CONDITIONS, 200, np.random.default_rng(0))

    def bring(pulls, gravity, back):
        requests.append((pulls, gravity, back))
        return np.zeros((len(pulls), 3))

    coverage = covered(chain, poses, stated(np.ones(200)), bring, np.random.default_rng(1))
    ((pulls, gravity, back),) = requests
    np.testing.assert_allclose(chain.straight_lengths - pulls, poses.commands)
    np.testing.assert_array_equal(gravity, poses.gravity)
    np.testing.assert_array_equal(coverage.pulled, (pulls > 0).any(axis=1))
    assert 0.7 < coverage.pulled.mean() < 0.9
    assert back.sum() == coverage.pulled.sum() // 2
    assert coverage.inside.all()


@pytest.fixture(scope="module")
def truth():
    return small_model(4)


@pytest.fixture(scope="module")
def certified(truth):
    """Of an arm that is its twin: what is found without a rig, and with one."""
    arm, trials = arm_of(truth), sample_trials(truth)

    def bring(pulls, gravity, back):
        return arm.tips(StaticPoses(gravity, arm.chain.straight_lengths - pulls))

    config, tables = replace(ASKED, covered=12, poses=4, arms=3), {"identify_stiffness": table(trials)}
    of = metrics(truth, trials)
    return [certify(config, twin_of(truth, tables), trials, of, rig) for rig in (None, bring)]


@pytest.mark.parametrize(("offset", "share"), [(0.0, 1.0), (0.5, 0.0)])
def test_an_arm_that_is_the_twin_is_inside_and_one_elsewhere_is_not(truth, offset, share):
    arm, rng = arm_of(truth), np.random.default_rng(2)
    poses = draw_poses(arm.chain, CONDITIONS, 12, rng)
    tips = arm.tips(poses)
    result = covered(arm.chain, poses, stated(np.full(12, 1e-3), tips), lambda *_: tips + [0, 0, offset], rng).metrics()
    assert (result["share"], result["pulled"]["share"], result["poses"]) == (share, share, 12)


def test_a_pose_in_which_the_arm_does_not_rest_tells_nothing_and_is_counted(truth):
    arm, rng = arm_of(truth), np.random.default_rng(2)
    poses = draw_poses(arm.chain, CONDITIONS, 12, rng)
    tips = arm.tips(poses)
    lost = np.where(np.arange(12)[:, None] < 5, np.nan, tips)
    coverage = covered(arm.chain, poses, stated(np.full(12, 1e-3), tips), lambda *_: lost, rng)
    metrics = coverage.metrics()
    assert (metrics["share"], metrics["poses"], metrics["unrested"]) == (1.0, 7, 5)
    assert len(coverage.pulled) == 7


def test_with_a_rig_the_share_is_a_metric_and_stands_beside_the_stated_one(certified):
    _, certificate = certified
    coverage = certificate.metrics["coverage"]
    assert coverage["share"] == 1.0
    assert coverage["poses"] == 12
    assert coverage["stated"] == certificate.facts["uncertainty"]["coverage"] == COVERAGE
    words = _measured(certificate.facts["uncertainty"])
    assert "100.0 % of 12 poses" in words
    assert "not come to rest" not in words
    moving = {"measured": coverage | {"unrested": 3}}
    assert "In 3 more poses the arm did not come to rest." in _measured(certificate.facts["uncertainty"] | moving)
    assert f"of {coverage['pulled']['poses']} poses with a pull" in words
    assert "stated 95 %" in words


def test_without_a_rig_nothing_is_measured_and_the_page_says_so(certified):
    certificate, _ = certified
    assert "coverage" not in certificate.metrics
    assert certificate.facts["uncertainty"]["measured"] is None
    assert "not measured" in _measured(certificate.facts["uncertainty"])


def test_what_is_measured_changes_nothing_else(certified):
    without, with_rig = (certificate.metrics for certificate in certified)
    assert {key: value for key, value in with_rig.items() if key != "coverage"} == without


def test_a_twin_without_rest_states_an_infinite_radius_and_the_others_theirs():
    """What the model lacks is drawn across the arm, and such a pose has none."""
    lacking = discrepancy(np.full(5, 0.005), np.full((5, 2), 0.1), np.full(5, 1e-6))
    ways, arms = np.array([[0.1, 0.1], [np.nan, np.nan]]), np.array([[0.0, 0.0, -0.5], [np.nan] * 3])
    radius = radius_of(lacking.offsets(ways, arms, 200, np.random.default_rng(0)))
    assert 0 < radius[0] < 0.1
    assert radius[1] == np.inf
