"""Plans: their ways keep every limit, lead where the targets are, are refused by name, and are what their digest
says."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.operator import READY_JOINTS, config
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.messages import Obstacle, Request, Target, Targets, World
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.shaping import mode_shaper
from trunkline.ar.teleop.tendons import Network, bend
from trunkline.ar.teleop.trajectory import limits_of, point_to_point
from trunkline.ar.teleop.vectors import DOWN
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, mount_pose
from trunkline.kinematics.panda.limits import VELOCITY

OFFSET, PACKAGE, WORLD = 0.05, "a" * 64, World("world")
STRAIGHT, LENGTH, RADIUS = np.full(3, 0.5), 0.5, 0.034
LIMITS = limits_of(config().motors)
START = np.array(READY_JOINTS)


def arc(bend_angle: np.ndarray) -> np.ndarray:
    """Tip of an arm of constant curvature that bends by so much, rad, from straight down towards +x. Shape (..., 3)."""
    b = np.where(np.abs(bend_angle) < 1e-9, 1e-9, bend_angle)
    return np.stack([LENGTH * (1 - np.cos(b)) / b, 0 * b, -LENGTH * np.sin(b) / b], axis=-1)


def ask(poses: np.ndarray) -> dict[str, np.ndarray]:
    """A network of that arm: it takes the bend from the orientation asked for, and knows where the tip comes."""
    angle = -2 * np.arctan2(poses[:, 6], poses[:, 4])  # about -y the tip turns towards +x
    pulls = np.outer(RADIUS * angle, np.cos(2 * np.pi / 3 * np.arange(3)))
    return {"commands": STRAIGHT - pulls, "lengths": STRAIGHT - pulls, "tip": arc(angle)}


NETWORK = Network(ask, 8)


def targets(rigid, tip, heading=0.0) -> Targets:
    return Targets(Target(rigid), Target(tip), DOWN, heading, 0, 0.0)


def request(rigid, tip, heading=0.0) -> Request:
    return Request(1, targets(rigid, tip, heading), WORLD.digest, PACKAGE)


@pytest.fixture(scope="module")
def planner():
    return Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET, step=0.005)


MOUNT = (0.5, 0.1, 0.5)
BENT = arc(np.array(1.2))
TIP = tuple(float(m + b) for m, b in zip(MOUNT, BENT, strict=True))


def test_limits_are_the_makers_and_the_motors():
    share = config().motors.share
    np.testing.assert_allclose(LIMITS.velocity[:7], share * VELOCITY)
    assert limits_of(config().motors, rate_limit=0.1).velocity[7] == 0.1
    assert limits_of(config().motors, rate_limit=9.0).velocity[7] == config().motors.velocity


def test_a_way_keeps_velocity_acceleration_and_jerk_and_all_axes_arrive_together():
    rng = np.random.default_rng(0)
    for _ in range(5):
        start = np.append(rng.uniform(Q_MIN, Q_MAX), rng.uniform(0.4, 0.6, 3))
        end = np.append(rng.uniform(Q_MIN, Q_MAX), rng.uniform(0.4, 0.6, 3))
        step = 1e-3
        way = point_to_point(start, end, LIMITS, step)
        np.testing.assert_allclose(way[[0, -1]], [start, end], atol=1e-9)
        for order, most in enumerate((LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk), 1):
            # rounding of positions of about 1 grows by 1 / step with every difference
            largest = np.abs(np.diff(way[:-1], order, axis=0)).max(axis=0) / step**order
            assert (largest <= most * (1 + 1e-6) + 8e-16 * 4**order / step**order).all(), order
        late = np.abs(way[round(0.9 * len(way))] - end) > 1e-6
        assert late.all()  # none is there long before the others


def test_plan_leads_the_mount_and_the_tip_to_their_targets(planner):
    plan = planner.plan(request(MOUNT, TIP), WORLD, START, STRAIGHT)
    assert [name for name, _ in plan.phases] == ["approach", "curl"]
    np.testing.assert_allclose(plan.joints[0], START)
    position, rotation = mount_pose(plan.joints[-1:], OFFSET)
    np.testing.assert_allclose(rotation[0, :, 2], DOWN, atol=2e-3)
    angle = (STRAIGHT[0] - plan.commands[-1, 0]) / RADIUS
    turn = rotation[0] @ np.diag([1.0, -1.0, -1.0])  # the arm hangs from the flange by half a turn about x
    np.testing.assert_allclose(position[0] + turn @ arc(angle), TIP, atol=5e-4)
    assert np.linalg.norm(position[0] - MOUNT) < 0.02


def test_the_arm_is_straight_until_the_rigid_robot_has_arrived(planner):
    plan = planner.plan(request(MOUNT, TIP), WORLD, START, STRAIGHT)
    curl = dict(plan.phases)["curl"]
    np.testing.assert_allclose(plan.commands[: curl + 1], np.tile(STRAIGHT, (curl + 1, 1)), atol=1e-9)
    np.testing.assert_allclose(plan.joints[curl:], np.tile(plan.joints[-1], (len(plan.joints) - curl, 1)), atol=1e-9)


def test_shaping_makes_a_plan_longer_and_leads_to_the_same(planner):
    plain = planner.plan(request(MOUNT, TIP), WORLD, START, STRAIGHT)
    shaper = mode_shaper(0.6, 0.03, "zvd")
    plan = replace(planner, shaper=lambda *_: shaper).plan(request(MOUNT, TIP), WORLD, START, STRAIGHT)
    assert plan.duration - plain.duration == pytest.approx(2 * shaper.delay, abs=0.02)
    np.testing.assert_allclose(plan.joints[-1], plain.joints[-1], atol=1e-9)
    np.testing.assert_allclose(plan.commands[-1], plain.commands[-1], atol=1e-9)


REFUSED = {
    "out of reach: the rigid robot comes no nearer": request((1.5, 0.0, 0.5), (1.5 + BENT[0], 0.0, 0.5 + BENT[2])),
    "out of reach: the soft arm's tip comes no nearer": request(MOUNT, (0.5, 0.1, -0.5)),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_is_out_of_reach_is_refused_by_name(planner, reason):
    with pytest.raises(InputError, match=f"(limit: joint|{reason})"):
        planner.plan(REFUSED[reason], WORLD, START, STRAIGHT)


def test_a_pose_in_which_the_robot_touches_itself_is_refused(planner):
    near = (0.12, 0.0, 0.25)
    tip = tuple(float(m + b) for m, b in zip(near, BENT, strict=True))
    with pytest.raises(InputError, match="self-collision|limit: joint"):
        planner.plan(request(near, tip), WORLD, START, STRAIGHT)


def test_a_solid_in_the_way_is_named(planner):
    wall = World("world", (Obstacle("the shelf", (0.2, 0.15, 0.2), (0.9, 0.2, 0.9)),))
    behind = request((0.4, 0.35, 0.5), (0.4 + float(BENT[0]), 0.35, 0.5 + float(BENT[2])))
    planner.plan(behind, WORLD, START, STRAIGHT)
    with pytest.raises(InputError, match="world: (joint .|mount) of the rigid robot would come into the shelf after"):
        planner.plan(behind, wall, START, STRAIGHT)


def test_a_network_of_one_tilt_refuses_gravity_from_a_side_that_it_does_not_know():
    with pytest.raises(InputError, match="gravity: comes 30° beside a tendon's plane"):
        bend(NETWORK, tuple(BENT), (0.5 * np.cos(np.pi / 6), 0.5 * np.sin(np.pi / 6), -(0.75**0.5)), 0.02)


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_another_tendon_does_what_the_first_does_where_it_stands(turns):
    third = turns * 2 * np.pi / 3
    turn = np.array([[np.cos(third), -np.sin(third), 0], [np.sin(third), np.cos(third), 0], [0, 0, 1]])
    gravity = np.array([np.sin(0.5), 0.0, -np.cos(0.5)])
    here = bend(NETWORK, tuple(BENT), tuple(gravity), 0.02)
    there = bend(NETWORK, tuple(turn @ BENT), tuple(turn @ gravity), 0.02)
    np.testing.assert_allclose(there.tip, turn @ here.tip, atol=1e-9)
    np.testing.assert_allclose(np.roll(there.commands, -turns), here.commands, atol=1e-9)
    assert there.commands.argmin() == turns % 3  # tendon 1 over +x, tendon 2 a third of a turn on


def test_digest_tells_every_bit(planner):
    plan = planner.plan(request(MOUNT, TIP), WORLD, START, STRAIGHT)
    joints = plan.joints.copy()
    joints[7, 3] = np.nextafter(joints[7, 3], 9)
    others = [
        replace(plan, joints=joints),
        replace(plan, step=plan.step * 2),
        replace(plan, package="b" * 64),
        replace(plan, world="x"),
        replace(plan, phases=plan.phases[:1]),
        replace(plan, joints=plan.commands, commands=plan.joints),
    ]
    assert len({plan.digest(), *(other.digest() for other in others)}) == 7
    assert replace(plan, joints=plan.joints.copy()).digest() == plan.digest()


def test_robot_moves_a_model_that_it_is_given(planner):
    plan = planner.plan(request(MOUNT, TIP), WORLD, START, STRAIGHT)
    heard = []
    move = lambda joints, commands, dt: heard.append((joints.copy(), dt))  # noqa: E731
    simulated = PlanFollower(START, STRAIGHT, LIMITS, PACKAGE, move)
    simulated.start(plan, plan.digest())
    simulated.advance(0.01)
    np.testing.assert_allclose(heard[0][0], plan.at(0.01)[0])
    assert heard[0][1] == 0.01
