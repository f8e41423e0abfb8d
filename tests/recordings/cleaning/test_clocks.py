"""Steps of one clock against the others: refused where time would bend, said where it would not."""

import re

import numpy as np
import pytest

from tests.support.sessions import LIMITS
from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.clocks import check_clocks
from trunkline.recordings.cleaning.trial_window import _log_fit
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.signals.steps import find_step

RATE, START = 120.0, 1_760_000_000_000_000_000


def log(seed=0, count=600, drop=0.02, drift=1e-4, stall=None, gap=None):
    """Clocks of a log: jittered stamps, late messages, dropped frames; a recorder that stalls, or a pause."""
    rng = np.random.default_rng(seed)
    frames = np.flatnonzero(rng.random(count) >= drop)
    if gap:
        frames[len(frames) // 2 :] += round(gap * RATE)
    time = frames / RATE
    logged = time * (1 + drift) + rng.exponential(3e-3, len(time))
    if stall:
        waits = (time > 2.0) & (time < 2.0 + stall)
        logged[waits] = 2.0 + stall
    stamps = START + np.round(1e9 * (time + rng.normal(scale=1e-3, size=len(time)))).astype(np.int64)
    logged = START + np.round(1e9 * np.maximum.accumulate(logged)).astype(np.int64)
    return frames.astype(np.int64), stamps, logged


def check(clock, frames, stamps, logged):
    empty = np.zeros((len(stamps), 0))
    poses = PoseStream(stamps, logged, frames, (), empty.astype(bool), np.zeros((len(stamps), 0, 3)), None)
    findings = Findings(logged=_log_fit(poses))
    check_clocks(poses, clock, LIMITS, "a.mcap: trial a: /poses", findings)
    return findings.warnings


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("clock", ["frame", "stamp", "log"])
def test_ordinary_logs_pass_whatever_dates_them(seed, clock):
    assert check(clock, *log(seed)) == []
    assert check(clock, *log(seed, gap=7.0)) == [], "a pause that all clocks show"
    assert check(clock, *log(seed, count=70)) == []


def test_a_recorder_that_stalls_for_a_while_is_no_step():
    for clock in ("frame", "stamp"):
        assert check(clock, *log(stall=0.5)) == []


def stepped(which, size):
    clocks = list(log())
    clocks[which][300:] += round(size * (RATE if which == 0 else 1e9))
    return clocks


NAMES = ("frame numbers", "stamps", "log times")


@pytest.mark.parametrize("size", [0.05, 0.3, 3600.0])
@pytest.mark.parametrize(("clock", "which"), [("frame", 0), ("frame", 1), ("stamp", 1), ("log", 2)])
def test_a_step_of_a_clock_that_is_used_is_refused(clock, which, size):
    with pytest.raises(InputError, match=r"a\.mcap: trial a: /poses: ") as error:
        check(clock, *stepped(which, size))
    match = re.search(rf"{NAMES[which]} jump by \+([\d.]+) s at message (\d+)", str(error.value))
    assert match, str(error.value)
    assert float(match[1]) == pytest.approx(size, abs=0.01, rel=2e-3)
    assert int(match[2]) == 300
    assert f"`clock: {clock}`" not in str(error.value), "another clock is to be taken"


@pytest.mark.parametrize(("clock", "which"), [("stamp", 0), ("stamp", 2), ("log", 0), ("log", 1), ("frame", 2)])
def test_a_step_of_a_clock_that_is_not_used_is_said(clock, which):
    warnings = check(clock, *stepped(which, 0.3))
    assert warnings
    for text in warnings:
        match = re.match(rf"{NAMES[which]} jump by \+([\d.]+) s at message 300, .*; left so, as `clock: {clock}`", text)
        assert match, text
        assert float(match[1]) == pytest.approx(0.3, abs=0.01)


def test_a_small_step_back_is_refused_too():
    frames, stamps, logged = log()
    stamps[300:] -= 60_000_000
    with pytest.raises(InputError, match=r"stamps jump by -0\.06\d? s|stamps jump by -0\.05\d s"):
        check("stamp", frames, stamps, logged)


def test_without_frame_numbers_the_unusual_interval_tells():
    _, stamps, logged = stepped(1, 0.3)
    with pytest.raises(InputError, match=r"stamps jump by \+0\.[23]"):
        check("stamp", None, stamps, logged)
    _, stamps, logged = stepped(2, 0.3)
    (warning,) = check("stamp", None, stamps, logged)
    assert warning.startswith("log times jump by +0.")


def test_log_times_that_went_back_interleave_and_are_refused():
    frames, stamps, logged = log()
    logged[300:] -= 1_000_000_000
    order = np.argsort(logged, kind="stable")  # as a log is read
    with pytest.raises(InputError, match=r"in the order of the log times, stamps run backwards by \d\.\d+ s"):
        check("log", frames[order], stamps[order], logged[order])


def test_another_rate_is_said():
    warnings = check("stamp", *log(drift=0.1))
    assert any("stamps run 9.1 % slower than log times" in text for text in warnings), warnings


def test_a_step_is_found_where_it_is():
    early = np.arange(400) / 100
    late = early * 1.0001 + 5.0
    assert find_step(late, early) is None
    late[123:] -= 0.2
    step = find_step(late, early)
    assert step is not None
    assert step.at == 123
    assert step.size == pytest.approx(-0.2, abs=2e-3)
    assert find_step(late[:15], early[:15]) is None
