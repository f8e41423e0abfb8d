"""Which plans a robot runs: every axis's speed, every joint's range on both sides, and where it starts, each decides by
itself and from both sides of its border."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.operator import READY_JOINTS, config
from trunkline.ar.teleop import executor
from trunkline.ar.teleop.executor import AT_START, BRAKE, ROUNDING, PlanFollower
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS, limits_of
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN

PACKAGE, STEP, NEAR = "a" * 64, 0.01, 1e-6
STRAIGHT, LIMITS = np.full(3, 0.5), limits_of(config().motors)
HERE = np.append(READY_JOINTS, STRAIGHT)
AXES = range(len(HERE))
NAMES = [f"joint {n}" for n in range(1, 8)] + [f"tendon {n}" for n in range(1, 4)]


def plan_of(rows: np.ndarray, step: float = STEP, package: str = PACKAGE) -> Plan:
    return Plan(step, rows[:, :JOINTS], rows[:, JOINTS:], (("approach", 0),), package, "world")


def still(rows: int = 3) -> np.ndarray:
    return np.tile(HERE, (rows, 1))


def robot(at: np.ndarray = HERE) -> PlanFollower:
    return PlanFollower(at[:JOINTS], at[JOINTS:], LIMITS, PACKAGE)


def moving(axis: int, speed: float, row: int = 1) -> np.ndarray:
    """Rows in which one axis moves at `speed` from row `row` to the next, and then stays."""
    rows = still(4)
    rows[row + 1 :, axis] += speed * STEP
    return rows


@pytest.mark.parametrize("row", [0, 2])
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", AXES, ids=NAMES)
def test_no_axis_moves_faster_than_its_limit(axis, sign, row):
    """Joints and tendons, either way, at the plan's beginning and at its end."""
    most = ROUNDING * LIMITS.velocity[axis]
    assert robot().check(plan_of(moving(axis, sign * most * (1 - NEAR), row))) == ""
    message = robot().check(plan_of(moving(axis, sign * most * (1 + NEAR), row)))
    assert message == f"plan: {NAMES[axis]} moves at {most:.3g}, expected at most {LIMITS.velocity[axis]:.3g}"


def test_the_axis_that_is_named_is_the_one_that_is_furthest_beyond_its_own_limit():
    rows = moving(0, 1.1 * LIMITS.velocity[0])
    rows[2:, 8] += 1.5 * LIMITS.velocity[8] * STEP
    assert robot().check(plan_of(rows)).startswith("plan: tendon 2 moves at ")


@pytest.mark.parametrize("side", ["low", "high"])
@pytest.mark.parametrize("joint", range(JOINTS))
def test_no_joint_leaves_its_range_on_either_side(joint, side):
    """Not on the way either: the plan ends where it began."""
    border = (Q_MIN if side == "low" else Q_MAX)[joint]
    outwards = -1 if side == "low" else 1
    for beyond, expected in ((-NEAR, ""), (0.0, ""), (NEAR, "plan: a joint leaves its range")):
        at = HERE.copy()
        at[joint] = border - outwards * 1e-4
        rows = np.tile(at, (3, 1))
        rows[1, joint] = border + outwards * beyond
        assert robot(at).check(plan_of(rows)) == expected


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", AXES, ids=NAMES)
def test_a_plan_begins_where_the_robot_is(axis, sign):
    off = sign * np.eye(len(HERE))[axis]
    assert robot(HERE + (AT_START - NEAR) * off).check(plan_of(still())) == ""
    message = robot(HERE + (AT_START + NEAR) * off).check(plan_of(still()))
    assert message == "plan: starts 0.001 away from where the robot is"


def test_nobody_runs_a_plan_from_a_place_that_is_not_known():
    assert robot(np.full(10, np.nan)).check(plan_of(still())) == "plan: starts nan away from where the robot is"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", AXES, ids=NAMES)
def test_a_value_that_is_no_number_is_refused(axis, value):
    rows = still()
    rows[1, axis] = value
    assert robot().check(plan_of(rows)) == "plan: found values that are not finite"


@pytest.mark.parametrize("step", [0.0, -STEP, np.nan, np.inf])
def test_a_plan_whose_time_does_not_go_on_is_refused(step):
    """However fast its axes move: by such a step no speed is told."""
    rows = moving(0, 1e3)
    assert robot().check(plan_of(rows, step)) == f"plan: found a step of {step:g} s, expected a positive time"


def test_a_plan_of_one_row_moves_nothing_and_is_run():
    assert robot().check(plan_of(still(1))) == ""


FAULTS = {  # in the order in which they are told
    "package": lambda plan: replace(plan, package="b" * 64),
    "plan: found values": lambda plan: replace(plan, commands=plan.commands * [np.nan, 1, 1]),
    "plan: found a step": lambda plan: replace(plan, step=-plan.step),
    "plan: a joint leaves": lambda plan: replace(plan, joints=plan.joints + np.eye(len(plan.joints), JOINTS) * 9.0),
    "plan: joint 2 moves": lambda plan: replace(
        plan, joints=plan.joints + np.outer([0, 0, 1], np.eye(JOINTS)[1]) * 5 * LIMITS.velocity[1] * STEP
    ),
    "plan: starts": lambda plan: replace(plan, joints=plan.joints + 0.01),
}


@pytest.mark.parametrize("first", range(len(FAULTS)))
def test_of_several_faults_the_first_is_told(first):
    plan = plan_of(still())
    for change in list(FAULTS.values())[:first:-1] + [list(FAULTS.values())[first]]:
        plan = change(plan)
    assert robot().check(plan).startswith(list(FAULTS)[first])


def test_what_is_checked_is_not_run():
    """A start that is refused leaves the robot as it was; busy and digest come before all else."""
    made, plan = robot(), plan_of(still())
    wrong = replace(plan, package="b" * 64)
    assert made.start(wrong, plan.digest()).startswith("digest: found ")
    assert made.start(wrong, wrong.digest()).startswith("package: found ")
    assert made.state().mode == "idle"
    assert made.start(plan, plan.digest()) == ""
    assert made.start(wrong, plan.digest()) == "busy: another plan runs"
    assert made.state().digest == plan.digest()


@pytest.mark.parametrize("dt", [0.001, 0.004, 0.01])
def test_a_stop_takes_as_long_as_it_may_and_counts_once(dt):
    """Time slows evenly to 0 within BRAKE, so half as far is gone; a second stop does not begin anew."""
    rows = still(101)
    rows[:, 0] += 0.5 * LIMITS.velocity[0] * STEP * np.arange(101)
    made, plan = robot(), plan_of(rows)
    assert made.start(plan, plan.digest()) == ""
    made.advance(0.3)
    before, took = made.joints[0], 0.0
    while made.state().mode == "running":
        made.stop()
        made.advance(dt)
        took += dt
    assert took == pytest.approx(BRAKE, abs=1.01 * dt)
    assert made.joints[0] - before == pytest.approx(0.5 * LIMITS.velocity[0] * BRAKE / 2, rel=0.02)
    assert made.state().mode == "idle"
    assert made.state().digest == plan.digest()


@pytest.mark.parametrize("dt", [0.001, 0.01])
def test_what_waits_slows_to_rest_on_its_way_and_goes_on_to_the_end_of_its_plan(dt):
    rows = still(101)
    rows[:, 0] += 0.5 * LIMITS.velocity[0] * STEP * np.arange(101)
    made, plan, ways = robot(), plan_of(rows), []
    assert made.start(plan, plan.digest()) == ""
    for waits, seconds in ((False, 0.3), (True, 0.5), (False, 0.05), (True, 0.5), (False, 2.0)):
        made.waits, before = waits, made.joints[0]
        for _ in range(round(seconds / dt)):
            made.advance(dt)
        ways.append(made.joints[0] - before)
    speed = 0.5 * LIMITS.velocity[0]
    assert ways[:4] == pytest.approx(speed * np.array([0.3, BRAKE / 2, 0.05 / 4, 0.05 / 4]), rel=0.25)
    assert made.state().mode == "done"
    np.testing.assert_allclose(made.joints, plan.joints[-1])


def test_a_stop_ends_what_waits():
    rows = still(101)
    rows[:, 0] += 0.5 * LIMITS.velocity[0] * STEP * np.arange(101)
    made, plan = robot(), plan_of(rows)
    assert made.start(plan, plan.digest()) == ""
    made.waits, start = True, made.joints
    made.advance(0.2)
    np.testing.assert_array_equal(made.joints, start)
    assert made.state().mode == "running"
    made.stop()
    made.advance(0.01)
    assert made.state().mode == "idle"
    made.waits, here = False, made.joints
    made.advance(0.5)
    np.testing.assert_array_equal(made.joints, here)


# --- what a stop does to what runs


class Follower:
    """That counts how often it is told to brake."""

    refused, rests = "", False

    def __init__(self, *_) -> None:
        self.braked = 0

    def brake(self) -> None:
        self.braked += 1


@pytest.fixture
def followed(monkeypatch):
    """A robot that follows, and its follower."""
    follower = Follower()
    monkeypatch.setattr(executor, "Follower", lambda *_: follower)
    simulated = robot()
    assert simulated.follow(None, 0.01) == ""  # type: ignore[arg-type]
    return simulated, follower


def test_a_stop_brakes_what_follows_and_once(followed):
    simulated, follower = followed
    simulated.stop()
    assert follower.braked == 1
    simulated.stop()
    assert follower.braked == 1
    assert simulated.state() == ExecutorReport("running", executor.FOLLOWS)  # until it rests


def test_what_runs_takes_nothing_else(followed):
    plan, simulated = plan_of(still()), robot()
    assert simulated.start(plan, plan.digest()) == ""
    for runs in (simulated, followed[0]):
        assert runs.start(plan, plan.digest()) == "busy: another plan runs"
        assert runs.follow(None, 0.01) == "busy: another plan runs"  # type: ignore[arg-type]


def test_a_stop_of_what_does_not_run_stops_nothing_later():
    simulated, plan = robot(), plan_of(still())
    simulated.stop()
    assert simulated.state() == ExecutorReport()
    assert simulated.start(plan, plan.digest()) == ""
    simulated.advance(1.0)
    assert simulated.state() == ExecutorReport("done", plan.digest())
