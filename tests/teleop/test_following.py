"""Following: the robot comes to where the targets are, keeps its limits on the way, and rests when they stop or are
refused."""

import numpy as np
import pytest

from tests.teleop.test_plan import BENT, LIMITS, NETWORK, OFFSET, START, STRAIGHT, targets
from trunkline.panda.kinematics import mount_pose
from trunkline.teleop.following import Follower
from trunkline.teleop.planner import Planner
from trunkline.teleop.rigid_ik import RigidIK

DT = 1 / 60
PLANNER = Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET)


def at(y: float):
    mount = (0.5, y, 0.5)
    return targets(mount, tuple(float(m + b) for m, b in zip(mount, BENT, strict=True)))


@pytest.fixture(scope="module")
def followed():
    """1 s to the start, 2 s sideways at 0.1 m/s, 1.5 s of rest: rows of all axes."""
    follower, rows = Follower(PLANNER, START, STRAIGHT, DT), []
    for index in range(round(4.5 / DT)):
        y = 0.1 * min(max(index * DT - 1.0, 0.0), 2.0)
        rows.append(np.concatenate(follower.tick(at(y))))
        assert follower.refused == ""
    return np.array(rows)


def test_it_comes_to_where_the_targets_end(followed):
    position, _ = mount_pose(followed[-1:, :7], OFFSET)
    np.testing.assert_allclose(position[0], (0.5, 0.2, 0.5), atol=0.01)
    np.testing.assert_allclose(followed[-1], followed[-10], atol=1e-6)


def test_it_keeps_its_limits(followed):
    for order, most in enumerate((LIMITS.velocity, LIMITS.acceleration), 1):
        found = np.abs(np.diff(followed, order, axis=0)).max(axis=0) / DT**order
        assert (found <= 1.001 * most).all()


def test_it_trails_by_less_than_a_hand_moves_in_half_a_second(followed):
    position, _ = mount_pose(followed[:, :7], OFFSET)
    index = round(2.5 / DT)
    assert abs(position[index, 1] - 0.15) < 0.05


def test_refused_targets_leave_it_at_the_last_and_are_said():
    follower = Follower(PLANNER, START, STRAIGHT, DT)
    for _ in range(120):
        kept = np.concatenate(follower.tick(at(0.0)))
    for _ in range(60):
        now = np.concatenate(follower.tick(at(3.0)))
    assert follower.refused.startswith(("out of reach", "limit"))
    np.testing.assert_allclose(now, kept, atol=1e-6)
    follower.tick(at(0.05))
    assert follower.refused == ""
