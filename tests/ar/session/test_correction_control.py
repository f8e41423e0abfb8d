"""Plans that correct themselves by cameras once they have arrived: what lets them, what bounds them, what ends them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.session.test_controller import (
    BASE,
    DT,
    TRACKED,
    Played,
    PlayedRobot,
    faulty,
    handed_over,
    hidden,
    let_go,
    received,
    some_plan,
    undrawn,
    untracked,
)  # fmt: skip
from tests.ar.teleop.test_plan import OFFSET, START, STRAIGHT, TIP
from tests.support.live import PlainPlanning, patient
from tests.support.operator import PACKAGE, Everywhere
from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.correction.rest import WINDOW
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import correction_control
from trunkline.ar.session.arm_cameras import MeasuredArm
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.correction_control import ANSWERS, UNCHECKED, beyond_bounds
from trunkline.ar.session.correction_steps import CorrectionAnswer, CorrectionOrder
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.previewer import Order, PlanAnswer, PredictionAnswer, PreviewBegun
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import ExecutorReport, Target, Targets, WorldObject
from trunkline.ar.teleop.plan import CorrectionBounds, Plan

OFF = np.array([5.1e-3, 0.0, 0.0])  # m, of the tip from its target as the plan arrives
SETTINGS = CorrectionSettings()
BOUNDS = CorrectionBounds((0.0, 0.0, 0.0), 5, 5e-3, 30e-3)
RAMP = 0.4  # s of a step


class Events(LogWriter):
    def __init__(self):
        super().__init__()
        self.events = []

    def event(self, kind, **fields):
        self.events.append((kind, fields))


class Planning(PlainPlanning):
    """Its steps pull the first motor by `change`, m, until `arrives` of them are done."""

    def __init__(self):
        super().__init__()
        self.change, self.arrives, self.joints, self.orders, self.mute = 2e-3, 2, 0.0, [], False

    def answers(self, order):
        if isinstance(order, CorrectionOrder):
            self.orders.append(order)
            if not self.mute:
                yield self.step(order)
            return
        for answer in super().answers(order):
            if isinstance(order, Order) and order.correction is not None:
                answer = self.corrected(answer, order.correction)
            yield answer

    def corrected(self, answer, bounds):
        plan = replace(self.plans[-1], correction=bounds)
        digest = plan.digest()
        if isinstance(answer, PlanAnswer):
            return PlanAnswer(replace(answer.report, digest=digest), plan)
        if isinstance(answer, PreviewBegun):
            return replace(answer, preview=replace(answer.preview, digest=digest, correction=bounds))
        if isinstance(answer, PredictionAnswer):
            return replace(answer, prediction=replace(answer.prediction, digest=digest))
        return answer

    def step(self, order):
        if order.number >= self.arrives:
            return CorrectionAnswer(order.serial, order.number, None, "arrived")
        rows = order.commands - np.linspace(0, 1, round(RAMP / DT))[:, None] * self.change * np.eye(3)[0]
        joints = np.tile(order.joints + self.joints * np.eye(7)[0], (len(rows), 1))
        plan = Plan(DT, joints, rows, (("correction", 0),), order.package, order.world.digest)
        return CorrectionAnswer(order.serial, order.number, plan, "")


class Cameras:
    """They see the tip OFF its target, less what the first motor has pulled since the plan arrived."""

    def __init__(self, session):
        self.session, self.fault, self.moves, self.shift = session, "", 0.0, np.zeros(3)
        self.mounted, self.mount = True, np.zeros(3)  # whether a body is at the mount, and by how far it is seen off

    def show(self, bodies):
        pass

    def latest(self):
        session = self.session
        plans, now = session.planning.plans, session.now
        end = plans[-1].commands[-1] if plans else STRAIGHT
        tip = np.array(TIP) + OFF + self.shift + np.array([1.0, 0, 0]) * (session.robot.commands - end)[0]
        tip += self.moves * np.sin(7 * now) * np.ones(3)
        mount = base_frames(session.robot.joints, OFFSET)[0] + self.mount if self.mounted else None
        return MeasuredArm(now, np.full((2, 7), np.nan), tip, 0.01, 120.0, 0.0, self.fault, mount)


class Correcting(Played):
    """A client that asks for plans that correct themselves."""

    def __init__(self):
        self.now, self.robot, self.planning, self.log = 100.0, PlayedRobot(), Planning(), Events()
        self.cameras, self.correct = Cameras(self), True
        core = Teleoperation(patient(), Everywhere(), PACKAGE, OFFSET)
        self.controller = SessionController(
            core, self.robot, self.planning, make_world(()), 0.1, self.log, 0.0, self.cameras, SETTINGS
        )
        self.controller.control(BASE)
        self.left, self.right, self.flags = {}, {}, TRACKED

    def tick(self, heard=True):
        self.now += DT
        if heard:
            hands = received(self.now, self.left, self.right, self.flags)
            assert self.controller.hear(*hands, self.correct) == ""
        self.robot.advance(DT)
        self.controller.poll(self.now)
        return self.controller.tick(DT)

    @property
    def words(self):
        return self.controller.state_message("me").correction

    @property
    def phase(self):
        return self.controller.correction._phase

    def corrects(self, phase="moves") -> "Correcting":
        """A plan that has arrived and is corrected so far."""
        self.executing().until(lambda _: self.phase == phase)
        if phase == "moves":
            self.wait(0.1)
            assert self.robot.state().mode == "running"
        return self

    @property
    def travelled(self):
        """Share of a step that the first motor has gone since the plan arrived."""
        return float((self.controller.plan.commands[-1] - self.robot.commands)[0] / self.planning.change)

    def assert_nothing_follows(self):
        """Whatever its buttons are and however long."""
        self.wait(0.5)
        rests, orders = self.robot.commands.copy(), len(self.planning.orders)
        self.left, self.right, self.flags = {"grip": 1.0}, {"grip": 1.0}, TRACKED
        self.wait(2 * WINDOW + 1.0)
        np.testing.assert_array_equal(self.robot.commands, rests)
        assert self.robot.state().mode != "running"
        assert len(self.planning.orders) == orders

    def errors(self):
        return [fields["error"] for kind, fields in self.log.events if kind == "correction"]


@pytest.fixture
def session():
    return Correcting()


def test_a_plan_corrects_itself_at_rest_step_by_step_until_it_ends_and_says_how(session):
    session.executing()
    plan, modes = session.planning.plans[0], []
    session.until(lambda _: session.robot.state().mode == "done")
    np.testing.assert_array_equal(session.robot.commands, plan.commands[-1])

    def over(intent):
        modes.append((intent.mode, session.controller.state_message("me").robot))
        return intent.mode != "execute"

    session.until(over)
    assert set(modes[:-2]) == {("execute", "running")}
    assert modes[-2:] == [("execute", "done"), ("aim", "done")]
    assert session.words == "corrected from 5.1 to 1.1 mm in 2 steps: arrived"
    np.testing.assert_allclose(session.errors(), [5.1e-3, 3.1e-3, 1.1e-3], atol=1e-6)
    np.testing.assert_allclose(plan.commands[-1] - session.robot.commands, [4e-3, 0, 0], atol=1e-9)
    np.testing.assert_array_equal(session.robot.joints, plan.joints[-1])
    (ended,) = [fields for kind, fields in session.log.events if kind == "corrected"]
    assert (ended["reason"], ended["digest"]) == ("arrived", session.controller.plan.digest())
    session.assert_nothing_follows()


def test_what_nobody_asked_for_is_not_corrected_and_its_digest_is_another(session):
    session.correct = False
    session.executing()
    plain = session.controller.plan
    session.until(lambda intent: intent.mode == "aim")
    session.wait(3.0)
    assert (plain.correction, session.planning.orders, session.words) == (None, [], "")
    np.testing.assert_array_equal(session.robot.commands, plain.commands[-1])
    again = Correcting()
    again.executing()
    np.testing.assert_array_equal(again.controller.plan.commands, plain.commands)
    tip = again.controller.state.pinned.request.targets.tip.position
    assert again.controller.plan.correction == CorrectionBounds(tip, 5, 5e-3, 30e-3)
    assert again.controller.plan.digest() != plain.digest()


@pytest.mark.parametrize(
    "change", [{"target": (0.0, 0.0, 1e-9)}, {"steps": 6}, {"longest": 5.1e-3}, {"astray": 31e-3}, None]
)
def test_every_bound_is_in_the_digest(change):
    plan = replace(some_plan(), correction=BOUNDS)
    other = replace(plan, correction=None if change is None else replace(BOUNDS, **change))
    assert other.digest() != plan.digest() == replace(plan, correction=replace(BOUNDS)).digest()


@pytest.mark.parametrize("correct", [False, True])
def test_bounds_that_nobody_asked_for_are_no_plan(session, correct):
    """As of a process that plans by other settings."""
    session.correct = correct
    answers = session.planning._answers

    def wider(order):
        for answer in answers(order):
            yield session.planning.corrected(answer, replace(BOUNDS, steps=20))

    session.planning._answers = wider
    session.aimed()
    session.right = {"grip": 1.0, "trigger": 1.0}
    intent = session.until(lambda intent: intent.mode == "plan" or intent.notice)
    intent = session.until(lambda intent: intent.mode == "aim")
    assert intent.notice == "no plan: correction: found bounds that nobody asked for"
    assert session.controller.plan is None


def stopped(session):
    session.controller.stop()
    session.wait(0.2)


def unwritten(session):
    session.log.fault = "log: no space left"
    session.wait(0.2)


def unaligned(session):
    session.controller.align(BASE, "it is not sure enough")
    session.wait(0.2)


def elsewhere(session):
    session.controller.world = make_world((), ())
    session.controller.world = replace(session.controller.world, digest="another")
    session.wait(0.2)


ENDS = [stopped, let_go, untracked, hidden, undrawn, handed_over, unwritten, unaligned, elsewhere]


@pytest.mark.parametrize("phase", ["rests", "moves"])
@pytest.mark.parametrize("happens", ENDS)
def test_whatever_holds_a_robot_that_executes_holds_one_that_corrects_itself_for_good(session, happens, phase):
    session.corrects(phase)
    before = session.robot.commands.copy()
    happens(session)
    assert not session.phase
    session.assert_nothing_follows()
    done = 1.0 if happens is undrawn else 0.9  # a step under way ends before the robot waits for a picture
    most = done * session.planning.change * (1 + 1e-9) if phase == "moves" else 0.0
    assert np.abs(session.robot.commands - before).max() <= most
    ended = happens is undrawn and phase == "moves"
    words = "corrected from 5.1 to 3.1 mm in 1 step: " if ended else ("not corrected, 5.1 mm off: ", "not corrected: ")
    assert session.words.startswith(words)


def test_a_stop_that_comes_with_the_answer_is_before_it(session):
    session.planning.mute = True
    session.corrects("asks")
    order = session.planning.orders[-1]
    session.controller.answered(session.planning.step(order), session.now)
    session.controller.stop()
    session.tick()
    assert session.controller.intent.mode == "stopped"
    assert session.robot.state().mode == "done"
    session.assert_nothing_follows()


@pytest.mark.parametrize("happens", ["unaligned", "log"])
def test_where_nothing_may_be_executed_the_answer_starts_no_step(session, happens):
    session.planning.mute = True
    session.corrects("asks")
    session.controller.answered(session.planning.step(session.planning.orders[-1]), session.now)
    if happens == "log":
        session.log.fault = "log: no space left"
    else:
        session.controller.align(BASE, "it is not sure enough")
    session.tick()
    assert session.robot.state().mode == "done"
    session.wait(1.0)
    assert session.travelled == 0


def test_a_robot_whose_correction_has_ended_is_permitted_nothing_more(session):
    session.corrects()
    permits = session.robot.permits
    session.controller.correction.end("the end")
    for _ in range(3):  # it brakes still
        session.tick()
    assert session.robot.permits == permits


@pytest.mark.parametrize("phase", ["arrives", "rests", "asks", "moves"])
def test_a_stream_that_is_not_sound_ends_it_where_it_is(session, phase):
    session.planning.mute = phase == "asks"
    if phase == "arrives":
        session.executing()
    else:
        session.corrects(phase)
    session.cameras.fault = "found the labels 'a' and 'b' taken for each other, expected measured poses"
    session.until(lambda intent: intent.mode == "aim")
    assert "cameras: found the labels" in session.words
    permits = session.robot.permits
    session.assert_nothing_follows()
    assert session.robot.permits == permits
    if phase != "arrives":
        assert session.travelled < (0.8 if phase == "moves" else 1e-9)
    assert len(session.planning.orders) == (0 if phase in ("arrives", "rests") else 1)


def test_without_cameras_it_ends(session):
    session.corrects("rests")
    session.controller.cameras = session.controller.arm = None
    session.until(lambda intent: intent.mode == "aim")
    assert session.words == "not corrected: there are no cameras"
    session.assert_nothing_follows()


def test_a_tip_far_off_ends_it_before_a_step_and_within_one(session):
    session.corrects()
    session.cameras.shift = np.array([0.0, 0.04, 0.0])
    session.until(lambda intent: intent.mode == "aim")
    assert "the tip is 40 mm off, expected at most 30 mm" in session.words
    session.assert_nothing_follows()
    assert session.travelled < 0.9
    other = Correcting()
    other.cameras.shift = np.array([0.0, 0.04, 0.0])
    other.executing().until(lambda intent: intent.mode == "aim")
    assert other.words == "not corrected, 40.3 mm off: the tip is 40 mm off, expected at most 30 mm"
    assert other.planning.orders == []


@pytest.mark.parametrize("off", [(0.0, 0.0051, 0.0), (0.004, 0.0, -0.004)])
def test_cameras_that_see_the_mount_elsewhere_than_the_joints_have_it_correct_nothing(session, off):
    session.cameras.mount, session.cameras.shift = np.array(off), np.array([0.0, 0.04, 0.0])  # as of the whole frame
    session.executing().until(lambda intent: intent.mode == "aim")
    apart = f"{1e3 * np.linalg.norm(off):.1f}"
    words = f": cameras see the mount {apart} mm from where the joints have it, expected at most 5 mm"
    assert session.words == f"not corrected, 40.3 mm off{words}"
    assert session.planning.orders == []
    session.assert_nothing_follows()


def test_a_mount_that_is_seen_about_where_it_is_or_seldom_elsewhere_is_corrected_by(session):
    session.cameras.mount = np.array([0.0, 0.0049, 0.0])
    session.corrects("rests")
    session.cameras.mount = np.array([0.0, 0.04, 0.0])  # an outlier
    session.wait(3 * DT)
    session.cameras.mount = np.full(3, np.nan)
    session.wait(3 * DT)
    session.cameras.mount = np.array([0.0, 0.0049, 0.0])
    session.until(lambda intent: intent.mode == "aim")
    assert session.words == "corrected from 5.1 to 1.1 mm in 2 steps: arrived"
    (mount,) = [fields for kind, fields in session.log.events if kind == "mount"]
    assert mount == {"apart": pytest.approx(4.9e-3), "expected": 5e-3}


def test_a_mount_that_is_never_seen_is_not_corrected_by(session):
    session.cameras.mount = np.full(3, np.nan)
    session.executing().until(lambda intent: intent.mode == "aim")
    assert session.words == "not corrected, 5.1 mm off: no camera has seen the body at the mount"
    assert session.planning.orders == []


def test_without_a_body_at_the_mount_it_is_told_once(session):
    session.cameras.mounted = False
    session.executing().until(lambda intent: intent.mode == "aim")
    assert session.words == f"corrected from 5.1 to 1.1 mm in 2 steps: arrived; {UNCHECKED}"
    correction = session.controller.correction
    assert not correction.rests  # nothing has checked the frame that they are in
    correction.begin(9, replace(some_plan(), correction=BOUNDS), session.controller.world)
    correction._errors.append(1e-3)
    correction.end("the end")
    assert correction.words == "not corrected, 1.0 mm off: the end"


def test_a_tip_that_ended_farther_off_is_told_plainly(session):
    session.planning.change = -2e-3
    session.executing().until(lambda intent: intent.mode == "aim")
    assert session.words == "the tip ended farther off than before, from 5.1 to 9.1 mm in 2 steps: arrived"
    assert not session.controller.correction.rests  # of an arm that does what its twin does not


def test_an_outlier_ends_nothing(session):
    session.corrects("rests")
    session.cameras.shift = np.array([0.0, 0.04, 0.0])
    session.wait(2 * DT)
    session.cameras.shift = np.zeros(3)
    session.until(lambda intent: intent.mode == "aim")
    assert session.words.endswith("in 2 steps: arrived")


@pytest.mark.parametrize("how", ["swings", "invisible"])
def test_a_tip_that_is_not_seen_at_rest_is_not_corrected(session, monkeypatch, how):
    monkeypatch.setattr(correction_control, "PATIENCE", 3.0)
    session.cameras.moves = 3e-3 if how == "swings" else np.nan
    session.executing().until(lambda intent: intent.mode == "aim")
    assert session.words == "not corrected: the tip is not seen at rest within 3 s"
    assert session.planning.orders == []


def test_a_tip_that_vanishes_as_it_moves_stops_it(session):
    session.planning.change = 4.9e-3
    session.corrects()
    session.cameras.moves = np.nan
    session.robot._plan = replace(session.robot._plan, step=10 * DT)  # a slow step
    session.until(lambda intent: intent.mode == "aim")
    assert "no camera has seen the tip for 0.5 s" in session.words
    session.assert_nothing_follows()


@pytest.mark.parametrize("how", ["silent", "ended"])
def test_without_the_process_that_plans_it_ends(session, how):
    session.planning.mute = True
    session.corrects("asks")
    if how == "ended":
        session.controller.answered(None, session.now)
    else:
        session.wait(ANSWERS + 0.2)
    session.until(lambda intent: intent.mode == "aim", 0.5)
    assert "the process that plans has" in session.words
    order = session.planning.orders[-1]
    session.controller.answered(session.planning.step(order), session.now)  # it comes too late
    session.assert_nothing_follows()


@pytest.mark.parametrize(("serial", "number"), [(1, 0), (0, 0), (0, 1), (-1, 0)])
def test_only_the_answer_to_what_was_asked_for_last_moves_anything(session, serial, number):
    """Offsets from the order's."""
    session.planning.mute = True
    session.corrects("asks")
    answer = session.planning.step(session.planning.orders[-1])
    other = replace(answer, serial=answer.serial + serial, number=answer.number + number)
    session.controller.answered(other, session.now)
    session.wait(0.1)
    assert (session.robot.state().mode == "running") == ((serial, number) == (0, 0))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"change": 5.01e-3}, "a step changes the commands by 5.0 mm, expected at most 5 mm"),
        ({"change": -6e-3}, "a step changes the commands by 6.0 mm, expected at most 5 mm"),
        ({"change": np.nan}, "a step moves the rigid robot, or has values that are not finite"),
        ({"joints": 1e-9}, "a step moves the rigid robot, or has values that are not finite"),
    ],
)
def test_a_step_beyond_its_bounds_is_not_started(session, changes, reason):
    for name, value in changes.items():
        setattr(session.planning, name, value)
    session.executing().until(lambda intent: intent.mode == "aim")
    assert session.words == f"not corrected, 5.1 mm off: {reason}"
    np.testing.assert_array_equal(session.robot.commands, session.planning.plans[0].commands[-1])
    session.assert_nothing_follows()


def test_no_more_steps_than_were_confirmed(session):
    session.planning.arrives, session.planning.change = 99, 1e-3
    session.executing().until(lambda intent: intent.mode == "aim", 60.0)
    assert session.words == "corrected from 5.1 to 0.1 mm in 5 steps: found a step after 5, expected none"


def test_a_fault_of_the_robot_in_a_step_stops_it(session):
    session.corrects()
    faulty(session)
    session.tick()
    assert session.controller.intent.mode == "stopped"
    session.assert_nothing_follows()


@pytest.mark.parametrize(
    ("refused", "within", "words"),
    [("busy: another plan runs", 0.5, ": busy: another plan runs"), ("", 1.0, ": a step did not start within 0.2 s")],
)
def test_a_step_that_the_robot_refuses_or_does_not_start_ends_it(session, monkeypatch, refused, within, words):
    monkeypatch.setattr(correction_control, "STARTS", 0.2)
    session.planning.mute = True
    session.corrects("asks")
    session.controller.correction._start = lambda plan, digest: refused
    session.controller.answered(session.planning.step(session.planning.orders[-1]), session.now)
    session.until(lambda intent: intent.mode == "aim", within)
    assert session.words.endswith(words)


# --- what is asked for


CUP = WorldObject("the cup", "cylinder", 0.05, 0.12, 0.1, (9.0, 9.0, 9.0))
FREE = Targets(Target((0.0, 0.0, 0.0)), Target(TIP), (0.0, 0.0, -1.0), 0.0, 0, 0.0)
UNASKED = [
    ("", "", True, ""),
    ("the cup", "", True, "the arm would touch the cup"),
    ("", "found no frame for 0.20 s", True, "cameras: found no frame for 0.20 s"),
    ("", "", False, "the session has no cameras"),
]


@pytest.mark.parametrize(("object", "fault", "cameras", "reason"), UNASKED)
def test_why_a_plan_is_not_asked_to_correct_itself(session, object, fault, cameras, reason):
    session.cameras.fault = fault
    session.controller.cameras = session.cameras if cameras else None
    session.tick()
    controller, orders = session.controller, []
    assert controller.why_uncorrected(replace(FREE, object=object)) == reason
    controller.previewer = SimpleNamespace(submit=orders.append, leave=lambda: None)
    request = SimpleNamespace(serial=7, targets=replace(FREE, object=object))
    intent = SimpleNamespace(request=request, mode="plan")
    controller._ask(intent, session.robot.robot_state(), True)
    assert orders[0].uncorrected == reason
    assert orders[0].correction == (None if reason else CorrectionBounds(TIP, 5, 5e-3, 30e-3))


# --- bounds


def step(*rows, joints=START, **changes) -> Plan:
    commands = STRAIGHT + 1e-3 * np.array(rows, float)
    plan = Plan(0.1, np.tile(joints, (len(rows), 1)), commands, (("correction", 0),), PACKAGE, "world")
    return replace(plan, **changes)


WITHIN = replace(some_plan(), correction=BOUNDS)
WITHOUT = some_plan()
CASES = [
    (WITHIN, step((0, 0, 0), (5, 0, 0)), ""),
    (WITHIN, step((0, 0, 0), (3, 4, 0)), ""),
    (WITHIN, step((0, 0, 0), (-3, 0, 4)), ""),
    (WITHIN, step((0, 0, 0), (3, 4, 0.2)), "by 5.0 mm, expected at most 5 mm"),
    (WITHIN, step((0, 0, 0), (6, 0, 0), (0, 0, 0)), "by 6.0 mm, expected at most 5 mm"),
    (WITHIN, step((20, 0, 0), (25, 0, 0)), ""),
    (WITHIN, step((24, 0, 0), (25.1, 0, 0)), "would be 25.1 mm from the plan's, expected at most 25 mm"),
    (WITHIN, step((26, 0, 0), (22, 0, 0)), "would be 26.0 mm from the plan's"),
    (WITHIN, step((0, 0, 0), (np.nan, 0, 0)), "not finite"),
    (WITHIN, step((0, 0, 0), (1, 0, 0), joints=START + 1e-12), "moves the rigid robot"),
    (WITHIN, step((0, 0, 0), (1, 0, 0), package="b" * 64), "another package, world or correction"),
    (WITHIN, step((0, 0, 0), (1, 0, 0), world="other"), "another package, world or correction"),
    (WITHIN, step((0, 0, 0), (1, 0, 0), correction=BOUNDS), "another package, world or correction"),
    (WITHOUT, step((0, 0, 0), (1, 0, 0)), "the plan that was confirmed does not correct itself"),
]


@pytest.mark.parametrize(("plan", "taken", "reason"), CASES)
def test_what_a_step_may_change(plan, taken, reason):
    words = beyond_bounds(taken, plan, STRAIGHT, taken.commands[0])
    assert reason in words
    assert bool(reason) == bool(words)


def test_a_step_begins_where_the_motors_are():
    taken = step((0, 0, 0), (3, 0, 0))
    aside = taken.commands[0] + [0.0, 5e-4, 0.0]
    assert beyond_bounds(taken, WITHIN, STRAIGHT, aside) == "a step begins 0.5 mm from the commands as they are"


def test_what_the_core_hears_of_a_robot_without_a_correction_is_the_robots(session):
    for report in (ExecutorReport("running", "a"), ExecutorReport("done", "a"), ExecutorReport("fault", "a", "why")):
        assert session.controller.correction.report(report) is report
