"""Inspecting logs: what it says is what the log holds, and what it proposes can be ingested."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.recordings.logs.test_schemas import CASES, write_foxglove, write_ros
from tests.support.sessions import MARKERS, all_truths, instruments, motion_truth, pull_truth, record
from tests.support.workbench import ROOT
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.preparation.inspect import main
from trunkline.recordings.session.session import read_session

LIMITS = TrialLimits(duration=0.2, coverage=0.3, disorder=0.1, clock_offset=1.0)


def inspect(capsys, *paths) -> tuple[str, str]:
    """(description, proposed session.yaml)"""
    assert main([str(path) for path in paths]) == 0
    described, proposed = capsys.readouterr().out.split("Proposed session.yaml:\n")
    return described, proposed


def test_a_lab_session_is_described_and_its_proposal_is_the_session(tmp_path, capsys):
    record(tmp_path, [*all_truths(), pull_truth(), motion_truth()], instruments())
    right = read_session(tmp_path)
    described, proposed = inspect(capsys, tmp_path)
    assert "mocap4r2_msgs/msg/RigidBodies (cdr), poses: " in described
    assert "tilt_60.mcap" in described
    for name in ("base", *MARKERS):
        assert f"    {name:7}  seen in " in described
    (tmp_path / "session.yaml").write_text(proposed)
    session = read_session(tmp_path)
    assert session.frame.up == (0, 1, 0)
    assert (session.base, session.clock, session.topics) == (right.base, right.clock, right.topics)
    experiments = {trial.file: (trial.experiment, trial.level) for trial in session.trials}
    assert experiments == {trial.file: (trial.experiment, trial.level) for trial in right.trials}
    assert all(not isinstance(raw, Exception) for _, raw, _ in load_raw_trials(tmp_path, session, LIMITS))


def test_it_says_what_it_cannot_know(tmp_path, capsys):
    """Which way is up where the mount may be turned, and what motors wind in whose names are not those of tendons."""
    truth = motion_truth()
    motors = tuple(f"m{number + 1}" for number in range(len(truth.tendons)))
    record(tmp_path, [replace(truth, tendons=motors)], instruments())
    lines = inspect(capsys, tmp_path)[1].splitlines()
    assert sum("no log tells it of a mount that is turned" in line for line in lines) == 1
    (comment,) = [line for line in lines if "`motors` is to say what each winds in" in line]
    assert comment.startswith("#")
    assert "m1, m2, m3" in comment


def test_experiments_are_told_apart_without_names(tmp_path, capsys):
    """But for a motion, which could be a curl."""
    record(tmp_path, [*all_truths(), pull_truth()], instruments())
    right = {trial.file: trial for trial in read_session(tmp_path).trials}
    names = {}
    for index, path in enumerate(sorted(tmp_path.glob("*.mcap"))):
        names[f"take_{index}.mcap"] = path.name
        path.rename(tmp_path / f"take_{index}.mcap")
    (tmp_path / "session.yaml").write_text(inspect(capsys, tmp_path)[1])
    for trial in read_session(tmp_path).trials:
        assert trial.experiment == right[names[trial.file]].experiment
        if trial.level is not None:
            assert trial.level == pytest.approx(right[names[trial.file]].level, abs=1)


@pytest.mark.parametrize(("encoding", "kind"), CASES)
def test_every_schema_gets_a_proposal_that_is_read(tmp_path, capsys, encoding, kind):
    path = tmp_path / "log.mcap"
    write_ros(path, kind) if encoding == "ros" else write_foxglove(path, kind, encoding)
    _, proposed = inspect(capsys, path)
    (tmp_path / "session.yaml").write_text(proposed)
    session = read_session(tmp_path)
    if kind in ("array", "poses"):
        session.base = "1"
    if kind == "markers":
        assert session.base == "base"
    else:
        ((_, raw, _),) = load_raw_trials(tmp_path, session, LIMITS)
        assert len(raw.markers) == 2, raw
        assert np.isfinite(raw.positions).any()


def test_a_damaged_log_is_described_as_such(tmp_path, capsys):
    record(tmp_path, all_truths()[:1], instruments())
    (path,) = tmp_path.glob("*.mcap")
    path.write_bytes(path.read_bytes()[:-2000])
    assert "damaged: cut off at byte" in inspect(capsys, path)[0]
    path.write_bytes(b"nothing")
    assert main([str(path)]) == 1
    assert "found no MCAP file" in capsys.readouterr().err


def test_a_reader_that_has_had_enough_ends_it_quietly(tmp_path):
    record(tmp_path, all_truths()[:1], instruments())
    command = [sys.executable, "-m", "trunkline.recordings.preparation.inspect", str(tmp_path)]
    inspecting = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    inspecting.stdout.close()
    assert inspecting.stderr.read() == b""
