"""What `ingest` and `filter` find in the recorded demo session, against its truth, which tests alone may read."""

import json

import numpy as np
import pytest

from tests.support.folders import demo_with
from tests.support.sessions import LIMITS
from trunkline.recordings.cleaning.clock_offset import align_clocks
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.filtering.filter import Filter, filter_raw_trial
from trunkline.recordings.session.session import read_session

TRIALS = ("curl_1_040", "curl_2_3_060", "motion_15_20_m2", "motion_5_40_1")
FILTER = Filter(120.0, 20.0, 4, 0.06, 8.0, "onset")


@pytest.fixture(scope="module")
def raw():
    return demo_with("data/raw/demo/session.yaml") / "data/raw"


@pytest.fixture(scope="module")
def recorded(raw):
    truth, session = json.loads((raw / "demo.truth.json").read_text()), read_session(raw / "demo")
    chosen = [trial for trial in session.trials if trial.name in TRIALS]
    taken = list(load_raw_trials(raw / "demo", session.model_copy(update={"trials": chosen}), LIMITS))
    takes, findings = [take for _, take, _ in taken], [findings for *_, findings in taken]
    assert {take.split for take in takes} == {"identify"}
    return truth, takes, findings, align_clocks(takes, findings, 0.1)


def test_the_clock_of_the_motors_is_right_within_its_uncertainty(recorded):
    truth, takes, findings, clock = recorded
    assert clock.by == "log times"
    assert abs(clock.offset + truth["clock_offset_s"]) < clock.uncertainty < 5e-3
    assert all(abs(take.clock_offset + truth["clock_offset_s"]) < clock.uncertainty for take in takes)
    motion = np.median([finding.by_motion.offset for finding in findings])
    assert abs(motion + truth["clock_offset_s"]) > 2 * abs(clock.offset + truth["clock_offset_s"])
    assert not any(finding.warnings for finding in findings)


def test_curls_and_motions_begin_when_their_commands_do(recorded):
    truth, takes, *_ = recorded
    for take in takes:
        trial, _ = filter_raw_trial(take, FILTER)
        assert abs(trial.start - truth["starts_s"][take.name]) < 3 * trial.start_sigma < 1 / 120


def test_releases_begin_when_the_arm_is_let_go(raw):
    """The arm of the lab leaves as a long beam does, not as a mass on a spring."""
    truth, session = json.loads((raw / "demo.truth.json").read_text()), read_session(raw / "demo")
    chosen = [t for t in session.trials if t.experiment == "release" and t.split == "identify"]
    for _, take, _ in load_raw_trials(raw / "demo", session.model_copy(update={"trials": chosen}), LIMITS):
        trial, _ = filter_raw_trial(take, FILTER)
        assert trial.start_sigma < 2 / 3 / 120  # as if the first guess, in whole frames, may be a frame off
        assert abs(trial.start - truth["starts_s"][take.name]) < min(2 * trial.start_sigma, 1 / 240)
