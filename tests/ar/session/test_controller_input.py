"""From a binary input to the core's controllers: which buttons are held, what stops, and when a hand is tracked."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session.binary import HAND, Received
from trunkline.ar.session.controller_input import (
    BUTTONS,
    PRESSED,
    _controller,
    buttons,
    controller_pose,
    controllers,
    stops,
)
from trunkline.ar.session.previewer import Order, _held_object
from trunkline.ar.teleop.messages import WorldObject

NEAR = 1e-6
BOTH = ("left_tracked", "right_tracked", "visible")
CUP = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, (0.6, 0.0, 0.2))


def row(**values):
    at = {"qw": 1.0} | values
    return np.array([at.get(name, 0.0) for name in HAND])


def received(left=None, right=None, flags=BOTH):
    hands = np.array([row() if hand is None else hand for hand in (left, right)])
    return Received("input", frozenset(flags), 0, 1.0, hands)


@pytest.mark.parametrize("name", BUTTONS)
@pytest.mark.parametrize(
    ("value", "is_held"), [(0.0, False), (PRESSED - NEAR, False), (PRESSED, True), (1.0, True), (np.nan, False)]
)
def test_a_button_is_held_from_half_its_way_on_and_no_other_with_it(name, value, is_held):
    controller = _controller(row(**{name: value}), True)
    assert {button: getattr(controller, button) for button in BUTTONS} == dict.fromkeys(BUTTONS, False) | {
        name: is_held
    }
    assert (buttons(received(row(**{name: value}))) != buttons(received())) == is_held


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("value", "is_held"), [(PRESSED - NEAR, False), (PRESSED, True), (np.nan, False)])
@pytest.mark.parametrize("flags", [BOTH, ()])
def test_either_secondary_button_stops_tracked_or_not(side, value, is_held, flags):
    hands = [row(), row()]
    hands[side] = row(secondary=value)
    assert stops(received(*hands, flags)) == is_held


@pytest.mark.parametrize("name", [name for name in BUTTONS if name != "secondary"])
def test_no_other_button_does(name):
    assert not stops(received(row(**{name: 1.0}), row(**{name: 1.0})))


@pytest.mark.parametrize(
    ("flags", "left", "right"),
    [(BOTH, True, True), (("left_tracked", "visible"), True, False), (("right_tracked", "visible"), False, True),
     (("visible",), False, False), (("left_tracked", "right_tracked"), False, False), ((), False, False)],
)  # fmt: skip
def test_a_hand_is_tracked_where_its_controller_is_and_the_page_is_seen(flags, left, right):
    message = received(flags=flags)
    assert [hand.tracked for hand in controllers(message)] == [left, right]
    assert [controller_pose(message, side) is not None for side in ("left", "right")] == [left, right]


@pytest.mark.parametrize("name", HAND[:7])
def test_what_is_no_pose_is_left_for_the_core_to_refuse_and_touches_nothing(name):
    message = received(row(**{name: np.nan}))
    assert controller_pose(message, "left") is None
    assert controllers(message)[0].tracked


@pytest.mark.parametrize(
    ("support", "named", "is_held"),
    [("held", True, True), ("held", False, False), ("hanging", True, False), ("standing", True, False)],
)
def test_a_thing_is_brought_where_it_is_meant_and_in_the_arm(support, named, is_held):
    object = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, CUP.position, support=support)
    targets = SimpleNamespace(object="the cup" if named else "")
    order = Order(SimpleNamespace(targets=targets), make_world((), (object,)), np.zeros(7), np.zeros(3))
    assert (_held_object(order) is not None) == is_held
