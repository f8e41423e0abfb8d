"""Inspecting logs: what it says is what the log holds, and what it proposes can be ingested."""

import re
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from mcap.writer import Writer
from scipy.spatial.transform import Rotation

from tests.recordings.logs.test_schemas import CASES, write
from tests.support.sessions import (
    MARKERS,
    all_truths,
    bent_truth,
    curl_truth,
    instruments,
    motion_truth,
    pull_truth,
    record,
    static_truth,
)
from tests.support.workbench import ROOT
from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.preparation.inspect import main
from trunkline.recordings.preparation.survey import _bodies
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
    path = write(tmp_path / "log.mcap", encoding, kind)
    _, proposed = inspect(capsys, path)
    (tmp_path / "session.yaml").write_text(proposed)
    session = read_session(tmp_path)
    if kind in ("array", "poses"):
        session.base = "1"
    ((_, raw, _),) = load_raw_trials(tmp_path, session, LIMITS)
    assert len(raw.markers) == 2, raw
    assert np.isfinite(raw.positions).any()


def test_a_level_is_the_largest_pull_in(tmp_path, capsys):
    """However far other tendons are let out, so that they stay slack."""
    truth = curl_truth(20.0)
    slack = truth.tendon_positions * [1, 0, 0] - [0, 0.05, 0.05] * (truth.tendon_positions[:, :1] > 0)
    record(tmp_path, [replace(truth, tendon_positions=slack, commands=slack[::5])], instruments())
    assert "experiment: curl, level: 20," in inspect(capsys, tmp_path)[1]


def test_up_is_where_arms_sag_from_and_levels_are_left_open_where_none_does(tmp_path, capsys):
    """With a guess of up, levels computed with it could not contradict it."""
    tilts = [static_truth(tilt) for tilt in (0.0, 30.0, 60.0)]
    for number, up in enumerate(((0, 1, 0), (0, 0, 1), (-1, 0, 0))):
        folder = tmp_path / str(number)
        record(folder, tilts, instruments(up=up))
        proposed = inspect(capsys, folder)[1]
        assert f"up: {list(up)}, unit: m}}\n" in proposed
        assert [line.split("level: ")[1][:2].strip(",") for line in proposed.splitlines() if "level: " in line] == [
            "0", "30", "60"]  # fmt: skip
    stiff = [bent_truth(t.name, "static_tilt", t.level, "identify", t.level, np.zeros(480), np.zeros((480, 3)))
             for t in tilts]  # fmt: skip
    record(tmp_path / "stiff", stiff, instruments())
    proposed = inspect(capsys, tmp_path / "stiff")[1]
    assert "level: " not in proposed
    assert "# Add the `level` that you set" in proposed
    (tmp_path / "stiff/session.yaml").write_text(proposed)
    with pytest.raises(InputError, match="level: missing, expected the nominal level of a static_tilt"):
        read_session(tmp_path / "stiff")


@pytest.mark.parametrize("factor", [1e3, 50.0, 0.0])
def test_a_level_that_is_no_pull_of_the_arm_is_left_open(tmp_path, capsys, factor):
    """As of motors that count mm, degrees or rad."""
    truth = curl_truth(20.0)
    strange = replace(truth, commands=factor * truth.commands, tendon_positions=factor * truth.tendon_positions)
    record(tmp_path, [strange, static_truth(0.0)], instruments(tendon_noise_mm=0.0))
    proposed = inspect(capsys, tmp_path)[1]
    (line,) = [line for line in proposed.splitlines() if "curl_20.mcap" in line]
    assert "experiment: curl, split" in line
    assert "# Add the `level` of each curl that has none, in mm: what its log holds is no pull of this arm" in proposed


def test_a_tilt_by_a_base_whose_axes_are_not_the_arms_is_left_open(tmp_path, capsys):
    turn = Rotation.from_euler("y", 90, degrees=True)
    truths = []
    for tilt in (0.0, 30.0, 60.0):
        truth = static_truth(tilt)
        base = Rotation.from_quat(truth.base_quaternion, scalar_first=True) * turn
        truths.append(replace(truth, base_quaternion=base.as_quat(scalar_first=True)))
    record(tmp_path, truths, instruments())
    proposed = inspect(capsys, tmp_path)[1]
    assert "up: [0, 1, 0]" in proposed
    assert "level: " not in proposed
    assert "no log tells it without a base whose z axis is back along the arm" in proposed


def test_logs_one_folder_down_are_found(tmp_path, capsys):
    """As `ros2 bag record` makes a folder for each; two of one name get names of their own."""
    record(tmp_path / "flat", [static_truth(0.0), static_truth(60.0)], instruments())
    for log in sorted((tmp_path / "flat").glob("*.mcap")):
        bag = tmp_path / "bags" / log.stem
        bag.mkdir(parents=True)
        log.rename(bag / "data_0.mcap")
    proposed = inspect(capsys, tmp_path / "bags")[1]
    assert "{file: tilt_00/data_0.mcap, name: tilt_00_data_0, experiment: static_tilt, level: 0" in proposed
    with pytest.raises(InputError, match=r"found 2 logs \(2 of them one folder down\) and no session.yaml, `trunkline"):
        read_session(tmp_path / "bags")
    (tmp_path / "bags/session.yaml").write_text(proposed)
    session = read_session(tmp_path / "bags")
    assert all(not isinstance(raw, Exception) for _, raw, _ in load_raw_trials(tmp_path / "bags", session, LIMITS))


def test_what_holds_nothing_is_an_error(tmp_path, capsys):
    assert main([str(tmp_path)]) == 1
    assert "found no log, nor one folder down" in capsys.readouterr().err
    (tmp_path / "tilt.bag.active").write_bytes(b"")
    assert main([str(tmp_path)]) == 1
    assert "found tilt.bag.active: `rosbag reindex` makes bags of them" in capsys.readouterr().err
    (tmp_path / "tilt.mcap.lz4").write_bytes(b"")
    assert main([str(tmp_path)]) == 1
    assert "found tilt.mcap.lz4: decompress them, as by `lz4 -d`" in capsys.readouterr().err
    with open(tmp_path / "empty.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    assert main([str(tmp_path)]) == 1
    assert "No log holds poses" in capsys.readouterr().err


def test_nothing_in_a_folder_is_left_out_without_a_word(tmp_path, capsys):
    record(tmp_path, [static_truth(0.0)], instruments())
    (log,) = tmp_path.glob("*.mcap")
    (tmp_path / "monday/morning").mkdir(parents=True)
    shutil.copy(log, tmp_path / "monday/morning/deep.mcap")
    for name in ("tilt.bag.active", "curl.mcap.lz4", "sizes.csv"):
        (tmp_path / name).write_bytes(b"1,2\n")
    with open(tmp_path / "empty.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    lines, proposed = inspect(capsys, tmp_path)
    for file, reason in {
        "tilt.bag.active": "`rosbag reindex`", "curl.mcap.lz4": "decompress them",
        "monday/morning/deep.mcap": "move them up", "sizes.csv": "`trunkline inspect`",
        f"{tmp_path}/empty.mcap": "no poses that can be read",
    }.items():  # fmt: skip
        assert re.search(rf"left out: {re.escape(file)}.*{re.escape(reason)}", lines), file
        assert file not in proposed
    left = ["curl.mcap.lz4", "empty.mcap", "monday/morning/deep.mcap", "tilt.bag.active"]
    assert read_session(tmp_path).unlisted == left


def test_a_unit_that_is_a_guess_is_said_to_be(tmp_path, capsys):
    truth = static_truth(0.0)
    far = {key: 100 * getattr(truth, key) for key in ("positions", "base_position")}
    record(tmp_path, [replace(truth, **far)], instruments())
    assert "unit: cm" in (proposed := inspect(capsys, tmp_path)[1])
    assert "mm for an arm of 40 mm, cm for an arm of 400 mm, inch for an arm of 1.02e+03 mm" in proposed


@pytest.mark.parametrize(("lost", "line"), [(False, "; they come at uneven times; "), (True, "; 2 frames missing in ")])
def test_in_a_log_that_is_thinned_out_no_frame_is_missing(lost, line):
    times = np.delete(np.arange(64), [20, 40]) * 0.05 if lost else np.cumsum(np.repeat([0.05, 0.267], 32))
    stamps = (1e9 * times).astype(np.int64)
    shape = (len(times), 1)
    poses = PoseStream(stamps, stamps, None, ("tip",), np.ones(shape, bool), np.zeros((*shape, 3)), None)
    assert line in _bodies(poses)[0]


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
