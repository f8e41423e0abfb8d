"""The motors' clock: by log times where they tell, by the arm's motion where they do not, and trials that disagree."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recordings.cleaning.test_loading import one_trial
from tests.support.sessions import bent_truth, curl_truth, pull_truth, static_truth
from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.clock_offset import align_clocks
from trunkline.recordings.signals.clock import LoggedOffset, OffsetFit

LONGEST = 0.1


def lagging(lag=0.02):
    """A curl in which every part of the arm follows its tendons by `lag` s."""
    truth = curl_truth(split="identify")
    late = np.interp(truth.time - lag, truth.time, truth.tendon_positions[:, 0])
    return bent_truth("curl_40", "curl", 40.0, "identify", 0.0, late / 0.03, truth.tendon_positions)


def copied(m):
    """As a converter writes a log that nobody recorded: each message is logged when it is stamped."""
    return replace(m, logged=m.stamps, command_logged=m.command_stamps, tendon_logged=m.tendon_stamps)


def silent(m):
    return replace(m, command_logged=m.command_logged[:0], command_stamps=m.command_stamps[:0], commands=m.commands[:0])


def clock_of(taken):
    raw, findings = taken
    return align_clocks([raw], [findings], LONGEST), raw, findings


@pytest.mark.parametrize("clock", ["frame", "stamp"])
def test_an_arm_that_lags_does_not_move_the_offset(tmp_path, clock):
    result, raw, findings = clock_of(one_trial(tmp_path, truth=lagging(), clock=clock))
    assert result.by == "log times"
    assert abs(result.offset + 0.137) < result.uncertainty < 5e-3
    assert raw.clock_offset == result.offset
    assert result.lag == pytest.approx(0.02, abs=4e-3)
    assert findings.warnings == []


def test_motion_decides_where_log_times_were_copied_and_its_lag_is_named(tmp_path):
    result, raw, findings = clock_of(one_trial(tmp_path, copied, lagging()))
    assert (result.by, result.uncertainty, result.lag) == ("motion", None, None)
    assert raw.clock_offset == result.offset == pytest.approx(-0.137 + 0.02, abs=4e-3)
    (warning,) = findings.warnings
    assert "is by the arm's motion, and its lag is in it; log times tell nothing" in warning


@pytest.mark.parametrize("late_ms", [-200, 200])
def test_log_times_that_cannot_be_true_of_an_arm_are_not_used(tmp_path, late_ms):
    """Two recorders, or a merged log: the motors' messages seem to be logged earlier or later than they were."""

    def shifted(m):
        m.command_logged[:] += late_ms * 1_000_000
        m.tendon_logged[:] += late_ms * 1_000_000

    result, _, findings = clock_of(one_trial(tmp_path, shifted, lagging()))
    assert result.by == "motion"
    assert result.offset == pytest.approx(-0.117, abs=4e-3)
    assert any("after its tendons, expected -0.03 to 0.1 s" in warning for warning in findings.warnings)


def test_motors_that_the_recorder_dates_need_no_motion(tmp_path):
    def unstamped(m):
        m.command_stamps[:] = m.tendon_stamps[:] = 0

    result, raw, _ = clock_of(one_trial(tmp_path, unstamped, lagging(0.0)))
    assert result.by == "log times"
    truth = np.interp(raw.tendon_time + result.offset - 0.3, [0, 0.9, 1.8], [0, 1, 0])
    assert np.corrcoef(truth, raw.tendon_positions[:, 0])[0, 1] > 0.9
    assert result.lag == pytest.approx(0.0, abs=5e-3), "within the delays of messages"
    result, raw, _ = clock_of(one_trial(tmp_path, unstamped, lagging(0.0), "log"))
    assert (result.by, result.offset, raw.clock_offset) == ("log times", 0.0, 0.0)
    assert 1e-3 < result.uncertainty < 6e-3


def test_a_trial_without_motion_tells_too_and_one_without_motors_has_nothing_to_say(tmp_path):
    result, _, findings = clock_of(one_trial(tmp_path, truth=pull_truth()))
    assert (result.by, result.lag) == ("log times", None)
    assert abs(result.offset + 0.137) < result.uncertainty
    result, _, findings = clock_of(one_trial(tmp_path, silent, static_truth(0.0)))
    assert result.by is None
    assert findings.warnings == []


def session(tmp_path, *rows):
    """Takes a, b, … with their findings, of (split, offset by log times, offset by motion)."""
    raw, _ = one_trial(tmp_path, truth=curl_truth())
    raw_trials = [replace(raw, name="abcdefgh"[i], split=split) for i, (split, *_) in enumerate(rows)]
    findings = [
        Findings(
            by_log_times=None if logged is None else LoggedOffset(logged, 2e-3),
            by_motion=None if moved is None else OffsetFit(moved, 0.01),
        )
        for _, logged, moved in rows
    ]
    clock = align_clocks(raw_trials, findings, LONGEST)
    return clock, [raw.clock_offset for raw in raw_trials], [f.warnings for f in findings]


def test_only_takes_for_identification_agree_on_the_clock(tmp_path):
    rows = ("identify", 0.1, 0.11), ("validate", 0.1015, 0.3), ("validate", None, 0.3)
    clock, used, remarks = session(tmp_path, *rows)
    assert (clock.offset, clock.lag) == (0.1, pytest.approx(0.01))
    assert used == [0.1, 0.1, 0.1], "one whose lag is not that of the others goes by them"
    assert ["in which the arm would lag" in " ".join(some) for some in remarks] == [False, True, False]
    clock, used, remarks = session(tmp_path, ("identify", None, None), ("validate", 0.3, None), ("validate", 0.3, None))
    assert (clock.offset, used) == (0.3, [0.3] * 3)
    assert all("no trial of the split identify tells" in some[0] for some in remarks)
    clock, used, remarks = session(tmp_path, ("identify", None, 0.1), ("validate", None, 0.3))
    assert (clock.by, clock.offset, used) == ("motion", 0.1, [0.1] * 2)


def test_clocks_that_drift_are_followed_and_trials_that_disagree_are_named(tmp_path):
    drift = [("identify", 0.1 + 0.004 * i, 0.11 + 0.004 * i) for i in range(5)]
    clock, used, remarks = session(tmp_path, *drift)
    assert used == pytest.approx([0.1, 0.104, 0.108, 0.112, 0.116])
    assert [bool(some) for some in remarks] == [True, True, False, True, True]
    assert len({some[0] for some in remarks if some}) == 1, "one sentence, which names all of them"
    clock, used, remarks = session(tmp_path, *[("identify", 0.1, 0.11)] * 4, ("identify", 0.5, 0.112))
    assert used == [0.1] * 5
    assert [bool(some) for some in remarks] == [False] * 4 + [True]
    assert "the motors' offset by log times is 0.500 s, in which the arm would lag by -0.388 s" in remarks[4][0]


def test_log_times_that_agree_are_not_overruled_by_the_motion(tmp_path):
    clock, used, remarks = session(tmp_path, *[("identify", 0.1, 0.6)] * 3)
    assert (clock.by, clock.offset, used) == ("log times", 0.1, [0.1] * 3)
    assert all("the log times of 3 trials agree on 0.100 s, which is used" in some[0] for some in remarks)


def test_an_uncertain_fit_of_the_motion_has_no_say(tmp_path):
    raw, findings = one_trial(tmp_path, copied, curl_truth(split="identify"))
    findings.by_motion = OffsetFit(-0.7, 0.9)
    clock = align_clocks([raw], [findings], LONGEST)
    assert (clock.by, clock.offset, raw.clock_offset) == (None, 0.0, 0.0)
    assert findings.warnings == ["clock: neither log times nor motion tell the motors' offset; it is taken for 0"]
