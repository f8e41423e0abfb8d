"""Targets: what forbids to ask for a plan, which object they mark, what they stand in, how far they tilt."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.support.operator import config
from trunkline.ar.teleop.messages import Obstacle, Offer, Target, Targets, World, WorldObject
from trunkline.ar.teleop.reach_message import Reading
from trunkline.ar.teleop.settings import Orientation
from trunkline.ar.teleop.targets import _target, marked, offered, tilted, why_not
from trunkline.ar.teleop.vectors import DOWN

NEAR = 1e-6
INSIDE = Target((0.5, 0.0, 0.5), "inside")
OUTSIDE, OFFERED = replace(INSIDE, reach="outside", outside_by=0.0321), (0.4, 0.0, 0.5)
BLOCKED, UNKNOWN = replace(INSIDE, reach="blocked", obstacle="the table"), replace(INSIDE, reach="unknown")
TAKES = "; primary button takes the nearest point that is within"


def targets(rigid=INSIDE, tip=INSIDE, turned=0.0):
    return Targets(rigid, tip, DOWN, 0.0, 0, turned)


@pytest.mark.parametrize(
    ("targets", "reason"),
    [
        (None, "both targets are needed: hold a grip to set each"),
        (targets(), ""),
        (targets(UNKNOWN, UNKNOWN), ""),
        (targets(rigid=OUTSIDE), "rigid target is 32 mm out of reach"),
        (targets(tip=OUTSIDE), "tip target is 32 mm out of reach"),
        (targets(tip=replace(OUTSIDE, offer=OFFERED)), "tip target is 32 mm out of reach" + TAKES),
        (targets(rigid=BLOCKED), "rigid target is inside the table"),
        (targets(tip=BLOCKED), "tip target is inside the table"),
        (targets(turned=None), "wrist cannot turn the arm's bending plane to the tip target"),
        (targets(OUTSIDE, BLOCKED, None), "rigid target is 32 mm out of reach"),
        (targets(INSIDE, BLOCKED, None), "tip target is inside the table"),
    ],
)
def test_why_no_plan_can_be_asked_for(targets, reason):
    assert why_not(targets) == reason


def cup(name, x):
    return WorldObject(name, "cylinder", 0.05, 0.1, 0.1, (x, 0.0, 0.0))


WITHIN = config().core.mark


@pytest.mark.parametrize(
    ("objects", "name"),
    [
        ((), None),
        ((cup("a", WITHIN - NEAR),), "a"),
        ((cup("a", WITHIN + NEAR),), None),
        ((cup("a", -WITHIN + NEAR),), "a"),
        ((cup("a", 0.05), cup("b", 0.02)), "b"),
        ((cup("a", 0.02), cup("b", 0.05)), "a"),
        ((cup("a", WITHIN + NEAR), cup("b", 0.05)), "b"),
    ],
)
def test_the_nearest_object_within_reach_of_the_tip_target_is_marked(objects, name):
    object = marked((0.0, 0.0, 0.0), World("world", (), objects), WITHIN)
    assert (object.name if object else None) == name


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(("side", "sign"), [("low", -1), ("high", 1)])
def test_a_target_in_a_solid_is_blocked_wherever_a_map_has_it(axis, side, sign):
    box = Obstacle("the table", (-1.0, -2.0, -3.0), (1.0, 2.0, 3.0))
    place = [0.0, 0.0, 0.0]
    for beyond, reach in ((-NEAR, "blocked"), (0.0, "blocked"), (NEAR, "inside")):
        place[axis] = getattr(box, side)[axis] + sign * beyond
        target = _target(tuple(place), Reading("inside"), World("world", (box,)))
        assert target.reach == reach
        assert target.obstacle == ("the table" if reach == "blocked" else "")


def test_what_a_map_says_is_kept_where_nothing_is():
    reading = Reading("outside", 0.1, (0.0, 0.0, 0.0))
    assert _target((5.0, 0.0, 0.0), reading, World("world")) == Target((5.0, 0.0, 0.0), *reading)


@pytest.mark.parametrize(("object", "taken"), [("the cup", True), ("", False), ("the box", False)])
def test_an_offer_is_for_the_object_that_is_marked(object, taken):
    offer = Offer("the cup", (0.0, 0.0, 0.0), DOWN, 0.9)
    asked = replace(targets(), object=object)
    assert offered(asked, offer).better == (offer if taken else None)
    assert offered(asked, None) is asked


TILT = Orientation(60.0, 90.0)


def direction(degrees):
    angle = math.radians(degrees)
    return (math.sin(angle), 0.0, -math.cos(angle))


@pytest.mark.parametrize(
    ("before", "toward", "dt", "after", "limited"),
    [
        (0.0, 30.0, 1.0, 30.0, False),
        (0.0, 30.0, 0.1, 9.0, False),
        (0.0, -30.0, 0.1, -9.0, False),
        (0.0, 59.9, 1.0, 59.9, False),
        (0.0, 60.1, 1.0, 60.0, True),
        (50.0, 120.0, 1.0, 60.0, True),
        (60.0, 0.0, 0.1, 51.0, False),
        (0.0, 9.0, 0.1, 9.0, False),
        (0.0, 0.0, 0.1, 0.0, False),
    ],
)
def test_the_end_effector_follows_the_controller_as_fast_and_as_far_as_it_may(before, toward, dt, after, limited):
    turned, at_limit = tilted(direction(before), direction(toward), dt, TILT)
    np.testing.assert_allclose(turned, direction(after), atol=1e-9)
    assert at_limit == limited
