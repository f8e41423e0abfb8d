"""What machines did, done again from a session's log by another robot, and the page's hands."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.experiments.at_page import hand_of
from benchmarks.experiments.judging import BEFORE, done_again
from rehearsal.session import RATE, REFERENCE
from tests.live.test_hindsight import Clocked
from tests.rehearsal.test_session import THING, Sent
from tests.support.operator import Operator
from tests.teleop.test_plan import START, STRAIGHT
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from trunkline.live.robot import Standing
from trunkline.teleop.messages import Controller

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
            journal.standing(Standing(
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
