"""What is noted of stops and answers, and what a robot's process tells of stops, before anything was started too."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.session.test_controller import DIGEST, PACKAGE, STRAIGHT, ToldRobot, controller_of, intent, some_plan
from tests.ar.session.test_permits import FOLLOWING, LIMITS, Played, plan_of
from trunkline.ar.session import messages
from trunkline.ar.session.previewer import FollowAnswer, PlanAnswer, PredictionAnswer, PreviewBegun, PreviewPiece
from trunkline.ar.session.robot_process import DEAD_MAN, HOLD_TIME, MODE, MODES, READY, SERIAL, STOPS, Goal
from trunkline.ar.teleop.executor import FOLLOWS
from trunkline.ar.teleop.messages import ExecutorReport, PlanReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import gentle


@pytest.mark.parametrize(("before", "noted"), [(None, ["stop"]), ("execute", ["stop"]), ("stopped", [])])
def test_a_stop_is_noted_unless_all_is_stopped_already(before, noted):
    events: list[str] = []
    robot = ToldRobot("running")
    controller = controller_of(robot, log_writer=SimpleNamespace(event=events.append))
    controller.intent = before and intent(before)
    controller.stop()
    assert (events, robot.calls) == (noted, ["stop"])


def test_before_anything_was_started_a_robot_tells_so():
    numbers, fault = Played().report
    assert (numbers[SERIAL], numbers[HOLD_TIME], numbers[READY], fault) == (0, 0, 1, "")
    assert MODES[int(numbers[MODE])] == "idle"


def test_an_answer_of_who_seeks_is_of_no_plan():
    """Whatever number it has."""
    controller, handed = controller_of(ToldRobot()), []
    controller._follow = SimpleNamespace(answer=handed.append)
    answer = FollowAnswer(*[controller._requested] * len(fields(FollowAnswer)))
    assert controller.answered(answer, 0.0) is False
    assert handed == [answer]


def test_what_was_planned_previewed_and_foreseen_is_noted():
    noted: list[str] = []
    log_writer = SimpleNamespace(event=lambda name, **_: noted.append(name), piece=lambda *_: noted.append("piece"))
    controller, plan = controller_of(ToldRobot(), log_writer=log_writer), some_plan()
    for answer in (
        PlanAnswer(PlanReport(controller._requested, plan.digest(), "", PACKAGE, "world"), plan),
        PreviewBegun(controller._requested, messages.PreviewMessage(DIGEST, 0.02, 0.3, 0.02, ())),
        PreviewPiece(controller._requested, 0, 0.0, np.zeros((1, 1, 7)), False),
        PreviewPiece(controller._requested, 0, 0.0, np.zeros((0, 0, 7)), True),  # without frames
        PredictionAnswer(
            controller._requested, messages.PredictionMessage(DIGEST, None, None, None, (), (), (), 0.9, 12)
        ),
    ):
        assert controller.answered(answer, 0.0)
    assert noted == ["planned", "preview", "piece", "foreseen"]


def test_a_robot_that_rests_needs_no_permit_and_is_held_by_none():
    played = Played()
    played.turn(0.5, permits=False)
    assert played.report[0][HOLD_TIME] == 0
    assert played.begin(plan_of()).turn(0.1).mode == "running"


def test_a_stop_is_over_once_it_was_obeyed():
    played = Played().begin(plan_of()).turn(0.1)
    played.channel.requests[STOPS] += 1
    played.turn(1.0)
    assert played.mode == "idle"
    here = played.robot.joints
    rows = gentle(np.append(here, STRAIGHT), np.append(here, STRAIGHT) + 0.1 * np.eye(10)[0], LIMITS, 0.002, 2.0)
    again = Plan(0.002, rows[:, :7], rows[:, 7:], (("approach", 0),), PACKAGE, "world")
    assert played.begin(again).turn(again.duration + 0.1).mode == "done"


def test_of_several_stops_the_last_is_told():
    """However long it has been held then."""
    played = Played().begin(plan_of()).turn(0.1)
    for _ in range(2):
        played.channel.requests[STOPS] += 1
        played.turn(2 * played.plant.tick)
        assert played.report[0][HOLD_TIME] == played.now - played.plant.tick


def test_what_was_held_is_started_anew_and_has_not_come_to_rest_by_itself():
    robot = ToldRobot("idle")
    controller = controller_of(robot)
    controller.plan = some_plan()
    goes = intent("execute", controller.plan.digest())
    controller._drive(goes)
    robot.report = ExecutorReport("running", controller.plan.digest())
    controller._drive(goes)
    controller._drive(intent("hold"))
    robot.report = ExecutorReport("idle", controller.plan.digest())
    robot.calls.clear()
    controller._drive(goes)
    assert (robot.calls, controller._fault) == (["start", "permit"], "")


@pytest.mark.parametrize(("motion", "fault"), [("execute", ""), ("follow", "nobody seeks")])
def test_who_seeks_counts_as_it_follows_alone(motion, fault):
    controller = controller_of(ToldRobot("running"))
    controller.plan = some_plan()
    controller._follow = SimpleNamespace(fault="nobody seeks", begin=lambda: None)
    controller._drive(intent(motion, controller.plan.digest() if motion == "execute" else "", motion))
    assert controller._fault == fault


@pytest.mark.parametrize("refused", ["", "busy"])
@pytest.mark.parametrize("motion", ["execute", "follow"])
def test_what_is_begun_is_noted_and_targets_are_sought_where_it_is_not_refused(motion, refused):
    noted, sought = [], []
    robot = ToldRobot("idle")
    robot.start = robot.follow = lambda *_: refused
    log_writer = SimpleNamespace(fault="", event=lambda name, **more: noted.append((name, more["refused"])))
    controller = controller_of(robot, log_writer=log_writer)
    controller.plan = some_plan()
    controller._follow = SimpleNamespace(fault="", begin=lambda: sought.append(motion))
    controller._begin(intent(motion, controller.plan.digest() if motion == "execute" else "", motion))
    assert noted == [(motion, refused)]
    assert sought == (["follow"] if motion == "follow" and not refused else [])


def test_a_fault_of_what_it_follows_is_told_and_lasts():
    played = Played()
    played.robot._report = ExecutorReport("fault", "", "no way to brake")
    numbers, fault = played.report
    assert (MODES[int(numbers[MODE])], fault) == ("fault", "no way to brake")
    played.robot._report = ExecutorReport("idle", "")
    assert played.report[1] == "no way to brake"


def test_a_stop_of_what_nobody_permits_any_more_is_told_as_the_later():
    played = Played().begin(plan_of()).turn(0.05)
    played.turn(DEAD_MAN + 3 * played.plant.tick, permits=False)
    ended = played.report[0][HOLD_TIME]
    played.channel.requests[STOPS] += 1
    played.turn(played.plant.tick, permits=False)
    assert played.mode == "running"  # it brakes still
    assert played.report[0][HOLD_TIME] == played.now > ended


def test_how_old_targets_are_is_told_with_them():
    played, heard = Played().begin(FOLLOWING), []
    played.robot.hear = lambda age, axes: heard.append((age, axes))  # type: ignore[method-assign]
    played.channel.plans.put((played.serial, FOLLOWS, Goal(played.now - 0.25, None), 0))
    played.loop.turn(played.now)
    assert heard == [(0.25, None)]
