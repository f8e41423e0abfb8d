"""How far trials that should end alike end apart: by hand, on a noisy rest, and on a real arm."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.folders import ROOT, SHARED, with_recordings
from tests.support.matched_plant import release, small_model, tilt
from trunkline.identification.evaluation.repeatability import (
    SAME_GRAVITY,
    SAME_LOAD,
    _same,
    end_shape,
    repeatability,
)
from trunkline.identification.simulate.resting import LAST
from trunkline.pipeline.config import settings_of
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.session.session import read_session
from trunkline.recordings.trials.recording import LENGTH, PULLED

SAME_PULL = PULLED[LENGTH]


@pytest.fixture(scope="module")
def still():
    """A release that is over: 1.5 s in which nothing moves."""
    trial = release(small_model(4), 0.2, frames=180)
    return replace(trial, positions=np.broadcast_to(trial.positions[-1], trial.positions.shape).copy(), start=0.1)


def ends(still, shifts, **changes):
    """Trials whose tips end aside by `shifts`, m."""
    trials = []
    for number, shift in enumerate(shifts):
        positions = still.positions.copy()
        positions[:, -1, 0] += shift
        trials.append(replace(still, name=f"release_{number}", positions=positions, **changes))
    return trials


def test_the_scatter_of_three_ends_by_hand(still):
    table = repeatability(ends(still, (0.0, 0.003, 0.006)), tip=3)["release"]
    assert table["tip_mm"] == pytest.approx((3 + 0 + 3) / 3 * np.sqrt(3 / 2))
    assert table["tip_worst_mm"] == pytest.approx(3 * np.sqrt(3 / 2))
    assert table["mean_mm"] == pytest.approx(table["tip_mm"] / 4)
    assert (table["trials"], table["groups"]) == (3, 1)


def test_it_is_what_the_mean_of_many_would_be_off_however_few_there_are(still):
    rng = np.random.default_rng(1)
    drawn = rng.normal(0, 0.004, (400, 3))
    few = [repeatability(ends(still, row), tip=3)["release"]["tip_mm"] for row in drawn]
    assert np.mean(few) == pytest.approx(4 * np.sqrt(2 / np.pi), rel=0.05)  # of a normal variable's size


def test_only_trials_that_end_alike_are_compared(still):
    three = ends(still, (0.0, 0.003, 0.006))
    assert repeatability(three[:2], tip=3) == {}
    assert repeatability([*three[:2], replace(three[2], load=0.05)], tip=3) == {}


@pytest.mark.parametrize(
    ("change", "alike"),
    [
        ({}, True),
        ({"gravity": np.array([SAME_GRAVITY * 0.99, 0, 0])}, True),
        ({"gravity": np.array([0, -SAME_GRAVITY * 1.01, 0])}, False),
        ({"load": 0.99 * SAME_LOAD}, True),
        ({"load": 1.01 * SAME_LOAD}, False),
        ({"session": "another"}, False),
        ({"commands": np.array([[0, 0, 0.0], [0, 0.99 * SAME_PULL, 0]])}, True),
        ({"commands": np.array([[0, 0, 0.0], [0, 1.01 * SAME_PULL, 0]])}, False),
        ({"commands": np.array([[0, 0, 0.02], [0, 0, 0.0]])}, True),  # what was pulled before is over
        ({"commands": np.array([[0, 0, 0.0], [0, -0.3, -0.1]])}, True),  # slack is slack
        ({"tendons": ("a", "b", "other")}, False),
        ({"tendons": ()}, False),
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_each_of_what_acts_on_the_arm_tells_ends_apart(change, alike, turned):
    """By itself, up to its own tolerance, whichever of two trials comes first."""
    at_rest = tilt(small_model(4), 0)
    plain = replace(at_rest, tendons=("a", "b", "c"), commands=np.zeros((2, 3)), gravity=np.zeros(3))
    other = replace(plain, **change)
    assert _same(*((other, plain) if turned else (plain, other))) is alike


def test_without_tendons_trials_that_are_otherwise_alike_are(still):
    bare = replace(still, tendons=(), commands=np.zeros((2, 0)))
    assert _same(bare, replace(bare, name="another"))


@pytest.mark.parametrize(
    ("range_mm", "long", "ended"),
    [(0.0, LAST, True), (1.99, LAST, True), (2.01, LAST, False), (0.0, 0.98 * LAST, False)],
)
def test_a_trial_has_ended_that_was_still_for_long_enough(still, range_mm, long, ended):
    """Every coordinate of every marker within 2 mm in its last half second, all of it after the start."""
    positions = still.positions.copy()
    positions[-30, 2, 1] += range_mm / 1e3
    positions[: len(positions) // 2, 0, 0] += 0.1
    shape = end_shape(replace(still, positions=positions, start=still.time[-1] - long - 1e-9))
    assert (shape is not None) is ended


def test_where_a_marker_that_nobody_saw_ends_is_not_known(still):
    hidden = still.measured.copy()
    hidden[:, 1] = False
    shape = end_shape(replace(still, measured=hidden))
    assert np.isnan(shape[1]).all()
    assert np.isfinite(shape[[0, 2, 3]]).all()


@with_recordings
def test_a_real_hose_comes_to_rest_elsewhere_each_time(tmp_path):
    for log in (SHARED / "asl_trunk").glob("*.mcap"):
        (tmp_path / log.name).symlink_to(log)
    (tmp_path / "session.yaml").write_text((ROOT / "examples/asl_trunk/session.yaml").read_text())
    limits, settings = settings_of("ingest", ROOT).limits, settings_of("filter", ROOT / "examples/asl_trunk")
    trials = [
        filter_raw_trial(raw, settings)[0] for _, raw, _ in load_raw_trials(tmp_path, read_session(tmp_path), limits)
    ]
    table = repeatability(trials, tip=2)["release"]
    assert table["trials"] == 13
    assert 4 < table["tip_mm"] < 11
    assert table["mean_mm"] < table["tip_mm"] < table["tip_worst_mm"]
