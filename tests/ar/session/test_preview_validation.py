"""Foresight against what happened, from a log whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.ar.session.written import NAMES, REAL, SUBJECT, Written
from tests.ar.teleop.test_plan import OFFSET, START, STRAIGHT
from tests.support.operator import Operator
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import messages
from trunkline.ar.session.log_reader import read_session_log
from trunkline.ar.session.preview_validation import Execution, _end, _grasped, executions, holds, lines, main
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.messages import ExecutorReport, Intent, WorldObject
from trunkline.kinematics.panda.kinematics import joint_frames, mount_pose

DIGEST, BEGIN, DELAY, OFF, LASTS, STEP = "d" * 64, 100.0, 0.04, 0.002, 2.0, 0.02
OFF_JOINT = 0.003 * np.eye(7)[3]  # rad, by which a real robot is elsewhere than previewed: across its way
CUP = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, (0.6, 0.0, 0.2))


def place(time):
    """Of the arm's last body, (T, 7): turned by half a turn about x, so that its tip is above it."""
    along = np.clip(np.asarray(time, float), 0.0, LASTS)
    zero = np.zeros_like(along)
    path = [0.5 + 0.2 * np.sin(along), 0.1 * along, 0.3 + zero, zero, zero + 1.0, zero, zero]
    return np.stack(path, axis=-1)


def joints(time):
    """The rigid robot's, rad (T, 7)."""
    return START + 0.3 * np.sin(np.clip(np.asarray(time, float), 0.0, LASTS))[..., None] * np.eye(7)[0]


def wrist(time):
    """Its last body, (T, 7)."""
    frame = joint_frames(joints(time))[-1]
    turns = Rotation.from_matrix(np.stack(frame[:3], axis=1).transpose(2, 0, 1))
    return np.concatenate([frame.p.T, turns.as_quat(scalar_first=True)], axis=1)


def recorded(path, probability=0.8, grasped=True, end=None, spread=0.01, measured=False, **hardware):
    """A log of one execution; `end`: s after which it was stopped; `measured`: whether the joints are."""
    log_writer, operator = Written(path, replace(SUBJECT, **hardware)), Operator()
    log_writer.time = 99.0
    tip = {"body": SUBJECT.tip[0], "place": SUBJECT.tip[1]}
    log_writer.event("begin", package="p", tip=tip, mount_offset=OFFSET, **hardware)
    log_writer.event("world", world=make_world((), (CUP,)))
    preview = messages.PreviewMessage(DIGEST, STEP, LASTS, STEP, (("approach", 0.0),))
    log_writer.event("preview", preview=preview)
    times = np.arange(1, round(LASTS / STEP) + 1) * STEP
    for first in range(0, len(times), 20):
        piece = place(times[first : first + 20])
        rows = [wrist(times[first : first + 20]), piece, piece]
        log_writer.piece(first, float(times[first]), np.stack(rows, axis=1))
    tip = place(times[-1])[:3] + [0.0, 0.0, 0.1]
    log_writer.event("foreseen", foreseen=messages.PredictionMessage(
        DIGEST, probability, 0.6, 0.9, (LASTS,), (tuple(tip),), (spread,), 0.9, 12))  # fmt: skip
    log_writer.time = BEGIN
    log_writer.event("execute", digest=DIGEST, refused="")
    log_writer.event("robot", robot=ExecutorReport("running", DIGEST))
    for time in np.arange(0.0, LASTS + 0.5, 1 / 72):
        log_writer.time = BEGIN + time
        if end is not None and time >= end:
            log_writer.event("robot", robot=ExecutorReport("idle", DIGEST))
            break
        poses = np.stack([place(time - DELAY)] * len(NAMES)) + [0.0, 0.0, OFF, 0.0, 0.0, 0.0, 0.0]
        sensed = joints(time - DELAY) + OFF_JOINT if measured else None
        log_writer.robot_state(RobotState(log_writer.time, 0.0, START, STRAIGHT, poses[0], poses, sensed))
        intent: Intent = operator.step()
        log_writer.step(1 / 60, operator.message, intent)
    if end is None:
        log_writer.event("robot", robot=ExecutorReport("done", DIGEST))
        if grasped:
            object = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, (0.6, 0.0, 0.4), support="held")
            log_writer.event("world", world=make_world((), (object,)))
    log_writer.close()
    return path


def test_the_tip_is_compared_with_the_preview_whenever_the_robot_began(tmp_path):
    (execution,) = executions(read_session_log(recorded(tmp_path / "run.mcap")))
    assert execution.delay == pytest.approx(DELAY, abs=2e-3)
    assert execution.median == pytest.approx(OFF, abs=2e-4)
    assert execution.worst == pytest.approx(OFF, abs=5e-4)
    assert execution.seconds == pytest.approx(LASTS - STEP, abs=0.05)
    assert (execution.end, execution.within, execution.probability, execution.success) == ("done", True, 0.8, True)
    assert execution.time == pytest.approx(1.0)


def test_what_did_not_come_about_counts_against_what_was_foreseen(tmp_path):
    results = [
        next(executions(read_session_log(recorded(tmp_path / f"{n}.mcap", 0.8, n > 0, spread=1e-3)))) for n in (0, 1)
    ]
    assert [execution.success for execution in results] == [False, True]
    assert [execution.within for execution in results] == [False, False]  # the tip is 2 mm off, foreseen within 1
    assert lines(results)[-1] == (
        "2 executed; 0 of 2 tips ended within the spread; outcome as foreseen in 1 of 2, Brier score 0.340"
    )


def test_of_a_plan_that_was_stopped_its_part_is_compared_and_no_outcome(tmp_path, capsys):
    path = recorded(tmp_path / "run.mcap", end=1.0)
    (execution,) = executions(read_session_log(path))
    assert (execution.end, execution.within, execution.success) == ("held", None, None)
    assert execution.seconds == pytest.approx(1.0 - DELAY - STEP, abs=0.05)
    assert execution.median == pytest.approx(OFF, abs=2e-4)
    assert main([str(path)]) == 0
    output = capsys.readouterr().out
    assert "tip 2.0 mm, at most 2.0 mm from the preview over 0.9 s, 40 ms later" in output
    assert "grasp foreseen at 0.80, not tried to its end" in output


def test_of_a_real_machine_the_mount_is_compared_and_nobody_saw_the_arm(tmp_path, capsys):
    """A twin did and held what was foreseen."""
    path = recorded(tmp_path / "run.mcap", measured=True, hardware=REAL)
    (execution,) = executions(read_session_log(path))
    assert (execution.end, execution.within, execution.success, execution.visible) == ("done", None, None, False)
    away = np.linalg.norm(np.diff(mount_pose(np.stack([START, START + OFF_JOINT]), OFFSET)[0], axis=0))
    assert execution.delay == pytest.approx(DELAY, abs=2e-3)
    assert [execution.median, execution.worst] == pytest.approx([away] * 2, rel=0.1)
    assert execution.seconds == pytest.approx(LASTS - STEP, abs=0.05)
    assert main([str(path)]) == 0
    output = capsys.readouterr().out
    assert "; mount " in output
    assert "tip 2.0 mm" not in output
    assert "grasp foreseen at 0.80, which nobody saw" in output
    assert "1 executed\n  nobody saw the arm: its shape, its tip and its grasps are not judged\n" in output
    assert "Brier" not in output


def test_of_motors_alone_nothing_is_compared(tmp_path):
    (execution,) = executions(
        read_session_log(recorded(tmp_path / "run.mcap", hardware="no real robot, motors 1, 2, 3"))
    )
    assert (execution.end, execution.seconds, execution.within, execution.success) == ("done", 0.0, None, None)
    assert np.isnan([execution.median, execution.worst, execution.delay]).all()


def test_where_nothing_was_executed_nothing_is_said(tmp_path):
    path = recorded(tmp_path / "run.mcap")
    book = read_session_log(path)
    refused = [event | {"refused": "busy"} if event["event"] == "execute" else event for event in book.events]
    book.events[:] = refused
    assert list(executions(book)) == []
    assert lines([]) == ["0 executed"]


# --- verdicts by themselves


def world_of(*supports):
    return {"event": "world", "world": {"things": [{"support": support} for support in supports]}}


REQUEST, OTHER = {"event": "request"}, {"event": "mode"}

HELD = [
    ([], [], False),
    ([world_of("hanging")], [], False),
    ([world_of("hanging")], [world_of("held")], True),
    ([world_of("hanging")], [OTHER, world_of("held")], True),
    ([world_of("hanging")], [world_of("hanging", "held")], True),
    ([world_of("hanging")], [world_of("standing")], False),
    ([world_of("hanging")], [world_of("held"), world_of("hanging")], False),  # it fell
    ([world_of("hanging")], [REQUEST, world_of("held")], False),  # by the next plan
    ([world_of("hanging")], [world_of("held"), REQUEST, world_of("hanging")], True),
    ([world_of("held")], [], True),
    ([world_of("held")], [world_of("standing")], False),
    ([world_of("hanging"), world_of("held")], [OTHER], True),
    ([world_of("held"), world_of("hanging")], [], False),
    ([world_of()], [world_of()], False),
]


@pytest.mark.parametrize(("before", "later", "expected"), HELD)
def test_what_came_of_a_grasp(before, later, expected):
    assert _grasped(before, later) == expected


@pytest.mark.parametrize(
    ("events", "expected"),
    [([], False), ([OTHER], False), ([world_of("held")], True), ([world_of("held"), world_of("hanging")], False),
     ([world_of("hanging"), world_of("held"), OTHER], True), ([world_of("standing", "hanging")], False)],
)  # fmt: skip
def test_whether_the_arm_holds_anything(events, expected):
    assert holds(events) == expected


def executed(probability, grasped, within=None, visible=True):
    return Execution(DIGEST, 1.0, "done", 0.0, np.nan, np.nan, np.nan, within, probability, grasped, visible)


@pytest.mark.parametrize(
    ("probability", "grasped", "verdict"),
    [
        (1.0, True, "outcome as foreseen in 1 of 1, Brier score 0.000"),
        (1.0, False, "outcome as foreseen in 0 of 1, Brier score 1.000"),
        (0.0, True, "outcome as foreseen in 0 of 1, Brier score 1.000"),
        (0.0, False, "outcome as foreseen in 1 of 1, Brier score 0.000"),
        (0.5, True, "outcome as foreseen in 1 of 1, Brier score 0.250"),
        (0.5, False, "outcome as foreseen in 0 of 1, Brier score 0.250"),
        (0.499, True, "outcome as foreseen in 0 of 1, Brier score 0.251"),
        (0.499, False, "outcome as foreseen in 1 of 1, Brier score 0.249"),
        (None, True, ""),
        (0.9, None, ""),
    ],
)
def test_whether_the_outcome_agreed_with_what_was_foreseen(probability, grasped, verdict):
    """An execution that nothing was foreseen of, or that was not tried to its end, is not judged, beside others."""
    last = lines([executed(probability, grasped), executed(None, None), executed(0.7, None)])[-1]
    assert last == "3 executed" + ("; " + verdict if verdict else "")


def test_scores_are_of_all_that_are_judged():
    last = lines([executed(0.9, True, True), executed(0.2, True, False), executed(0.1, False), executed(0.6, True)])[-1]
    assert last == ("4 executed; 1 of 2 tips ended within the spread; outcome as foreseen in 3 of 4, Brier score 0.205")


RAN = {"event": "robot", "time": 1.0, "robot": {"mode": "running", "digest": DIGEST, "fault": ""}}


def robot(mode, digest=DIGEST, fault="", time=2.0):
    return RAN | {"time": time, "robot": {"mode": mode, "digest": digest, "fault": fault}}


@pytest.mark.parametrize(
    ("later", "end", "until"),
    [
        ([], "the log ends", 9.0),
        ([RAN], "the log ends", 9.0),
        ([RAN, robot("done")], "done", 9.0),
        ([RAN, robot("idle")], "held", 2.0),
        ([robot("idle", ""), RAN, robot("done")], "done", 9.0),  # on its way, a start reads as idle, of no plan
        ([RAN, robot("fault", fault="reflex")], "reflex", 2.0),
        ([RAN, robot("fault")], "fault", 2.0),
        ([RAN, robot("idle"), robot("fault", fault="reflex", time=3.0)], "held", 2.0),
        ([RAN, {"event": "execute", "time": 4.0}, robot("done")], "the log ends", 4.0),
        ([RAN, robot("done"), {"event": "execute", "time": 4.0}], "done", 4.0),
    ],
)
def test_how_a_plan_ended(later, end, until):
    assert _end(later, DIGEST, 9.0) == (end, until)
