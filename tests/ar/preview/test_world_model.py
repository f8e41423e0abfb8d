"""What a client believes of the world after what it sees: an object is in the arm only where a plan that lifts has
lifted it."""

import numpy as np
import pytest

from trunkline.ar.preview.world_model import make_world, update_world
from trunkline.ar.teleop.messages import Obstacle, WorldObject

LIFT = 0.1  # m, of a grasp
NEAR = 1e-6  # m, to either side of a border
TABLE = Obstacle("the table", (-1.0, -1.0, -0.1), (1.0, 1.0, 0.0))
CUP = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, (0.6, 0.0, 0.2))
GRASP, BRING = ("approach", "curl", "lift"), ("transfer", "release")


def after(raised=0.0, aside=0.0, phases=(), support="hanging", objects=1):
    """The world with the cup seen so many m higher and aside."""
    cup = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, CUP.position, support=support)
    pose = np.array([*CUP.position, 1.0, 0.0, 0.0, 0.0]) + [0.0, aside, raised, 0.0, 0.0, 0.0, 0.0]
    before = make_world((TABLE,), (cup,) * objects)
    return before, update_world(before, pose, phases, LIFT)


@pytest.mark.parametrize(
    ("phases", "raised", "before", "support"),
    [
        (GRASP, LIFT, "hanging", "held"),
        (GRASP, LIFT / 2 + NEAR, "hanging", "held"),
        (GRASP, LIFT / 2 - NEAR, "hanging", "hanging"),
        (GRASP, 0.0, "hanging", "hanging"),
        (GRASP, -1.0, "hanging", "hanging"),  # it fell
        (GRASP, LIFT, "standing", "held"),
        (GRASP, 0.0, "standing", "standing"),
        (("approach", "curl"), LIFT, "hanging", "hanging"),  # nothing was to be lifted
        ((), LIFT, "hanging", "hanging"),  # no plan was run to its end
        (BRING, 0.0, "held", "standing"),
        (BRING, LIFT, "held", "standing"),
        (BRING, -1.0, "held", "standing"),
        (("approach",), 0.0, "held", "held"),
        ((*GRASP, "release"), LIFT, "hanging", "standing"),  # what is let go is not in the arm, however it came there
    ],
)  # fmt: skip
def test_what_holds_an_object_after_a_plan(phases, raised, before, support):
    (object,) = after(raised, 0.0, phases, before)[1].objects
    assert object.support == support


@pytest.mark.parametrize(("aside", "moved"), [(0.0, False), (0.005, False), (0.005 + NEAR, True), (1.0, True)])
def test_a_thing_is_elsewhere_once_it_is_seen_far_enough_from_where_it_is_believed(aside, moved):
    before, now = after(aside=aside)
    assert (now is not before) == moved
    assert now.objects[0].position == pytest.approx((0.6, aside if moved else 0.0, 0.2))
    assert (now.digest != before.digest) == moved
    assert now.obstacles == before.obstacles


def test_a_thing_that_another_support_has_is_where_it_is_seen_however_near():
    _, now = after(raised=-NEAR, phases=BRING, support="held")
    assert now.objects[0].position == pytest.approx((0.6, 0.0, 0.2 - NEAR), abs=NEAR / 10)


@pytest.mark.parametrize("objects", [0, 2])
def test_where_not_exactly_one_object_is_nobody_knows_which_was_seen(objects):
    before, now = after(1.0, 1.0, GRASP, objects=objects)
    assert now is before


@pytest.mark.parametrize("number", range(7))
def test_where_nothing_is_seen_nothing_changes(number):
    before = make_world((TABLE,), (CUP,))
    pose = np.array([*CUP.position, 1.0, 0.0, 0.0, 0.0]) + 1.0
    pose[number] = np.nan
    assert update_world(before, pose, GRASP, LIFT) is before


def test_a_world_is_of_its_digest():
    others = [make_world(()), make_world((TABLE,)), make_world((TABLE,), (CUP,)), make_world((), (CUP,))]
    assert len({world.digest for world in others}) == len(others)
    assert make_world((TABLE,), (CUP,)) == make_world((TABLE,), (CUP,))


@pytest.mark.parametrize(("raised", "support"), [(0.25, "hanging"), (np.nextafter(0.25, 1), "held")])
def test_a_thing_is_lifted_by_more_than_half_of_what_a_grasp_lifts(raised, support):
    before = make_world((), (WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, (0.0, 0.0, 0.0)),))
    now = update_world(before, np.array([0, 0, raised, 1, 0, 0, 0]), GRASP, 0.5)
    assert now.objects[0].support == support
