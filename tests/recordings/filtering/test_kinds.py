"""From logs to filtered trials: every kind, loads of its own and mounts at several angles."""

import numpy as np
import pytest

from tests.support.sessions import (
    CURL_BEGIN,
    LIMITS,
    PLAUSIBLE,
    all_truths,
    instruments,
    motion_truth,
    pull_truth,
    record,
)
from trunkline.frames import tilt_of_gravity
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import check_session
from trunkline.recordings.filtering.filter import Filter, filter_raw_trial
from trunkline.recordings.session.session import read_session

SETTINGS = Filter(rate=120, cutoff=20, order=4, longest_bridge=0.1, outlier_deviations=8, release="onset")


def test_static_pulls_motions_and_loads_come_through(tmp_path):
    pulls = (40.0, -20.0, -20.0)
    record(tmp_path, [*all_truths(), pull_truth(pulls, load=0.125), motion_truth(tilt_deg=50.0)], instruments())
    session = read_session(tmp_path)
    gathered = check_session(load_raw_trials(tmp_path, session, LIMITS), session, PLAUSIBLE, "stop", "here")
    trials = {trial.name: trial for trial in (filter_raw_trial(raw, SETTINGS)[0] for raw in gathered.raw_trials)}
    pull, motion = trials["pull_40_-20_-20"], trials["motion_identify"]
    assert {name: trial.load for name, trial in trials.items() if trial.load} == {pull.name: 0.125}
    assert pull.positions.shape[0] == len(pull.commands) == 1
    np.testing.assert_allclose(pull.commands[0], 1e-3 * np.array(pulls), atol=1e-6)
    assert motion.start == pytest.approx(CURL_BEGIN, abs=0.03)
    assert np.degrees(tilt_of_gravity(motion.gravity)) == pytest.approx(50, abs=0.5)
    assert np.degrees(tilt_of_gravity(pull.gravity)) == pytest.approx(0, abs=0.5)
