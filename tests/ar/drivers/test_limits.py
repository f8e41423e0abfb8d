"""What the Panda is sent keeps each of its limits by itself: the speed, the acceleration, the jerk and the range of
every joint, either way, though it keeps all others."""

import re

import numpy as np
import pytest

from trunkline.ar.drivers.driver_frames import Setpoint
from trunkline.ar.drivers.setpoint_filter import LIMITS, NEAR, ROUNDING, SetpointFilter
from trunkline.ar.drivers.time_scaling import TimeScaledRobot
from trunkline.ar.drivers.watchdog import SETPOINT_TIMEOUT
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import MotionLimits
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN
from trunkline.kinematics.panda.limits import ACCELERATION, JERK, VELOCITY

READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
DT, LEAD = 0.001, 0.03
JOINTS = range(7)
SMALL = 0.004  # share of a limit, to either side


def played(places: np.ndarray, robot: str) -> tuple[SetpointFilter, np.ndarray]:
    """A stream that is sent `places` (T, 7), every ms, and what it sends, (T, 7)."""
    stream, sent = SetpointFilter(places[0], LIMITS[robot]), []
    ahead = round(LEAD / DT)
    for step in range(len(places) + ahead):
        now = step * DT
        for number in [step] if step else range(-5, 1):
            stream.hear(Setpoint((number + ahead) * DT, tuple(places[np.clip(number, 0, len(places) - 1)])), now)
        sent.append(stream.cycle(now, DT))
    return stream, np.array(sent)


def way(gains: np.ndarray, joint: int, sign: int, start: np.ndarray = READY) -> np.ndarray:
    """Places of a joint that has these accelerations, rad/s², from rest on, and then keeps its speed for a while."""
    gains = np.concatenate([np.zeros(5), gains, np.zeros(20)])
    return start + sign * np.outer(DT * np.cumsum(DT * np.cumsum(gains)), np.eye(7)[joint])


def ramp(top: float, steps: int) -> np.ndarray:
    return top * np.arange(1, steps + 1) / steps


def too_fast(limits, joint, share):
    """A speed of `share` of the limit, by accelerations and jerks of 0.6 of theirs."""
    gain, speed = 0.6 * limits.acceleration[joint], share * ROUNDING * limits.velocity[joint]
    steps = int(np.ceil(gain / (0.6 * limits.jerk[joint] * DT)))
    flat = int(np.ceil(speed / (gain * DT))) - steps - 1
    up = ramp(speed / (DT * (steps + 1 + flat)), steps)
    return np.concatenate([up, np.full(flat, up[-1]), up[::-1]])


def too_hasty(limits, joint, share):
    """An acceleration of `share` of the limit, by jerks of 0.6 of theirs, and back again."""
    gain = share * ROUNDING * limits.acceleration[joint]
    up = ramp(gain, int(np.ceil(gain / (0.6 * limits.jerk[joint] * DT))))
    return np.concatenate([up, up[::-1]])


def too_sudden(limits, joint, share):
    """A jerk of `share` of the limit, once, to half of the acceleration's."""
    gain = share * ROUNDING * limits.jerk[joint] * DT
    return np.concatenate([np.full(5, gain), ramp(gain, 4)[::-1]])


KINDS = {
    "velocity": (too_fast, "rad/s"), "acceleration": (too_hasty, "rad/s²"), "jerk": (too_sudden, "rad/s³"),
}  # fmt: skip


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_no_joint_goes_beyond_a_limit_though_it_keeps_all_others(robot, kind, joint, sign):
    limits, (made, unit) = LIMITS[robot], KINDS[kind]
    stream, _ = played(way(made(limits, joint, 1 - SMALL), joint, sign), robot)
    assert not stream.fault.startswith("setpoint:")
    stream, sent = played(way(made(limits, joint, 1 + SMALL), joint, sign), robot)
    most = getattr(limits, kind)[joint]
    pattern = rf"setpoint: joint {joint + 1} asks for [\d.e+]+ {unit}, expected at most {re.escape(f'{most:.3g}')}"
    assert re.fullmatch(pattern, stream.fault)
    for order, name in enumerate(KINDS, 1):
        rates = np.abs(np.diff(sent, order, axis=0)).max(axis=0) / DT**order
        assert (rates < 1.03 * getattr(limits, name)).all()  # braking begins with what it has


@pytest.mark.parametrize("side", ["low", "high"])
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_no_joint_leaves_its_range_on_either_side(robot, joint, side):
    limits, sign = LIMITS[robot], -1 if side == "low" else 1
    border = getattr(limits, side)[joint]
    start = np.where(np.arange(7) == joint, border - sign * 0.01, READY)
    for beyond in (-1e-6, 1e-6):
        share = np.linspace(0, 1, 300)
        going = start + sign * (0.01 + beyond) * np.outer(share**3 * (10 - 15 * share + 6 * share**2), np.eye(7)[joint])
        stream, sent = played(np.concatenate([going, np.tile(going[-1], (30, 1))]), robot)
        left = stream.fault.startswith(
            f"setpoint: joint {joint + 1} leaves its range at {border + sign * beyond:.3f} rad"
        )
        assert left == (beyond > 0)
        assert sign * (sent[:, joint] - border).max(initial=0) <= 1e-6


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("joint", JOINTS)
def test_no_joint_starts_elsewhere_than_it_is(joint, sign):
    for off, refused in ((NEAR - 1e-6, False), (NEAR + 1e-6, True)):
        stream = SetpointFilter(READY, LIMITS["panda"])
        stream.hear(Setpoint(LEAD, tuple(READY + sign * off * np.eye(7)[joint])), 0.0)
        assert stream.fault.startswith("setpoint: starts 0.002 rad from where the robot is") == refused


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("place", range(8))
def test_a_setpoint_that_is_no_number_is_refused(place, value):
    stream, numbers = SetpointFilter(READY, LIMITS["panda"]), [LEAD, *READY]
    numbers[place] = value
    stream.hear(Setpoint(numbers[0], tuple(numbers[1:])), 0.0)
    assert stream.fault == "setpoint: found values that are not finite"


@pytest.mark.parametrize(("silent", "braked"), [(SETPOINT_TIMEOUT - 1e-6, False), (SETPOINT_TIMEOUT + 1e-6, True)])
def test_setpoints_that_do_not_come_are_missed_after_so_long(silent, braked):
    """Though those that are there reach further."""
    stream = SetpointFilter(READY, LIMITS["panda"])
    for number in range(200):
        stream.hear(Setpoint(LEAD + number * DT, tuple(READY)), 0.0)
    stream.cycle(silent, DT)
    assert stream.fault == ("heard no setpoint for 50 ms, expected one every 1 ms" if braked else "")


def test_an_fr3_keeps_the_lower_of_its_own_limits_and_a_pandas():
    """Plans are made for a Panda."""
    panda, fr3 = LIMITS["panda"], LIMITS["fr3"]
    for name, made in (("low", Q_MIN), ("high", Q_MAX), ("velocity", VELOCITY), ("acceleration", ACCELERATION),
                       ("jerk", JERK)):  # fmt: skip
        np.testing.assert_array_equal(getattr(panda, name), made)
    assert (fr3.low >= panda.low).all()
    assert (fr3.high <= panda.high).all()
    for name in ("velocity", "acceleration", "jerk"):
        assert (getattr(fr3, name) <= getattr(panda, name)).all()
        assert (getattr(fr3, name) > 0).all()
    assert ((fr3.low < READY) & (fr3.high > READY)).all()


@pytest.mark.parametrize("side", ["low", "high"])
@pytest.mark.parametrize("joint", JOINTS)
def test_a_plan_that_leaves_the_robots_own_range_is_refused_and_its_targets_are_not_followed(joint, side):
    limits = LIMITS["fr3"]
    border, sign = getattr(limits, side)[joint], -1 if side == "low" else 1
    start = np.where(np.arange(7) == joint, border - sign * 1e-4, READY)
    generous = MotionLimits(*(np.full(10, 1e3) for _ in range(3)))
    for beyond in (-1e-6, 1e-6):
        there = start.copy()
        there[joint] = border + sign * beyond
        plan = Plan(0.01, np.array([start, there, start]), np.full((3, 3), 0.5), (("approach", 0),), "p", "w")
        robot = TimeScaledRobot(start, np.full(3, 0.5), generous, "p", lambda q, c, _: None, limits)
        reason = robot.check(plan)
        expected = f"plan: joint {joint + 1} leaves this robot's range at {there[joint]:.3f} rad"
        assert reason == (expected if beyond > 0 else "")
        robot.follow(Following(0.0, 0.0, 0.05), DT)
        robot.hear(0.0, np.append(there, np.full(3, 0.5)))
        assert robot._follower.goal[joint] == (start if beyond > 0 else there)[joint]
