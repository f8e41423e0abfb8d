"""How a planner joins legs: each by its own profile, shaped where it says so, at rest as long as it asks, under its
phase. The legs are made here, as no way of grasping has all kinds of them."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from tests.support.operator import READY_JOINTS, config
from trunkline.ar.teleop.grasping import Leg
from trunkline.ar.teleop.messages import Request, Target, Targets, World, WorldObject
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.shaping import mode_shaper, shaped
from trunkline.ar.teleop.tendons import Network
from trunkline.ar.teleop.trajectory import gentle, limits_of, point_to_point
from trunkline.ar.teleop.vectors import DOWN

STEP, START, STRAIGHT = 0.005, np.array(READY_JOINTS), np.full(3, 0.5)
LIMITS, SHAPER = limits_of(config().motors), mode_shaper(0.6, 0.03, "zvd")
GRAVITY, OTHER = np.array([0.0, 0.0, -1.0]), np.array([0.6, 0.0, -0.8])
THERE, PULLED, MORE = START + 0.05, np.array([0.48, 0.5, 0.51]), np.array([0.47, 0.5, 0.53])
CUP = World("world", objects=(WorldObject("cup", "cylinder", 0.08, 0.1, 0.05, (0.5, 0.0, 0.25)),))


@dataclass
class Made:
    """Takes the place of a way of grasping."""

    legs: list[Leg]
    beside: list[float] = field(default_factory=list)

    def grasp(self, targets, object, joints, beside):
        self.beside.append(beside)
        return self.legs


@pytest.fixture
def plan():
    def plan(*legs, shaper=None, **more):
        nothing = Network(lambda poses: {}, 8)
        planner = Planner(RigidIK(0.05), nothing, STRAIGHT, LIMITS, 0.05, step=STEP, shaper=shaper)
        planner = replace(planner, grasping=Made(list(legs)))
        targets = Targets(Target((0.5, 0.0, 0.6)), Target((0.5, 0.0, 0.25)), DOWN, 0.0, 0, 0.0, object="cup")
        made = planner.plan(Request(1, targets, CUP.digest, "a" * 64), CUP, START, STRAIGHT, **more)
        return made, planner.grasping

    return plan


def rows(plan) -> np.ndarray:
    return np.hstack([plan.joints, plan.commands])


def axes(joints, commands) -> np.ndarray:
    return np.append(joints, commands)


def test_a_leg_has_its_own_profile(plan):
    made, _ = plan(Leg("a", THERE, STRAIGHT), Leg("b", THERE, PULLED, gentle=True, seconds=0.7))
    first = point_to_point(axes(START, STRAIGHT), axes(THERE, STRAIGHT), LIMITS, STEP)
    then = gentle(axes(THERE, STRAIGHT), axes(THERE, PULLED), LIMITS, STEP, 0.7)
    np.testing.assert_allclose(rows(made), np.concatenate([first, then[1:]]), atol=1e-12)
    made, _ = plan(Leg("a", THERE, STRAIGHT, seconds=2.0))
    assert made.duration == pytest.approx(2.0, abs=2 * STEP)


def test_a_leg_rests_at_its_end_as_long_as_it_asks(plan):
    without, _ = plan(Leg("a", THERE, STRAIGHT))
    calm, _ = plan(Leg("a", THERE, STRAIGHT, calm=0.25))
    assert len(calm.joints) - len(without.joints) == 50
    rest = np.tile(axes(THERE, STRAIGHT), (51, 1))
    np.testing.assert_allclose(rows(calm)[len(without.joints) - 1 :], rest, atol=1e-12)


def test_legs_of_the_same_phase_are_of_it_together(plan):
    made, _ = plan(Leg("a", THERE, STRAIGHT), Leg("b", THERE, PULLED), Leg("b", THERE, MORE), Leg("a", START, MORE))
    assert [name for name, _ in made.phases] == ["a", "b", "a"]
    (_, begin), (_, second), (_, last) = made.phases
    assert begin == 0
    np.testing.assert_allclose(rows(made)[second], axes(THERE, STRAIGHT))
    np.testing.assert_allclose(rows(made)[last], axes(THERE, MORE))


def test_legs_with_a_gravity_are_shaped_by_what_swings_the_arm(plan):
    asked = []

    def shaper(gravity, commands, change):
        asked.append((gravity, commands, change))
        return SHAPER

    still = np.zeros(3)
    legs = [Leg("a", THERE, STRAIGHT), Leg("b", THERE, PULLED, GRAVITY), Leg("c", START, MORE, OTHER, change=still)]
    made, _ = plan(*legs, shaper=shaper)
    expected = [(GRAVITY, PULLED, PULLED - STRAIGHT), (OTHER, MORE, still)]
    for arguments, right in zip(asked, expected, strict=True):
        for value, wanted in zip(arguments, right, strict=True):
            np.testing.assert_allclose(value, wanted, atol=1e-12)
    plain = point_to_point(axes(START, STRAIGHT), axes(THERE, STRAIGHT), LIMITS, STEP)
    curl = shaped(point_to_point(axes(THERE, STRAIGHT), axes(THERE, PULLED), LIMITS, STEP), STEP, SHAPER)
    np.testing.assert_allclose(rows(made)[: len(plain) + len(curl) - 1], np.concatenate([plain, curl[1:]]), atol=1e-12)


def test_where_the_tip_is_seen_beside_the_plane_goes_to_the_grasp_and_is_nothing_by_itself(plan):
    _, grasping = plan(Leg("a", THERE, STRAIGHT))
    assert grasping.beside == [0.0]
    _, grasping = plan(Leg("a", THERE, STRAIGHT), beside=0.004)
    assert grasping.beside == [0.004]
