"""Both ends of the shared memory by themselves, on a clock that a test turns: what the robot's process takes for a
permit and a stop, and what the server takes for a sign of it."""

import multiprocessing
import queue
from dataclasses import replace
from multiprocessing.context import SpawnContext

import numpy as np
import pytest

from tests.ar.session.test_robot_process import Still
from tests.ar.teleop.test_plan import START, STRAIGHT
from tests.support.operator import PACKAGE, config
from trunkline.ar.session import robot_process, simulated
from trunkline.ar.session.robot_process import (
    DEAD_MAN,
    HOLD_TIME,
    LOOKS,
    MODE,
    MODES,
    PERMIT,
    PERMITTED,
    READY,
    SERIAL,
    STALE,
    STOPS,
    TIME,
    WAITS,
    Goal,
    RobotChannel,
    RobotProcess,
)
from trunkline.ar.session.simulated import LISTENS, Loop
from trunkline.ar.teleop.executor import BRAKE, FOLLOWS, PlanFollower
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import gentle, limits_of

NEAR, TICK, BEGINS = 1e-6, Still.tick, 100.0
LIMITS = limits_of(config().motors)
HERE = np.append(START, STRAIGHT)
FOLLOWING = Following(0.3, 0.0, 0.05)


def plan_of(turn=0.5) -> Plan:
    rows = gentle(HERE, HERE + turn * np.eye(10)[0], LIMITS, 0.002, 2.0)
    return Plan(0.002, rows[:, :7], rows[:, 7:], (("approach", 0),), PACKAGE, "world")


class Played:
    """The robot's process, turn by turn; `serial`: of what was started last."""

    def __init__(self):
        self.channel = RobotChannel(multiprocessing.get_context("spawn"), 3, 0)
        self.channel.plans = queue.Queue()
        self.plant = Still()
        self.robot = PlanFollower(START, STRAIGHT, LIMITS, PACKAGE)
        self.loop, self.now, self.serial = Loop(self.channel, self.robot, self.plant), BEGINS, 0

    def permit(self, serial=None, ago=0.0, waits=False):
        asked = self.channel.requests
        asked[WAITS] = waits
        asked[PERMIT], asked[PERMITTED] = self.now - ago, self.serial if serial is None else serial

    def begin(self, what, stops=None) -> "Played":
        """A plan, or to follow, permitted."""
        self.serial += 1
        digest = what.digest() if isinstance(what, Plan) else FOLLOWS
        self.channel.plans.put((self.serial, digest, what, self.channel.requests[STOPS] if stops is None else stops))
        self.permit()
        self.loop.turn(self.now)
        return self

    def turn(self, seconds, permits=True, **how):
        """Ticks for so long."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            if permits:
                self.permit(**how)
            self.loop.turn(self.now, woken=False)
            self.loop.advance()
        return self

    @property
    def report(self):
        self.loop.tell(self.now)
        return self.channel.hear()

    @property
    def mode(self):
        return MODES[int(self.report[0][MODE])]

    def rests(self, seconds=0.3) -> bool:
        before = self.robot.joints.copy()
        self.turn(seconds)
        return np.array_equal(self.robot.joints, before)


@pytest.fixture
def played():
    return Played()


@pytest.mark.parametrize("what", [plan_of(), FOLLOWING], ids=["plan", "following"])
@pytest.mark.parametrize(
    ("serial", "ago", "goes_on"),
    [(None, 0.0, True), (None, DEAD_MAN - NEAR, True), (None, DEAD_MAN + NEAR, False), (0, 0.0, False), (1, 0.0, False),
     (3, 0.0, False), (0, 9.0, False)],
)  # fmt: skip
def test_only_a_fresh_permit_for_what_was_started_last_counts(played, what, serial, ago, goes_on):
    """The second start; a permit for the first, for a later one, and for none, which is a stop's."""
    played.begin(FOLLOWING).turn(0.1, permits=False)
    assert played.mode == "idle"
    played.begin(what)
    assert played.mode == "running"
    played.turn(0.1)
    played.turn(BRAKE + 0.05, serial=serial, ago=ago)
    assert (played.mode == "running") == goes_on


def test_a_plan_that_is_permitted_to_wait_rests_on_its_way_and_goes_on_when_it_need_not(played):
    played.begin(plan_of()).turn(0.5)
    played.turn(BRAKE + 2 * TICK, waits=True)
    here = played.robot.joints.copy()
    played.turn(0.3, waits=True)
    np.testing.assert_array_equal(played.robot.joints, here)
    assert played.mode == "running"
    played.turn(0.3)
    assert np.abs(played.robot.joints - here).max() > 0
    assert played.mode == "running"


def test_without_a_permit_it_brakes_after_so_long_and_goes_on_by_none(played):
    played.begin(plan_of()).turn(0.5)
    played.turn(DEAD_MAN - TICK, permits=False)
    assert played.robot._pace == 1.0
    played.turn(2 * TICK, permits=False)
    assert played.robot._pace < 1.0
    hold_time = played.report[0][HOLD_TIME]
    assert DEAD_MAN <= hold_time - (BEGINS + 0.5) + NEAR < DEAD_MAN + 2 * TICK
    played.turn(BRAKE / 2, permits=False)
    assert played.report[0][HOLD_TIME] == hold_time  # when it was told to hold, not since when it rests
    played.turn(BRAKE)  # permitted again
    assert played.mode == "idle"
    assert played.report[0][HOLD_TIME] == hold_time
    assert played.rests()


@pytest.mark.parametrize("times", [1, 2])
def test_a_stop_counts_though_it_is_permitted(played, times):
    played.begin(plan_of()).turn(0.5)
    played.channel.requests[STOPS] += times
    played.turn(TICK)
    assert played.report[0][HOLD_TIME] == played.now
    assert played.robot._pace < 1.0
    played.turn(BRAKE)
    assert played.mode == "idle"
    assert played.rests()


def test_a_stop_that_comes_before_what_it_stops_counts(played):
    stops = played.channel.requests[STOPS]
    played.channel.requests[STOPS] += 1
    played.begin(plan_of(), stops)
    assert played.mode == "fault"
    assert played.report[1] == "a stop came before it began"
    assert played.rests()
    played.begin(plan_of())
    assert played.mode == "running"


@pytest.mark.parametrize("ahead", [-1, 1])
def test_what_targets_ask_for_counts_for_what_follows_them_alone(played, ahead):
    """Of an older or a later start it is nothing."""
    played.begin(FOLLOWING)
    goal = HERE + 0.05 * np.eye(10)[0]
    for serial in (played.serial + ahead, played.serial):
        for _ in range(10):
            played.channel.plans.put((serial, FOLLOWS, Goal(played.now, goal), played.channel.requests[STOPS]))
            played.loop.turn(played.now)
            played.turn(0.1)
        moved = played.robot.joints[0] - START[0]
        assert moved == pytest.approx(0.05 if serial == played.serial else 0.0, abs=1e-6)


def test_a_plan_is_looked_for_for_a_while_after_it_was_woken(played):
    played.loop.turn(played.now, woken=True)
    digest = plan_of().digest()
    for late, begun in ((LISTENS + NEAR, False), (LISTENS - NEAR, True)):
        played.channel.plans.put((1, digest, plan_of(), played.channel.requests[STOPS]))
        played.serial = 1
        played.permit(ago=-1.0)
        played.loop.turn(played.now + late, woken=False)
        assert (played.robot.state().mode == "running") == begun


def test_a_plant_that_fails_stops_the_robot_and_lasts(played, monkeypatch):
    monkeypatch.setattr(simulated.time, "monotonic", lambda: played.now)
    played.begin(plan_of()).turn(0.5)
    played.plant.fault = "motors: silent"
    played.turn(TICK)
    assert played.mode == "fault"
    assert played.report[1] == "motors: silent"
    assert played.report[0][HOLD_TIME] == played.now
    played.turn(BRAKE + TICK)
    assert played.rests()
    assert played.begin(plan_of()).mode == "fault"
    assert played.report[1] == "motors: silent"
    assert played.rests()
    played.plant.fault = "robot: reflex"
    played.turn(TICK)
    assert played.report[1] == "motors: silent"


@pytest.mark.parametrize("first", range(3))
def test_why_a_plan_does_not_begin(played, first):
    """A stop on the way comes before a fault of what is moved, and that before what is wrong with the plan."""
    reasons = ["a stop came before it began", "motors: silent", "package: found digest bbbb"]
    plan = replace(plan_of(), package="b" * 64)
    played.plant.fault = "motors: silent" if first < 2 else ""
    played.begin(plan, stops=played.channel.requests[STOPS] - (first < 1))
    assert played.report[1].startswith(reasons[first])


# --- the server's end


class Clock:
    def __init__(self):
        self.now = BEGINS

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


class There:
    """A process that is there until `ended`."""

    def __init__(self, target, args, daemon, name):
        self.ended, self.pid, self.looked = False, 1, 0

    def start(self):
        pass

    def is_alive(self):
        self.looked += 1
        return not self.ended

    def terminate(self):
        self.ended = True

    def join(self, seconds=None):
        pass


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(robot_process, "time", made)
    return made


@pytest.fixture
def robot(clock, monkeypatch):
    monkeypatch.setattr(SpawnContext, "Process", There)
    made = RobotProcess(lambda: None, (), 3, 0, LIMITS, PACKAGE)
    made.channel.plans = queue.Queue()
    made.channel.plans.cancel_join_thread = lambda: None
    tell(made, clock)
    return made


def tell(robot, clock, mode="idle", serial=0, ago=0.0, ready=True, fault="", joints=HERE):
    numbers = np.zeros(robot.channel.size)
    numbers[[TIME, MODE, SERIAL, READY]] = clock.now - ago, MODES.index(mode), serial, ready
    numbers[5:15] = joints
    robot.channel.tell(numbers, fault)


@pytest.mark.parametrize(
    ("numbers", "alive", "report"),
    [
        ({}, True, ExecutorReport("idle", "")),
        ({"mode": "running"}, True, ExecutorReport("running", "")),
        ({"mode": "done"}, True, ExecutorReport("done", "")),
        ({"mode": "fault", "fault": "reflex"}, True, ExecutorReport("fault", "", "reflex")),
        ({"mode": "idle", "fault": "reflex"}, True, ExecutorReport("idle", "")),
        ({"mode": "running", "ago": STALE - NEAR}, True, ExecutorReport("running", "")),
        ({"mode": "running", "ago": STALE + NEAR}, True,
         ExecutorReport("fault", "", "its process is silent for 0.15 s")),
        ({"mode": "running", "ago": 1.0}, True, ExecutorReport("fault", "", "its process is silent for 1.00 s")),
        ({"mode": "running", "ago": 1.0, "ready": False}, True, ExecutorReport("running", "")),
        ({"mode": "running"}, False, ExecutorReport("fault", "", "its process has ended")),
        ({"mode": "running", "ago": 1.0}, False, ExecutorReport("fault", "", "its process has ended")),
        ({"mode": "fault", "fault": "reflex", "ago": 1.0}, True,
         ExecutorReport("fault", "", "its process is silent for 1.00 s")),
    ],
)  # fmt: skip
def test_what_a_robot_does(robot, clock, numbers, alive, report):
    tell(robot, clock, **numbers)
    robot._process.ended = not alive
    assert robot.state() == report


def test_whether_its_process_is_there_is_looked_at_seldom_and_not_too_seldom(robot, clock):
    assert robot.alive
    robot._process.ended, looked = True, robot._process.looked
    clock.now += LOOKS - NEAR
    assert robot.alive
    assert robot._process.looked == looked
    clock.now += 2 * NEAR
    assert not robot.alive


def test_a_start_is_on_its_way_until_the_robot_tells_of_it(robot, clock):
    plan = plan_of()
    assert robot.start(plan, plan.digest()) == ""
    serial, digest, asked, stops = robot.channel.plans.get_nowait()
    assert (serial, digest, asked, stops) == (1, plan.digest(), plan, robot.channel.requests[STOPS])
    assert (robot.channel.requests[PERMITTED], robot.channel.requests[PERMIT]) == (1, clock.now)
    robot.permit(waits=True)
    robot._begin(plan, plan.digest())  # a step of a correction, say
    assert robot.channel.requests[WAITS]
    robot.stop()
    assert not robot.channel.requests[WAITS]
    robot._begin(plan, plan.digest())
    assert not robot.channel.requests[WAITS]
    robot._serial = 1
    tell(robot, clock, "done", serial=0)
    assert robot.state() == ExecutorReport("idle", "")
    tell(robot, clock, "running", serial=1)
    assert robot.state() == ExecutorReport("running", plan.digest())


def test_what_is_not_started_is_not_sent_and_not_permitted(robot, clock):
    plan = plan_of()
    wrong, elsewhere = replace(plan, package="b" * 64), replace(plan, joints=plan.joints + 0.01)
    for asked, digest, reason in (
        (wrong, plan.digest(), "digest: found"), (wrong, wrong.digest(), "package: found"),
        (elsewhere, elsewhere.digest(), "plan: starts 0.01 away"),
    ):  # fmt: skip
        assert robot.start(asked, digest).startswith(reason)
    tell(robot, clock, "running")
    assert robot.start(plan, plan.digest()) == "busy: another plan runs"
    assert robot.follow(FOLLOWING) == "busy: another plan runs"
    assert robot.channel.plans.empty()
    assert not robot.channel.requests.any()


def test_a_stop_takes_the_permit_back_and_is_counted(robot, clock):
    plan = plan_of()
    robot.start(plan, plan.digest())
    clock.now += 0.01
    robot.permit()
    assert (robot.channel.requests[PERMIT], robot.channel.requests[PERMITTED]) == (clock.now, 1)
    for count in (1, 2):
        robot.stop()
        assert robot.channel.requests[PERMITTED] == 0
        assert robot.channel.requests[STOPS] == count


def test_what_is_started_knows_how_many_stops_there_were(robot, clock):
    robot.stop()
    robot.follow(FOLLOWING)
    assert robot.channel.plans.get_nowait()[3] == 1
    robot.hear(0.25, HERE)
    serial, digest, goal, stops = robot.channel.plans.get_nowait()
    assert (serial, digest, goal.time, stops) == (1, FOLLOWS, clock.now - 0.25, 1)


@pytest.mark.parametrize("comes_to_rest", [True, False])
def test_a_process_is_ended_once_its_robot_rests_or_has_not_for_too_long(robot, clock, comes_to_rest):
    tell(robot, clock, "running")

    def sleeping(seconds):
        assert not robot._process.ended
        clock.now += seconds
        tell(robot, clock, "idle" if comes_to_rest and clock.now > BEGINS + 0.1 else "running")

    clock.sleep = sleeping
    robot.close()
    assert robot.channel.requests[STOPS] == 1
    assert robot._process.ended
    assert clock.now - BEGINS == pytest.approx(0.1 if comes_to_rest else robot_process.RESTING, abs=2 * LOOKS)
