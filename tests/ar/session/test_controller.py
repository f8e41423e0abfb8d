"""The session controller, on a clock that a test turns: what it lets the robot do, each layer of safety by itself.

Behind each of these layers another one acts as well: the core, the server, or the robot's process. None of them is
asked here, so that what fails here fails by itself.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.ar.teleop.test_plan import LIMITS, MOUNT, OFFSET, START, STRAIGHT, TIP
from tests.support.live import BODIES, PREVIEW, PlainPlanning, patient
from tests.support.operator import PACKAGE, Everywhere
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import messages
from trunkline.ar.session.arm_cameras import MeasuredArm
from trunkline.ar.session.binary import HAND, Received
from trunkline.ar.session.broadcast import Broadcast
from trunkline.ar.session.controller import MOST_INPUTS, MOST_UNDRAWN, UNBEGUN, UNDRAWN, SessionController
from trunkline.ar.session.controller_input import controllers
from trunkline.ar.session.follow import PLANNER_TIMEOUT
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.previewer import InlinePreviewer, PlanAnswer, PredictionAnswer, PreviewBegun, PreviewPiece
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import BRAKE, FOLLOWS, PlanFollower
from trunkline.ar.teleop.messages import Controller, ExecutorReport, Intent, Obstacle, PlanReport, Pose
from trunkline.ar.teleop.plan import CorrectionBounds, Plan

WAITS = "the page draws too slowly, the robot waits for it"
DT, IDENTITY = 1 / 72, (1.0, 0.0, 0.0, 0.0)
BASE = Pose((0.0, 0.0, 0.0), IDENTITY)
UP = np.array([0.0, 0.0, 0.6])  # from a ray's end to the hand
DIGEST = "d" * 64
UNSEEN = ("left_tracked", "right_tracked", "visible")
CUBE = Obstacle("b", (9.0,) * 3, (9.1,) * 3)
NOTHING = np.full(7, np.nan)
TRACKED = ("left_tracked", "right_tracked", "visible", "drawn")


class ToldRobot:
    """A robot that does nothing but tell `report`; `calls`: what it was asked to do, in order. `refuses`: what it says
    to a start."""

    def __init__(self, mode="idle", refuses=""):
        self.report, self.refuses, self.calls = ExecutorReport(mode, DIGEST), refuses, []

    def start(self, plan, digest):
        self.calls.append("start")
        return self.refuses

    def follow(self, following):
        self.calls.append("follow")
        return self.refuses

    def hear(self, age, axes):
        self.calls.append("hear")

    def permit(self, waits=False):
        self.calls.append("permit")

    def stop(self):
        self.calls.append("stop")

    def state(self):
        return self.report

    def robot_state(self):
        return RobotState(0.0, 0.0, START, STRAIGHT, NOTHING, np.zeros((BODIES, 7)))


def controller_of(robot, previewer=None, log_writer=None, world=None) -> SessionController:
    core = Teleoperation(patient(), Everywhere(), PACKAGE, OFFSET)
    previewer = previewer or InlinePreviewer(lambda order: iter(()))
    return SessionController(core, robot, previewer, world or make_world(()), 0.1, log_writer)


def some_plan(package=PACKAGE) -> Plan:
    return Plan(1.0, np.tile(START, (2, 1)), np.tile(STRAIGHT, (2, 1)), (("approach", 0),), package, "world")


def intent(mode: str, execute: str = "", motion: str = "") -> Intent:
    return Intent(mode, motion or ("execute" if execute else "hold"), "", None, (None, None), execute=execute)


# --- what the robot is told, intent by intent


@pytest.mark.parametrize("plan", [None, some_plan("b" * 64)])
def test_only_the_plan_that_was_confirmed_is_started(plan):
    """Its digest is compared here, whatever the robot would compare."""
    robot = ToldRobot()
    controller = controller_of(robot)
    controller.plan = plan
    controller._drive(intent("execute", some_plan().digest()))
    assert robot.calls == []
    assert controller._fault == "the plan that was confirmed is not there"
    controller._drive(intent("execute", some_plan().digest()))
    assert "start" not in robot.calls
    assert "permit" not in robot.calls


def test_the_plan_that_was_confirmed_is_started_once_and_permitted_at_each_step():
    robot = ToldRobot()
    controller = controller_of(robot)
    controller.plan = some_plan()
    for mode in ("idle", "running", "running"):  # a start on its way reads as idle
        robot.report = ExecutorReport(mode, DIGEST)
        controller._drive(intent("execute", some_plan().digest()))
    assert robot.calls == ["start", "permit", "permit", "permit"]


def blocked(controller, how):
    if how == "unfit":
        controller.align(BASE, "it is not sure enough")
    else:
        controller.log_writer.fault = "log: no space left"


@pytest.mark.parametrize("how", ["unfit", "log"])
@pytest.mark.parametrize("motion", ["execute", "follow"])
def test_where_nothing_may_be_executed_nothing_is_started_or_permitted(motion, how):
    robot = ToldRobot()
    controller = controller_of(robot, log_writer=LogWriter())
    controller.plan = some_plan()
    blocked(controller, how)
    execute = some_plan().digest() if motion == "execute" else ""
    for _ in range(3):
        controller._drive(intent(motion, execute, motion))
    assert not {"start", "follow", "permit"} & set(robot.calls)
    assert controller._fault == controller.blocked != ""


@pytest.mark.parametrize("how", ["unfit", "log"])
def test_what_runs_is_stopped_as_soon_as_nothing_may_be_executed_and_permitted_no_more(how):
    robot = ToldRobot("running")
    controller = controller_of(robot, log_writer=LogWriter())
    controller.plan = some_plan()
    controller._drive(intent("execute", some_plan().digest()))
    blocked(controller, how)
    robot.calls.clear()
    for _ in range(3):
        controller._drive(intent("execute", some_plan().digest()))
    assert robot.calls == ["stop"]


@pytest.mark.parametrize("motion", ["execute", "follow"])
def test_a_start_that_is_refused_is_a_fault_and_nothing_is_permitted(motion):
    robot = ToldRobot(refuses="busy: another plan runs")
    controller = controller_of(robot)
    controller.plan = some_plan()
    execute = some_plan().digest() if motion == "execute" else ""
    for _ in range(3):
        controller._drive(intent(motion, execute, motion))
    assert robot.calls == ["start" if motion == "execute" else "follow"]
    assert controller._fault == "busy: another plan runs"


@pytest.mark.parametrize("motion", ["execute", "follow"])
def test_a_robot_that_has_come_to_rest_by_itself_is_a_fault_and_permitted_no_more(motion):
    robot = ToldRobot("running")
    controller = controller_of(robot)
    controller.plan = some_plan()
    execute = some_plan().digest() if motion == "execute" else ""
    controller._drive(intent(motion, execute, motion))
    controller._drive(intent(motion, execute, motion))
    assert controller._fault == ""
    robot.report = ExecutorReport("idle", DIGEST)
    robot.calls.clear()
    controller._drive(intent(motion, execute, motion))
    assert controller._fault == "it has come to rest by itself"
    controller._drive(intent(motion, execute, motion))
    assert "permit" not in robot.calls


def test_a_robot_that_is_done_or_was_never_seen_to_run_has_not_come_to_rest_by_itself():
    for mode in ("idle", "done"):
        robot = ToldRobot()
        controller = controller_of(robot)
        controller.plan = some_plan()
        controller._drive(intent("execute", some_plan().digest()))
        robot.report = ExecutorReport(mode, DIGEST)
        controller._drive(intent("execute", some_plan().digest()))
        assert controller._fault == ""
    robot.report = ExecutorReport("running", DIGEST)
    controller._drive(intent("execute", some_plan().digest()))
    robot.report = ExecutorReport("done", DIGEST)
    controller._drive(intent("execute", some_plan().digest()))
    assert controller._fault == ""


@pytest.mark.parametrize("mode", ["running", "idle", "done", "fault"])
@pytest.mark.parametrize("started", [True, False])
def test_an_intent_to_hold_stops_what_runs_or_is_on_its_way(mode, started):
    robot = ToldRobot(mode)
    controller = controller_of(robot)
    controller._started = some_plan().digest() if started else ""
    controller._drive(intent("hold"))
    assert robot.calls == (["stop"] if mode == "running" or started else [])


def test_a_fault_lasts_while_it_is_stopped_and_ends_with_it():
    controller = controller_of(ToldRobot())
    controller._fault = "reflex"
    controller._drive(intent("stopped"))
    assert controller._fault == "reflex"
    controller._drive(intent("hold"))
    assert controller._fault == ""


def test_an_older_fault_is_not_replaced_by_a_newer_one():
    robot = ToldRobot("running")
    controller = controller_of(robot)
    controller.plan = some_plan()
    controller._drive(intent("execute", some_plan().digest()))
    robot.report = ExecutorReport("idle", DIGEST)
    controller._drive(intent("execute", some_plan().digest()))
    blocked(controller, "unfit")
    controller._drive(intent("execute", some_plan().digest()))
    assert controller._fault == "it has come to rest by itself"


@pytest.mark.parametrize("silent", [PLANNER_TIMEOUT - 0.01, PLANNER_TIMEOUT + 0.01])
def test_as_it_follows_a_process_that_plans_has_to_answer(silent):
    robot = ToldRobot("running")
    controller = controller_of(robot)
    controller._drive(intent("follow", motion="follow"))
    controller._follow.seek(None, START, controller.world)
    controller._follow.advance(silent)
    robot.calls.clear()
    controller._drive(intent("follow", motion="follow"))
    assert robot.calls == (["permit"] if silent < PLANNER_TIMEOUT else ["stop"])
    fault = "" if silent < PLANNER_TIMEOUT else "the process that plans has not answered for 1.01 s"
    assert controller._fault == fault


@pytest.mark.parametrize("alignment", [None, BASE])
def test_whoever_takes_over_finds_a_robot_that_was_told_to_stop_and_nothing_of_what_was_heard(alignment):
    robot = ToldRobot("running")
    controller = controller_of(robot)
    controller.hear(*received(1.0))
    controller.control(alignment, "not sure")
    assert robot.calls == ["stop"]
    assert not controller._inputs
    assert (controller.alignment, controller.unfit) == (alignment, "not sure")
    assert controller.hear(*received(0.5)) == ""  # another clock


def test_a_stop_is_told_to_the_robot_at_once_and_to_the_core_at_its_next_step_whoever_controls():
    robot = ToldRobot("running")
    controller = controller_of(robot)
    controller.stop()
    assert robot.calls == ["stop"]
    assert controller.tick(DT).mode == "stopped"


# --- what is heard


def received(stamp, left=None, right=None, flags=TRACKED) -> tuple[float, Controller, Controller, bool]:
    """Hands over both targets with these buttons, and whether anything was drawn."""

    def row(place, buttons):
        at = dict(zip("xyz", np.array(place) + UP, strict=True)) | {"qw": 1.0} | (buttons or {})
        return [at.get(name, 0.0) for name in HAND]

    rows = np.array([row(MOUNT, left), row(TIP, right)])
    return stamp, *controllers(Received("input", frozenset(flags), 0, stamp, rows)), "drawn" in flags


@pytest.mark.parametrize(("stamp", "counts"), [(1.0, False), (0.9, False), (1.0 + 1e-9, True)])
def test_an_input_that_was_heard_before_does_not_count(stamp, counts):
    controller = controller_of(ToldRobot())
    assert controller.hear(*received(1.0)) == ""
    assert (controller.hear(*received(stamp)) == "") == counts
    controller.tick(DT)
    assert controller.hear(*received(max(stamp, 1.0))) != ""  # nor a tick later


@pytest.mark.parametrize("clock", [2371.98, 3.2])
def test_passing_control_says_nothing_of_how_far_the_two_clocks_are_apart(clock):
    """Each client stamps by a clock of its own: the core's goes on, and what is refused is said by the sender's."""
    controller, notices = controller_of(ToldRobot()), []
    for begin in (100.0, clock):
        controller.control(BASE)
        for number in range(40):
            assert controller.hear(*received(begin + number * DT)) == ""
            notices.append(controller.tick(DT).notice)
        assert controller.state.stamp == pytest.approx(100 + 39 * DT, abs=1.0)
    assert not [notice for notice in notices if "silent" in notice or "2271" in notice or " s" in notice]
    again = controller.hear(*received(clock))
    assert again == f"input: stamp {clock:.6g} s is not after {clock + 39 * DT:.6g} s: heard before"


def test_of_more_inputs_than_a_tick_takes_the_oldest_are_left_out():
    controller = controller_of(ToldRobot())
    for number in range(MOST_INPUTS + 3):
        controller.hear(*received(1.0 + number))
    assert [heard.stamp for heard in controller._inputs] == [1.0 + number for number in range(3, MOST_INPUTS + 3)]


# --- what has been shown


def previewed(**changes) -> SessionController:
    """A controller at whose preview a client looks since 10 s."""
    controller = controller_of(ToldRobot())
    controller.intent = replace(intent("preview"), preview=DIGEST)
    controller.preview, controller._since = messages.PreviewMessage(DIGEST, 0.02, PREVIEW, 0.02, ()), 10.0
    controller.pieces = [
        PreviewPiece(1, 0, 0.0, np.zeros((1, BODIES, 7)), last) for last in (False, True)
    ]
    for name, value in changes.items():
        setattr(controller, name, value)
    return controller


SHOWN = [
    ({}, DIGEST, PREVIEW, ""),
    ({}, DIGEST, PREVIEW - 0.01, "shown: its preview lasts 0.30 s, found 0.29 s"),
    ({}, "e" * 64, PREVIEW, f"shown: found digest 'eeeeeeeeeeee', expected {DIGEST[:12]}"),
    ({}, "", PREVIEW, f"shown: found digest '', expected {DIGEST[:12]}"),
    ({"pieces": []}, DIGEST, PREVIEW, "shown: its preview is not simulated to its end yet"),
    ({"pieces": [PreviewPiece(1, 0, 0.0, np.zeros((1, BODIES, 7)), False)]}, DIGEST, PREVIEW,
     "shown: its preview is not simulated to its end yet"),
    ({"intent": None}, DIGEST, PREVIEW, "shown: no plan is previewed"),
    ({"intent": intent("aim")}, "", PREVIEW, "shown: no plan is previewed"),
    ({"preview": None}, DIGEST, PREVIEW, "shown: no plan is previewed"),
    ({"preview": messages.PreviewMessage("e" * 64, 0.02, PREVIEW, 0.02, ())}, DIGEST, PREVIEW,
     "shown: no plan is previewed"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "digest", "after", "reason"), SHOWN)
def test_what_counts_as_shown_to_its_end(changes, digest, after, reason):
    controller = previewed(**changes)
    assert controller.preview_shown(digest, 10.0 + after) == reason
    assert controller._shown_digest == ("" if reason else DIGEST)


@pytest.mark.parametrize(("serial", "counts"), [(2, False), (3, True), (4, False)])
def test_only_an_answer_to_what_was_asked_for_last_counts(serial, counts):
    controller = controller_of(ToldRobot())
    controller._requested = 3
    plan, prediction = some_plan(), messages.PredictionMessage(DIGEST, None, None, None, (), (), (), 0.9, 12)
    answers = [
        PlanAnswer(PlanReport(serial, plan.digest(), "", PACKAGE, "world"), plan),
        PreviewBegun(serial, messages.PreviewMessage(DIGEST, 0.02, PREVIEW, 0.02, ())),
        PreviewPiece(serial, 0, 0.0, np.zeros((1, BODIES, 7)), True),
        PredictionAnswer(serial, prediction),
    ]  # fmt: skip
    assert [controller.answered(answer, 0.0) for answer in answers] == [counts] * 4
    assert [
        controller.plan is plan,
        controller.preview is not None,
        bool(controller.pieces),
        controller.prediction is prediction,
    ] == [counts] * 4


def test_a_process_that_plans_and_has_ended_is_a_refusal():
    controller = controller_of(ToldRobot())
    controller._requested = 3
    assert not controller.answered(None, 0.0)
    assert (controller.report.serial, controller.report.refused) == (3, "the process that plans has ended")


# --- a whole session, tick by tick


class PlayedRobot(PlanFollower):
    """As its plan says; it brakes by itself where nobody `permit`s it at a tick. `permits`, `stops`: how often."""

    def __init__(self):
        super().__init__(START, STRAIGHT, LIMITS, PACKAGE)
        self.permits = self.stops = 0

    def follow(self, following):
        return super().follow(following, DT)

    def permit(self, waits=False):
        self.permits, self.waits = self.permits + 1, waits

    def stop(self):
        self.stops += 1
        super().stop()

    def robot_state(self):
        return RobotState(0.0, 0.0, self.joints, self.commands, NOTHING, np.zeros((BODIES, 7)))


class Played:
    """Controller, core, planner, robot and a client that controls, on our clock. `left`, `right`: its buttons."""

    def __init__(self):
        self.now, self.robot, self.planning = 100.0, PlayedRobot(), PlainPlanning()
        self.controller = controller_of(self.robot, self.planning, LogWriter())
        self.controller.control(BASE)
        self.left, self.right, self.flags = {}, {}, TRACKED

    def tick(self, heard=True) -> Intent:
        self.now += DT
        if heard:
            assert self.controller.hear(*received(self.now, self.left, self.right, self.flags)) == ""
        self.robot.advance(DT)
        self.controller.poll(self.now)
        return self.controller.tick(DT)

    def wait(self, seconds, **how) -> Intent:
        for _ in range(round(seconds / DT)):
            intent = self.tick(**how)
        return intent

    def until(self, happens, seconds=20.0) -> Intent:
        for _ in range(round(seconds / DT)):
            intent = self.tick()
            if happens(intent):
                return intent
        raise AssertionError(f"it did not happen: {intent.mode}, {intent.notice}")

    def aimed(self) -> "Played":
        self.until(lambda intent: intent.mode == "aim")
        self.left, self.right = {"grip": 1.0}, {"grip": 1.0}
        self.wait(0.8)
        return self

    def readied(self) -> "Played":
        """A plan that was previewed."""
        self.aimed()
        self.right = {"grip": 1.0, "trigger": 1.0}
        self.until(lambda intent: intent.mode == "preview")
        self.right = {"grip": 1.0}
        self.wait(PREVIEW + 0.1)
        assert self.controller.preview_shown(self.controller.intent.preview, self.now) == ""
        self.until(lambda intent: intent.mode == "ready")
        return self

    def executing(self) -> "Played":
        """A plan that was previewed and confirmed, and runs for a while."""
        return self.readied().executing_from_ready()

    def executing_from_ready(self) -> "Played":
        self.right = {"grip": 1.0, "trigger": 1.0}
        self.until(lambda intent: intent.mode == "execute")
        self.right = {"grip": 1.0}
        self.wait(0.3)
        assert self.robot.state().mode == "running"
        return self

    def assert_it_stays(self):
        """At rest, whatever its buttons are and however long."""
        self.wait(0.5)
        rests = self.robot.joints.copy()
        self.left, self.right, self.flags = {"grip": 1.0}, {"grip": 1.0, "trigger": 1.0}, TRACKED
        self.wait(1.0)
        np.testing.assert_array_equal(self.robot.joints, rests)
        assert self.robot.state().mode != "running"
        assert np.abs(self.planning.plans[0].joints - rests).max(axis=1).min() < 5e-3


@pytest.fixture
def session():
    return Played()


def test_from_hands_to_a_robot_that_has_arrived(session):
    session.executing()
    session.until(lambda intent: intent.mode == "aim")
    np.testing.assert_allclose(session.robot.joints, session.planning.plans[0].joints[-1], atol=1e-9)
    assert session.robot.state().mode == "done"
    assert session.robot.stops == 1  # as control began


def test_where_the_preview_had_the_tip_is_known_once_the_plan_has_arrived_and_until_the_next_motion(session):
    controller = session.executing().controller
    foreseen = controller.prediction
    foreseen = controller.prediction = replace(foreseen, spread=(*foreseen.spread[:-1], 0.012))
    assert controller.arrived is None
    session.until(lambda intent: intent.mode == "aim")
    session.tick()
    place, radius = controller.arrived
    np.testing.assert_array_equal(place, foreseen.tip[-1])
    assert radius == 0.012
    digest = controller.plan.digest()
    assert controller._arrival(digest) is not None
    for other in (replace(foreseen, digest="another"), replace(foreseen, spread=(), unknown="no certificate"), None):
        controller.prediction = other
        assert controller._arrival(digest) is None
    controller.prediction = foreseen
    controller.plan = replace(controller.plan, correction=CorrectionBounds(foreseen.tip[-1], 1, 0.001, 0.01))
    assert controller._arrival(digest) is None
    controller._begin(replace(controller.intent, motion="follow"))
    assert controller.arrived is None


def test_clients_hear_how_far_the_measured_tip_is_from_where_the_preview_had_it(session):
    controller = session.executing().controller
    poses = np.tile([0.1, 0.2, 0.3, 1, 0, 0, 0], (2, 1))
    arm = MeasuredArm(0.0, poses, np.array([0.1, 0.2, 0.3]), 0.01, 120.0, 0.0, "", None)
    hears = Broadcast(controller, None)
    for second, (tip, arrived, expected) in enumerate([
        (arm.tip, None, (None, None)),
        (arm.tip, (arm.tip + [0.003, 0, 0.004], 0.008), (0.005, 0.008)),
        (np.full(3, np.nan), (arm.tip, 0.008), (None, None)),
    ]):  # fmt: skip
        controller.arm, controller.arrived = replace(arm, tip=tip), arrived
        message = hears.new_measured(1.0 + second)
        assert (message.from_preview, message.radius) == expected


def test_what_runs_is_still_known_where_its_preview_breaks_off_meanwhile(session):
    """Else the world would not hear at its end of what it grasped."""
    controller, plan = session.executing().controller, session.controller.plan
    refusal = PlanReport(controller._requested, refused="preview: ValueError: it diverged")
    assert not controller.answered(PlanAnswer(refusal), session.now)
    assert controller.plan is plan
    session.until(lambda intent: intent.mode == "aim")
    session.tick()
    assert controller._believed == plan.digest()


def test_a_plan_is_ready_only_once_its_preview_states_how_sure_it_is(session):
    answers, late = session.planning._answers, []

    def but_the_prediction(order):
        every = list(answers(order))
        late.extend(every[-1:])
        return iter(every[:-1])

    session.planning._answers = but_the_prediction
    session.aimed()
    session.right = {"grip": 1.0, "trigger": 1.0}
    session.until(lambda intent: intent.mode == "preview")
    session.right = {"grip": 1.0}
    session.wait(PREVIEW + 0.1)
    assert session.controller.preview_shown(session.controller.intent.preview, session.now) == ""
    session.wait(1.0)
    assert session.controller.intent.mode == "preview"
    assert isinstance(late[0], PredictionAnswer)
    session.controller.answered(late[0], session.now)
    session.until(lambda intent: intent.mode == "ready", 0.1)


def let_go(session):
    session.left, session.right = {}, {}
    session.wait(0.1)


def untracked(session):
    session.flags = ("visible",)
    session.wait(0.2)


def hidden(session):
    session.flags = ("left_tracked", "right_tracked")
    session.wait(0.2)


def undrawn(session):
    session.flags = UNSEEN
    session.wait(MOST_UNDRAWN + 2 * DT)


def rested(session):
    PlanFollower.stop(session.robot)
    session.wait(0.3)


def handed_over(session):
    """To somebody who is aligned alike and holds the same buttons: the core sees nothing of it."""
    session.controller.control(BASE)
    session.wait(0.3)


def faulty(session):
    session.robot._report = ExecutorReport("fault", session.robot._report.digest, "reflex")
    session.wait(0.1)
    session.robot._report = ExecutorReport("idle", session.robot._report.digest)


WAYS = {
    "a stop": (lambda s: s.controller.stop(), "stopped", "stopped; primary button goes on"),
    "a secondary button": (lambda s: s.left.update(secondary=1.0), "stopped", "stopped; primary button goes on"),
    "grips let go": (let_go, "hold", "grips let go; holding"),
    "silence": (lambda s: s.wait(0.6, heard=False), "hold", "client silent for 0.6"),
    "controllers lost": (untracked, "hold", "left controller: not tracked; holding"),
    "hidden": (hidden, "hold", "left controller: not tracked; holding"),
    "nothing drawn": (undrawn, "hold", "client silent for 2."),
    "nobody controls": (lambda s: s.controller.control(None), "hold", "base is not aligned; holding"),
    "somebody else controls": (handed_over, "stopped", "robot: it has come to rest by itself; stopped"),
    "alignment lost": (lambda s: s.controller.align(None, ""), "hold", "base is not aligned; holding"),
    "aligned anew": (lambda s: s.controller.align(Pose((0.0, 0.0, 0.1), IDENTITY), ""), "hold",
                     "base alignment changed; the plan is void"),
    "not sure any more": (lambda s: s.controller.align(BASE, "it is not sure"), "stopped",
                          "robot: it is not sure; stopped"),
    "the log is full": (lambda s: setattr(s.controller.log_writer, "fault", "log: full"), "stopped",
                        "robot: log: full; stopped"),
    "the world changed": (lambda s: setattr(s.controller, "world", make_world((CUBE,))),
                          "hold",
                          "world changed; the plan is void"),
    "it rested by itself": (rested, "stopped", "robot: it has come to rest by itself; stopped"),
    "a fault of the robot": (faulty, "stopped", "robot: reflex; stopped"),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_a_robot_under_way_is_told_to_hold_and_does_not_go_on(session, way):
    cause, mode, notice = WAYS[way]
    session.executing()
    cause(session)
    intents = [session.tick() for _ in range(3)]
    assert intents[-1].mode == mode
    assert intents[-1].motion == "hold"
    assert session.robot.stops >= (1 if way in ("it rested by itself", "a fault of the robot") else 2)
    assert any(intent.notice.startswith(notice) for intent in intents)
    before = session.robot.permits
    session.assert_it_stays()
    assert session.robot.permits == before


def test_a_plan_waits_for_the_page_that_draws_too_slowly_and_goes_on_with_its_next_picture(session):
    session.readied()
    session.right = {"grip": 1.0, "trigger": 1.0}
    session.until(lambda intent: intent.mode == "execute")
    session.right = {"grip": 1.0}
    session.tick()
    session.flags = UNSEEN
    assert session.wait(UNDRAWN - DT).motion == "execute"
    assert session.controller.state_message("somebody").notice == ""
    assert session.wait(2 * DT).motion == "execute"
    assert session.controller.state_message("somebody").notice == WAITS
    session.wait(BRAKE)
    here = session.robot.joints
    session.wait(1.0)
    np.testing.assert_array_equal(session.robot.joints, here)
    session.flags = TRACKED
    session.wait(BRAKE)
    assert np.abs(session.robot.joints - here).max() > 0
    assert session.controller.state_message("somebody").notice == WAITS  # it does not come and go with each picture
    session.wait(1.0)
    assert session.robot.state().mode == "done"
    assert session.controller.state_message("somebody").notice == ""


def test_who_draws_nothing_as_a_plan_waits_counts_as_silent_and_is_told_why(session, monkeypatch):
    session.executing()
    events = []
    monkeypatch.setattr(session.controller.log_writer, "event", lambda kind, **fields: events.append((kind, fields)))
    session.flags = UNSEEN
    assert session.wait(MOST_UNDRAWN - DT).motion == "execute"
    assert session.wait(2 * DT).mode == "hold"
    notice = session.controller.state_message("somebody").notice
    assert notice == "the page has drawn nothing for 2.01 s; holding"
    assert [fields["notice"] for kind, fields in events if kind == "mode"] == [notice]
    session.assert_it_stays()
    assert session.controller.state_message("somebody").notice == notice
    session.flags = TRACKED
    session.assert_it_stays()  # not by drawing again either
    session.left, session.right = {}, {}
    session.until(lambda intent: intent.mode == "aim", 1.0)
    assert session.controller.state_message("somebody").notice == ""


def test_a_page_that_draws_seldom_moves_the_robot_and_one_that_draws_nothing_aims(session):
    session.flags = UNSEEN
    session.readied()
    session.flags = TRACKED
    session.executing_from_ready()
    for _ in range(2):  # together longer than nothing may be drawn
        session.flags = UNSEEN
        session.wait(UNDRAWN - 2 * DT)
        session.flags = TRACKED
        assert session.tick().motion == "execute"
        assert not session.robot.waits


def test_as_it_follows_who_draws_nothing_counts_as_silent(session):
    session.aimed()
    session.right = {"grip": 1.0, "stick_pressed": 1.0}
    session.until(lambda intent: intent.motion == "follow")
    session.flags = UNSEEN
    session.wait(UNDRAWN + 2 * DT)
    assert session.controller.intent.mode == "hold"


def test_what_is_confirmed_by_who_draws_nothing_does_not_begin(session):
    session.readied()
    session.flags = UNSEEN
    session.wait(UNDRAWN + 2 * DT)
    assert session.controller.intent.mode == "ready"  # nothing moves: the plan is kept
    session.right = {"grip": 1.0, "trigger": 1.0}
    before = session.robot.joints
    assert session.wait(UNBEGUN - UNDRAWN - 4 * DT).mode in ("delay", "execute")
    session.until(lambda intent: intent.mode == "hold", 6 * DT)
    np.testing.assert_array_equal(session.robot.joints, before)


@pytest.mark.parametrize(("undrawn", "mode"), [(UNBEGUN - 3 * DT, "execute"), (UNBEGUN + 3 * DT, "hold")])
def test_a_picture_that_comes_late_as_the_delay_ends_starts_what_is_not_long_overdue(session, undrawn, mode):
    session.readied()
    session.right = {"grip": 1.0, "trigger": 1.0}
    session.until(lambda intent: intent.mode == "delay")
    before = session.robot.joints
    session.right, session.flags = {"grip": 1.0}, UNSEEN
    session.wait(undrawn)
    np.testing.assert_array_equal(session.robot.joints, before)
    session.flags = TRACKED
    assert session.wait(0.2).mode == mode
    assert np.array_equal(session.robot.joints, before) == (mode == "hold")


def test_who_takes_over_has_time_to_draw(session):
    session.aimed()
    session.flags = UNSEEN
    session.wait(1.0)
    session.controller.control(BASE)
    assert session.controller._undrawn == 0.0


def test_as_it_follows_it_goes_after_the_targets_and_holds_as_soon_as_nobody_answers(session):
    session.aimed()
    session.right = {"grip": 1.0, "stick_pressed": 1.0}
    session.until(lambda intent: intent.motion == "follow")
    session.right = {"grip": 1.0}
    session.wait(1.0)
    assert session.robot.state() == ExecutorReport("running", FOLLOWS)
    session.planning.poll = list
    session.wait(PLANNER_TIMEOUT - 0.2)
    assert session.controller.intent.motion == "follow"
    intent = session.wait(0.5)
    assert (intent.mode, intent.motion) == ("stopped", "hold")
    assert "the process that plans has not answered for 1.0" in session.controller.state.notice
    session.wait(0.5)
    rests = session.robot.joints.copy()
    session.wait(0.5)
    np.testing.assert_array_equal(session.robot.joints, rests)
