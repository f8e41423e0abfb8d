"""Where objects are gripped, how far they reach down, and what is beneath a place."""

from dataclasses import replace

import numpy as np
import pytest

from trunkline.ar.hybrid.objects import ObjectShape
from trunkline.ar.teleop.messages import Obstacle, Quaternion, World, WorldObject
from trunkline.ar.teleop.object_shapes import below_grip, beneath, distance_to, grip_of, way_of_grasping

BASKET = WorldObject("basket", "basket", 0.03, 0.06, 0.2, (0.5, 0.1, 0.2))
LEVEL: Quaternion = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
OVER: Quaternion = (0.0, 1.0, 0.0, 0.0)  # half a turn about x
SHAPED = ObjectShape("basket", 0.03, 0.06, 0.2)


def test_a_baskets_grip_is_its_bar_as_in_the_twin():
    np.testing.assert_allclose(np.subtract(grip_of(BASKET), BASKET.position), SHAPED.grip, atol=1e-12)
    over = replace(BASKET, quaternion=OVER)
    np.testing.assert_allclose(np.subtract(grip_of(over), BASKET.position), -SHAPED.grip, atol=1e-12)


def test_what_is_not_a_basket_is_gripped_in_its_centre():
    ball = replace(BASKET, shape="sphere", quaternion=OVER)
    assert grip_of(ball) == ball.position


def test_how_far_objects_reach_down():
    upright = SHAPED.half_height + SHAPED.grip[2]
    assert below_grip(BASKET) == pytest.approx(upright)
    assert below_grip(replace(BASKET, quaternion=OVER)) == pytest.approx(0.015)  # the bar is lowest
    cylinder = replace(BASKET, shape="cylinder", height=0.12)
    assert below_grip(cylinder) == pytest.approx(0.06)
    assert below_grip(replace(cylinder, quaternion=LEVEL)) == pytest.approx(0.015)
    assert below_grip(replace(cylinder, shape="sphere")) == pytest.approx(0.015)
    turned: Quaternion = (np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8), 0.0)  # by 45 deg about y
    box = replace(BASKET, shape="box", height=0.03, quaternion=turned)
    assert below_grip(box) == pytest.approx(0.015 * np.sqrt(2))


def test_ways_of_grasping():
    for support in ("hanging", "standing", "held"):
        assert way_of_grasping(replace(BASKET, support=support)) == "basket"
    cylinder = replace(BASKET, shape="cylinder")
    ways = [way_of_grasping(replace(cylinder, support=support)) for support in ("hanging", "standing", "held")]
    assert ways == ["hanging", "standing", "hanging"]


def test_the_highest_solid_beneath_a_place():
    floor, table = Obstacle("floor", (-3, -3, -2), (3, 3, -1)), Obstacle("table", (0, 0, -0.1), (1, 1, 0))
    world = World("w", (floor, table))
    assert beneath((0.5, 0.5, 0.1), world) == table
    assert beneath((0.5, 0.5, -0.05), world) == floor
    assert beneath((-0.5, 0.5, 0.1), world) == floor
    assert beneath((9.0, 0.5, 0.1), world) is None


TURNED: Quaternion = (np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8))  # by 45 deg about z
BOX = WorldObject("box", "box", 0.1, 0.2, 0.1, (0.5, 0.1, 0.2), TURNED)
BAR = np.subtract(grip_of(BASKET), BASKET.position)[2]


@pytest.mark.parametrize(
    ("object", "aside", "expected"),
    [
        (replace(BASKET, shape="sphere"), (0.04, 0.0, 0.0), 0.025),
        (replace(BASKET, shape="sphere"), (0.01, 0.0, 0.0), 0.0),
        (BOX, (0.1, 0.0, 0.0), 0.1 - 0.05 * np.sqrt(2)),  # an edge faces it
        (BOX, (0.1, 0.1, 0.0), 0.1 * np.sqrt(2) - 0.05),
        (BOX, (0.0, 0.0, 0.13), 0.03),
        (BOX, (0.0, 0.03, 0.05), 0.0),
        (BASKET, (0.0, 0.0, BAR + 0.02), 0.005),  # above the bar, which is 30 mm thick
        (BASKET, (0.0, 0.1, BAR), 0.02),  # beside its end
        (BASKET, (0.05, 0.0, BAR), 0.035),
        (replace(BASKET, quaternion=OVER), (0.0, 0.0, -BAR - 0.02), 0.005),
    ],
)
def test_how_far_a_point_is_from_an_object(object, aside, expected):
    assert distance_to(object, tuple(np.add(object.position, aside))) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("point", "expected"),
    [((0.1, 0.1, 0.5), 0.0), ((0.3, 0.1, 0.5), 0.1), ((-0.03, 0.1, -0.04), 0.05), ((0.1, 0.2, 1.0), 0.0)],
)
def test_how_far_a_point_is_from_an_obstacle(point, expected):
    assert distance_to(Obstacle("table", (0.0, 0.0, 0.0), (0.2, 0.2, 1.0)), point) == pytest.approx(expected)
