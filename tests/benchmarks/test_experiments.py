"""What machines did, done again from a session's log by another robot, and the page's hands."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.experiments.__main__ import counted, others
from benchmarks.experiments.at_page import hand_of
from benchmarks.experiments.judging import BEFORE, done_again
from rehearsal.experiments.result import Result, as_row
from rehearsal.session import RATE, REFERENCE
from studies.rows import Rows
from tests.ar.session.test_preview_validation import Clocked
from tests.ar.teleop.test_plan import START, STRAIGHT
from tests.rehearsal.test_session import THING, Sent
from tests.support.operator import Operator
from trunkline.ar.session.robot import RobotState
from trunkline.ar.teleop.messages import Controller
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from upkeep.origin import Origin, code_of, reads_of

ROOT = Path(__file__).parents[2]
BEGUN, MOVES, LASTS = 100.0, 2.0, 3.0  # s


def measured(now):
    """Joints, rad, and lengths of the cables, m, of the machines at `now`, s of the operator's clock."""
    gone = 0.1 * np.clip(now - MOVES, 0.0, 1.0)
    return START + gone, STRAIGHT - 0.1 * gone


def written(path, joints=True, moves=True):
    """A log in which the machines move by what they measure, and were sent something else."""
    poses = np.tile([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], (3, 1))
    with open(path, "wb") as file:
        journal, operator = Clocked(file), Operator()
        for now in np.arange(-0.5, LASTS + 0.5, 1 / 72):
            journal.time = BEGUN + now
            if abs(now) < 0.5 / 72:
                journal.event("mode", mode="aim", notice="", digest="")
            if moves and abs(now - MOVES) < 0.5 / 72:
                journal.event("mode", mode="execute", notice="", digest="")
            at, lengths = measured(now)
            journal.robot_state(RobotState(
                journal.time, 0.0, START + 1.0, STRAIGHT - 0.2, poses[0], poses, at if joints else None, lengths
            ))  # fmt: skip
            journal.step(1 / 60, operator.given, operator.step())
        journal.settle()
        journal.book.finish()
    return path


def session():
    package = SimpleNamespace(straight=STRAIGHT)
    return SimpleNamespace(robot=Sent(), package=package, place=lambda now: THING)


def test_the_stand_in_goes_where_the_machines_were_measured(tmp_path):
    staged = session()
    frames = done_again(staged, written(tmp_path / "run.mcap"), BEGUN)
    assert frames[0].now == pytest.approx(MOVES, abs=1 / RATE + 1 / 72)
    assert {frame.mode for frame in frames} == {"execute"}
    for frame in frames:
        joints, lengths = measured(frame.now - 0.5 / RATE)  # each is of the middle of its frame
        np.testing.assert_allclose(frame.joints, joints, atol=2e-3)
        np.testing.assert_allclose(frame.commands, lengths, atol=2e-4)
    assert len(staged.robot.sent) == pytest.approx(2 * RATE * (LASTS - MOVES + 0.5 + BEFORE), abs=4)


def test_machines_that_never_moved_have_no_frames(tmp_path):
    assert done_again(session(), written(tmp_path / "run.mcap", moves=False), BEGUN) == []


def test_a_log_without_what_was_measured_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="found no /joint_states or /tendons/state"):
        done_again(session(), written(tmp_path / "run.mcap", joints=False), BEGUN)


def test_a_hand_goes_to_the_page_in_the_base_frame():
    held = Controller((0.1, 0.2, -0.3), (1.0, 0.0, 0.0, 0.0), trigger=True)
    told, turn = hand_of(held), rotation_from_wxyz(np.array(REFERENCE.quaternion))
    np.testing.assert_allclose(told["position"], turn.apply(held.position) + REFERENCE.position)
    ray = rotation_from_wxyz(np.array(told["quaternion"])).apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(ray, turn.apply([0.0, 0.0, -1.0]), atol=1e-12)
    assert told["trigger"]
    assert not told["grip"]


def table(folder, code):
    return Rows("experiments", "package", "run", folder, Origin("aaaaaaa", "", {"trunkline/ar/session": code}))


def add(rows, name, seed, success):
    result = as_row(Result(name, seed, success, "" if success else "slip: out of the coil", tip_mm=2.5))
    rows.add(f"{name} {seed}", **{key: cell for key, cell in result.items() if key != "code"})


def test_a_run_that_is_repeated_does_not_replace_the_one_that_failed(tmp_path):
    rows = table(tmp_path, "now")
    for seed, success in ((0, True), (1, False), (1, True)):
        add(rows, "handle", seed, success)
    add(rows, "reach", 0, True)
    add(rows, "handle", 2, True)
    runs = counted(rows, "handle", 2)
    assert [(seed, run.success, run.cause) for seed, run in runs.items()] == [
        (0, True, ""), (1, False, "slip: out of the coil"),
    ]  # fmt: skip
    assert runs[0].tip_mm == 2.5
    assert np.isnan(runs[0].nearest_mm)
    line, told = others(rows, ["reach", "handle"])
    assert line == "4 rows, and 1 further attempts, which do not count"
    assert told == "successes of those that do not count: handle 1 of 1"


def test_runs_of_other_code_than_live_and_execution_have_now_do_not_count(tmp_path):
    for seed in range(4):
        add(table(tmp_path, "before"), "handle", seed, seed > 0)
    rows = table(tmp_path, "now")
    assert counted(rows, "handle", 20) == {}
    add(rows, "handle", 0, True)
    assert list(counted(rows, "handle", 20)) == [0]
    assert others(rows, ["handle"])[1] == "successes of those that do not count: handle 3 of 4"


def test_the_code_of_a_run_is_that_of_server_robot_and_benchmark():
    code = code_of(ROOT, ["benchmarks.experiments"], reads_of(ROOT, "experiments"))
    folders = {
        "benchmarks/experiments",
        "trunkline/ar/session",
        "trunkline/ar/drivers",
        "rehearsal/robot",
        "conf/live",
        "package",
    }
    assert folders <= set(code)
