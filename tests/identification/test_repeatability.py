"""How far trials that should end alike end apart: by hand, on a noisy rest, and on a real arm."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.folders import SHARED, with_recordings
from tests.support.matched_plant import release, small_model
from trunkline.filtering.filter import filter_take
from trunkline.frames import gravity_in_base
from trunkline.identification.repeatability import end_shape, repeatability
from trunkline.pipeline.config import settings_of
from trunkline.sessions.session import read_session
from trunkline.takes.intake import take_in

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def still():
    """A release that is over: 1.5 s in which nothing moves."""
    trial = release(small_model(4), 0.2, frames=180)
    return replace(trial, positions=np.broadcast_to(trial.positions[-1], trial.positions.shape).copy(), start=0.1)


def ends(still, shifts, **changes):
    """Trials whose tips end aside by `shifts`, m."""
    found = []
    for number, shift in enumerate(shifts):
        positions = still.positions.copy()
        positions[:, -1, 0] += shift
        found.append(replace(still, name=f"release_{number}", positions=positions, **changes))
    return found


def test_the_scatter_of_three_ends_by_hand(still):
    found = repeatability(ends(still, (0.0, 0.003, 0.006)), tip=3)["release"]
    assert found["tip_mm"] == pytest.approx((3 + 0 + 3) / 3 * np.sqrt(3 / 2))
    assert found["tip_worst_mm"] == pytest.approx(3 * np.sqrt(3 / 2))
    assert found["mean_mm"] == pytest.approx(found["tip_mm"] / 4)
    assert (found["trials"], found["groups"]) == (3, 1)


def test_it_is_what_the_mean_of_many_would_be_off_however_few_there_are(still):
    rng = np.random.default_rng(1)
    drawn = rng.normal(0, 0.004, (400, 3))
    few = [repeatability(ends(still, row), tip=3)["release"]["tip_mm"] for row in drawn]
    assert np.mean(few) == pytest.approx(4 * np.sqrt(2 / np.pi), rel=0.05)  # of a normal variable's size


def test_only_trials_that_end_alike_are_compared(still):
    three = ends(still, (0.0, 0.003, 0.006))
    assert repeatability(three[:2], tip=3) == {}
    tilted = replace(three[2], gravity=gravity_in_base(np.radians(1.0)))
    loaded = replace(three[2], load=0.05)
    pulled = replace(three[2], commands=three[2].commands + [0.32, 0, 0])
    for other in (tilted, loaded, pulled):
        assert repeatability([*three[:2], other], tip=3) == {}
    slack = replace(three[2], commands=three[2].commands - 0.05)  # slack is slack, by however much
    assert "release" in repeatability([*three[:2], slack], tip=3)


def test_an_arm_that_still_moves_has_not_ended(still):
    swing = still.positions.copy()
    swing[:, -1, 0] += 0.0015 * np.sin(20 * still.time)
    assert end_shape(replace(still, positions=swing)) is None
    assert end_shape(replace(still, start=still.time[-1] - 0.2)) is None
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
    trials = [filter_take(take, settings)[0] for _, take, _ in take_in(tmp_path, read_session(tmp_path), limits)]
    found = repeatability(trials, tip=2)["release"]
    assert found["trials"] == 13
    assert 4 < found["tip_mm"] < 11
    assert found["mean_mm"] < found["tip_mm"] < found["tip_worst_mm"]
