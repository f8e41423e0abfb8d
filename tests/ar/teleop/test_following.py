"""Following: the robot comes to where the targets were a set delay before, keeps its limits on the way, and rests when
they stop or are refused."""

import re

import numpy as np
import pytest

from tests.ar.teleop.test_plan import BENT, LIMITS, NETWORK, OFFSET, START, STRAIGHT, WORLD, targets
from trunkline.ar.teleop.following import KNOT, Follower, Following, sought
from trunkline.ar.teleop.messages import Obstacle, World
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.kinematics import mount_pose

DT, DELAY, PERIOD = 1 / 60, 0.5, 0.6
PLANNER = Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET)


def at(y: float):
    mount = (0.5, y, 0.5)
    return targets(mount, tuple(float(m + b) for m, b in zip(mount, BENT, strict=True)))


def follow(y, seconds: float, delay: float = DELAY, period: float = PERIOD) -> tuple[np.ndarray, Follower]:
    """Rows of all axes while the targets are at `y`, a function of time, s."""
    follower, rows = Follower(LIMITS, Following(delay, period, OFFSET), START, STRAIGHT, DT), []
    for index in range(round(seconds / DT)):
        assert hear(follower, index * DT, at(y(index * DT))) == ""
        rows.append(np.concatenate(follower.tick(index * DT)))
    return np.array(rows), follower


def hear(follower: Follower, now: float, wanted, world: World = WORLD) -> str:
    """Why the targets at `now` are not followed."""
    if follower._times and now < follower._times[-1] + KNOT - 1e-6:
        return ""
    goal, refused = sought(PLANNER, wanted, follower.goal[:7], world)
    follower.hear(now, goal)
    return refused


def mount(rows: np.ndarray) -> np.ndarray:
    return mount_pose(rows[:, :7], OFFSET)[0][:, 1]


def ramp(now: float) -> float:
    """1.5 s of rest, 2 s sideways at 0.1 m/s, rest."""
    return 0.1 * min(max(now - 1.5, 0.0), 2.0)


@pytest.fixture(scope="module")
def followed():
    return follow(ramp, 5.5)[0]


def test_it_comes_to_where_the_targets_end(followed):
    assert mount(followed[-1:])[0] == pytest.approx(0.2, abs=0.01)
    np.testing.assert_allclose(followed[-1], followed[-10], atol=1e-6)


def test_it_keeps_its_limits(followed):
    for order, most in enumerate((LIMITS.velocity, LIMITS.acceleration), 1):
        largest = np.abs(np.diff(followed, order, axis=0)).max(axis=0) / DT**order
        assert (largest <= 1.001 * most).all()


def test_it_is_where_the_targets_were_the_delay_before(followed):
    """In the ramp's middle, but for the mean at its ends and the arm that only bends; no lag is added to the delay."""
    now = np.arange(len(followed)) * DT
    inside = (now > 2.0 + PERIOD) & (now < 4.0 - PERIOD)
    missed = mount(followed)[inside] - np.array([ramp(t - DELAY) for t in now[inside] + DT])
    np.testing.assert_allclose(missed, missed.mean(), atol=1e-3)
    assert abs(missed.mean() - (mount(followed)[-1] - 0.2)) < 1e-3


def test_a_tremble_at_the_swings_period_is_not_followed():
    rows, _ = follow(lambda now: 0.02 * np.sin(2 * np.pi * now / PERIOD), 4.0)
    plain, _ = follow(lambda now: 0.02 * np.sin(2 * np.pi * now / PERIOD), 4.0, period=0.0)
    assert np.ptp(mount(plain)[-60:]) > 0.03
    assert np.ptp(mount(rows)[-60:]) < 0.05 * np.ptp(mount(plain)[-60:])


@pytest.mark.parametrize("delay", [0.0, KNOT, 0.2])
def test_a_short_delay_leaves_less_to_look_ahead_but_follows(delay):
    rows, _ = follow(ramp, 5.0, delay=delay)
    now = round(3.0 / DT)
    assert abs(mount(rows)[now] - ramp(3.0 - delay)) < 0.03
    assert mount(rows)[-1] == pytest.approx(0.2, abs=0.01)


def test_refused_targets_leave_it_at_the_last_and_are_said():
    _, follower = follow(lambda now: 0.0, 2.0)
    for index in range(120):
        now = 2.0 + index * DT
        refused = hear(follower, now, at(3.0))
        rows = np.concatenate(follower.tick(now))
        if index == 0:
            last = rows
            assert refused.startswith(("out of reach", "limit"))
    np.testing.assert_allclose(rows, last, atol=1e-4)
    assert hear(follower, 5.0, at(0.05)) == ""


def test_targets_that_lead_into_a_solid_are_refused():
    shelf = World("world", (Obstacle("the shelf", (0.4, 0.2, 0.4), (0.6, 0.4, 0.6)),))
    _, follower = follow(lambda now: 0.0, 0.5)
    assert hear(follower, 1.0, at(0.05), shelf) == ""
    refused = hear(follower, 2.0, at(0.3), shelf)
    assert re.fullmatch("world: joint . of the rigid robot would come into the shelf", refused)


def test_it_brakes_within_its_limits_wherever_the_targets_are(followed):
    rows, follower = follow(lambda now: 0.2 * min(now, 2.0), 1.5)
    before = rows[-3:]
    follower.brake()
    for index in range(60):
        rows = np.vstack([rows, np.concatenate(follower.tick(1.5 + index * DT))])
        if follower.rests:
            break
    assert follower.rests
    moving = np.vstack([before, rows[-index - 1 :]])
    assert (np.abs(np.diff(moving, 2, axis=0)).max(axis=0) / DT**2 <= 1.001 * LIMITS.acceleration).all()
    assert 2 < index < 30


def test_it_rests_within_its_limits_before_it_would_touch_itself():
    """Between two poses that are clear, with the mount beside the second link on the way."""
    here = np.array([0.0, 0.808, 0.498, -2.374, -1.223, 1.167, 0.785])
    there = np.array([0.0, 1.254, 0.777, -2.825, -0.64, 2.191, 0.785])
    assert clearance(np.stack([here, there]), OFFSET).min() > 0.02
    follower, rows = Follower(LIMITS, Following(0.0, 0.0, OFFSET), here, STRAIGHT, DT), [np.append(here, STRAIGHT)] * 3
    follower.hear(0.0, np.append(there, STRAIGHT))
    while not follower.rests:
        rows.append(np.concatenate(follower.tick(len(rows) * DT)))
        assert len(rows) < 300
    assert follower.refused == "self-collision: the robot would touch itself as it follows"
    assert 0 < clearance(np.array(rows)[:, :7], OFFSET).min() < 0.01
    assert (np.abs(np.diff(rows, 2, axis=0)).max(axis=0) / DT**2 <= 1.001 * LIMITS.acceleration).all()
