"""A stop on a real machine: along the plan, and within what the Panda's joints can do."""

import numpy as np
import pytest

from tests.support.operator import config
from trunkline.ar.drivers.setpoint_filter import LIMITS
from trunkline.ar.drivers.time_scaling import Smoother, TimeScaledRobot
from trunkline.ar.teleop.executor import BRAKE
from trunkline.ar.teleop.following import KNOT, Following
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import limits_of, point_to_point
from trunkline.kinematics.panda.limits import ACCELERATION, JERK

READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
START = np.append(READY, [0.5, 0.5, 0.5])
PLANNED = limits_of(config().motors)
OFFSET, DELAY = 0.05, 0.5
TICK, PANDA, FR3 = 0.001, LIMITS["panda"], LIMITS["fr3"]


def planned(turn):
    rows = point_to_point(START, START + turn, PLANNED, 0.004)
    return Plan(0.004, rows[:, :7], rows[:, 7:], (("approach", 0),), "package", "world")


def stopped(plan, after):
    """Rows sent of `plan`, stopped `after` s, until it rests, (T, 10), smoothed."""
    smoother, rows = Smoother(START, 10), []
    robot = TimeScaledRobot(READY, START[7:], PLANNED, "package", lambda q, c, _: rows.append(np.append(q, c)), PANDA)
    assert robot.start(plan, plan.digest()) == ""
    while robot.state().mode == "running":
        robot.advance(TICK)
        if len(rows) * TICK >= after:
            robot.stop()
    return np.array([smoother.next(row) for row in rows + [rows[-1]] * 30])


@pytest.mark.parametrize("after", [0.1, 0.25, 0.4, 0.6, 0.8])
def test_a_stop_keeps_the_limits_and_stays_on_the_way(after):
    plan = planned(np.array([1.0, 0.8, 0.5, 0.8, 0.3, 0.6, 1.0, -0.05, 0.0, 0.0]))
    rows = stopped(plan, after)
    speed = np.diff(rows[:, :7], axis=0) / TICK
    gain = np.diff(speed, axis=0) / TICK
    assert (np.abs(gain) / ACCELERATION).max() < 1.01
    assert (np.abs(np.diff(gain, axis=0) / TICK) / JERK).max() < 1.0
    assert not speed[-1].any()
    way = np.column_stack([plan.joints, plan.commands])
    fine = np.concatenate([way[:-1] + share * np.diff(way, axis=0) for share in np.linspace(0, 1, 8, endpoint=False)])
    assert np.abs(fine - rows[-1]).max(axis=1).min() < 1e-3


@pytest.mark.parametrize("after", [0.1, 0.25, 0.4, 0.6, 0.8])
def test_what_waits_and_goes_on_keeps_the_limits_too(after):
    plan = planned(np.array([1.0, 0.8, 0.5, 0.8, 0.3, 0.6, 1.0, -0.05, 0.0, 0.0]))
    smoother, rows = Smoother(START, 10), []
    robot = TimeScaledRobot(READY, START[7:], PLANNED, "package", lambda q, c, _: rows.append(np.append(q, c)), PANDA)
    assert robot.start(plan, plan.digest()) == ""
    while robot.state().mode == "running":
        robot.advance(TICK)
        robot.waits = after <= len(rows) * TICK < after + 0.6
    rows = np.array([smoother.next(row) for row in rows + [rows[-1]] * 30])
    gain = np.diff(rows[:, :7], n=2, axis=0) / TICK**2
    assert (np.abs(gain) / ACCELERATION).max() < 1.01
    assert (np.abs(np.diff(gain, axis=0) / TICK) / JERK).max() < 1.0
    np.testing.assert_allclose(rows[-1], np.append(plan.joints[-1], plan.commands[-1]), atol=1e-12)


def test_a_slow_plan_is_stopped_within_the_brake():
    rows = stopped(planned(np.append(np.full(7, 0.01), [-0.01, 0, 0])), 0.05)
    moving = np.flatnonzero(np.abs(np.diff(rows, axis=0)).max(axis=1) > 1e-12)[-1] + 1
    assert moving * TICK - 0.05 < BRAKE + 0.025


def test_without_a_stop_the_plan_is_run_to_its_end():
    plan = planned(np.append(np.full(7, 0.2), [-0.02, 0, 0]))
    rows = stopped(plan, 100.0)
    np.testing.assert_allclose(rows[-1], np.append(plan.joints[-1], plan.commands[-1]), atol=1e-12)


def following(axes, seconds, ends=np.inf):
    """Rows sent as it follows `axes`, a function of time, which is heard every KNOT s; stopped after `ends` s."""
    smoother, rows = Smoother(START, 10), []
    robot = TimeScaledRobot(READY, START[7:], PLANNED, "package", lambda q, c, _: rows.append(np.append(q, c)), FR3)
    assert robot.follow(Following(DELAY, 0.0, OFFSET), TICK) == ""
    for tick in range(round(seconds / TICK)):
        now = tick * TICK
        if tick % round(KNOT / TICK) == 0:
            robot.hear(0.0, axes(now))
        if now >= ends:
            robot.stop()
        robot.advance(TICK)
    return robot, np.array([smoother.next(row) for row in rows])


def swaying(now):
    return START + 0.15 * np.append(np.sin(now) * np.ones(7), np.zeros(3))


@pytest.mark.parametrize("ends", [np.inf, 0.3, 1.5, 2.0])
def test_as_it_follows_and_brakes_it_keeps_the_limits(ends):
    robot, rows = following(swaying, 3.0, ends)
    speed = np.diff(rows[:, :7], axis=0) / TICK
    gain = np.diff(speed, axis=0) / TICK
    assert (np.abs(speed) / FR3.velocity).max() < 1.0
    assert (np.abs(gain) / FR3.acceleration).max() < 1.0
    assert (np.abs(np.diff(gain, axis=0) / TICK) / FR3.jerk).max() < 1.0
    if ends < 3.0:
        assert robot.state().mode == "idle"
        assert not speed[-1].any()
    else:
        assert robot.state().mode == "running"
        np.testing.assert_allclose(rows[-1], swaying(3.0 - DELAY - 0.02), atol=5e-3)


def test_it_stays_at_the_last_targets_that_its_range_has():
    """An FR3's joint 6 reaches less far in than a Panda's."""
    beyond = START + (0.4 - START[5]) * np.eye(10)[5]
    _, rows = following(lambda now: swaying(0.5) if now < 0.5 else beyond, 3.0)
    np.testing.assert_allclose(rows[-1], swaying(0.5), atol=1e-4)


def test_a_smoothed_step_becomes_a_way_of_continuous_acceleration():
    smoother = Smoother(np.zeros(1), 10)
    values = np.array([smoother.next(np.array([max(0.0, n * TICK)]))[0] for n in range(-5, 60)])
    gain = np.diff(values, 2) / TICK**2
    assert np.abs(np.diff(gain)).max() / TICK <= 1 / (10 * TICK) ** 2 * 1.01  # jerk of a speed that jumps by 1
    np.testing.assert_allclose(values[-1], (59 - 9) * TICK)
