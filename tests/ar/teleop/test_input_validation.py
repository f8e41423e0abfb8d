"""What is trusted, by number: each reason alone, each border and its sides, and which comes first."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from trunkline.ar.teleop.client_silence import silence_reason
from trunkline.ar.teleop.input_validation import clock_fault, fault_of, setting_fault, swapped
from trunkline.ar.teleop.messages import Controller, Pose
from trunkline.ar.teleop.tracked_controller import Hand

NAN, INF, NEAR = math.nan, math.inf, 1e-6
LEVEL = (1.0, 0.0, 0.0, 0.0)
GOOD = Controller(position=(1.0, 2.0, 3.0), quaternion=LEVEL, tracked=True)
BASE = Pose((0.0, 0.0, 0.0), LEVEL)
PACKAGE = "a" * 64


def with_one(value: float, place: int, count: int) -> tuple[float, ...]:
    """Numbers of which one is `value`."""
    return tuple(value if i == place else 0.5 for i in range(count))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, ""),
        ({"tracked": False}, "not tracked"),
        ({"tracked": False, "position": (NAN, 0.0, 0.0), "quaternion": (2.0, 0.0, 0.0, 0.0)}, "not tracked"),
        *(({"position": with_one(bad, n, 3)}, "pose is not a number") for n in range(3) for bad in (NAN, INF, -INF)),
        *(({"quaternion": with_one(NAN, n, 4)}, "pose is not a number") for n in range(4)),
        *(({"stick": with_one(NAN, n, 2)}, "pose is not a number") for n in range(2)),
        ({"quaternion": (1.0099, 0.0, 0.0, 0.0)}, ""),
        ({"quaternion": (0.0, 0.9901, 0.0, 0.0)}, ""),
        ({"quaternion": (1.0101, 0.0, 0.0, 0.0)}, "quaternion is not of unit length"),
        ({"quaternion": (0.0, 0.0, 0.9899, 0.0)}, "quaternion is not of unit length"),
        ({"quaternion": (0.5, -0.5, 0.5, -0.5)}, ""),
        ({"quaternion": (0.0, 0.0, 0.0, 0.0)}, "quaternion is not of unit length"),
    ],
)
def test_a_controller_is_tracked_its_numbers_finite_and_its_quaternion_of_unit_length_to_a_hundredth(change, fault):
    assert fault_of(replace(GOOD, **change)) == fault


@pytest.mark.parametrize(
    ("last", "stamp", "dt", "fault"),
    [
        (None, 5.0, 0.01, ""),
        (None, -5.0, 0.01, ""),
        (5.0, 5.0, 0.01, ""),
        (5.0, 5.1, 1e-9, ""),
        (5.0, 4.75, 0.01, "clock went back by 0.25 s; holding"),
        (100.0 + NEAR, 100.0, 0.01, "clock went back by 1e-06 s; holding"),
        (None, -INF, 0.01, "stamp is not a number; holding"),
        (5.0, NAN, 0.01, "stamp is not a number; holding"),
        (5.0, INF, 0.01, "stamp is not a number; holding"),
        (5.0, 5.1, 0.0, "step of 0 s: expected a positive time; holding"),
        (5.0, 5.1, -0.01, "step of -0.01 s: expected a positive time; holding"),
        (5.0, 5.1, NAN, "step of nan s: expected a positive time; holding"),
        (5.0, 5.1, INF, "step of inf s: expected a positive time; holding"),
        (5.0, NAN, 0.0, "step of 0 s: expected a positive time; holding"),
    ],
)
def test_time_goes_on_in_finite_steps(last, stamp, dt, fault):
    assert clock_fault(last, SimpleNamespace(stamp=stamp), dt) == fault


@pytest.mark.parametrize(
    ("last", "stamp", "silent", "fault"),
    [
        (None, 9.0, 0.25, ""),
        (None, 9.0, 0.26, "client silent for 0.26 s; holding"),
        (1.0, 1.25, 0.0, ""),
        (1.0, 1.5, 0.0, "client silent for 0.50 s; holding"),
        (1.0, 1.0, 0.5, "client silent for 0.50 s; holding"),
        (1.0, 1.75, 0.5, "client silent for 0.75 s; holding"),
        (None, 9.0, 0.25 + NEAR, "client silent for 0.25 s; holding"),
        (1.0, 1.25 - NEAR, 0.25 - NEAR, ""),
        (1.0, 1.25 + NEAR, 0.0, "client silent for 0.25 s; holding"),  # by its own clock
        (1.0, 1.0, 0.25 + NEAR, "client silent for 0.25 s; holding"),  # by ours
    ],
)
def test_a_client_is_silent_by_its_stamps_or_by_what_does_not_come(last, stamp, silent, fault):
    assert silence_reason(last, stamp, silent, SimpleNamespace(silence=0.25)) == fault


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, ""),
        ({"package": "b" * 64}, "package: found digest bbbbbbbbbbbb, expected aaaaaaaaaaaa; holding"),
        ({"package": ""}, "package: found digest none, expected aaaaaaaaaaaa; holding"),
        (
            {"package": "", "alignment": None, "joints": (NAN,)},
            "package: found digest none, expected aaaaaaaaaaaa; holding",
        ),
        ({"alignment": None}, "base is not aligned; holding"),
        ({"alignment": replace(BASE, position=(NAN, 0.0, 0.0))}, "base alignment is not a pose; holding"),
        ({"alignment": replace(BASE, quaternion=(NAN, 0.0, 0.0, 0.0))}, "base alignment is not a pose; holding"),
        ({"alignment": replace(BASE, quaternion=(1.0099, 0.0, 0.0, 0.0))}, ""),
        ({"alignment": replace(BASE, quaternion=(0.9901, 0.0, 0.0, 0.0))}, ""),
        ({"alignment": replace(BASE, quaternion=(1.0101, 0.0, 0.0, 0.0))}, "base alignment is not a pose; holding"),
        ({"alignment": replace(BASE, quaternion=(0.9899, 0.0, 0.0, 0.0))}, "base alignment is not a pose; holding"),
        ({"alignment": None, "joints": (NAN,)}, "base is not aligned; holding"),
        *(({"joints": with_one(NAN, n, 7)}, "robot's joints are not numbers; holding") for n in range(7)),
        ({"joints": (INF, 0.0)}, "robot's joints are not numbers; holding"),
    ],
)
def test_package_base_and_joints_are_those_that_are_known(change, fault):
    message = SimpleNamespace(**({"package": PACKAGE, "alignment": BASE, "joints": (0.0,) * 7} | change))
    assert setting_fault(message, PACKAGE) == fault


def at(*position: float) -> Controller:
    return replace(GOOD, position=position)


LEFT, RIGHT = at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("before", "left", "right", "changed_places"),
    [
        ((LEFT, RIGHT), RIGHT, LEFT, True),
        ((LEFT, RIGHT), LEFT, RIGHT, False),
        ((LEFT, RIGHT), at(1.0, 0.25, 0.0), at(0.0, 0.0, 0.25), True),  # as far from the other's place as may be
        ((LEFT, RIGHT), at(0.75 + NEAR, 0.0, 0.0), LEFT, True),
        ((LEFT, RIGHT), at(0.75 - NEAR, 0.0, 0.0), LEFT, False),
        ((LEFT, RIGHT), RIGHT, at(0.25 - NEAR, 0.0, 0.0), True),
        ((LEFT, RIGHT), RIGHT, at(0.25 + NEAR, 0.0, 0.0), False),
        ((LEFT, at(0.5 + NEAR, 0.0, 0.0)), at(0.5 + NEAR, 0.0, 0.0), LEFT, True),
        ((LEFT, at(0.5 - NEAR, 0.0, 0.0)), at(0.5 - NEAR, 0.0, 0.0), LEFT, False),
        ((LEFT, RIGHT), at(1.0, 0.26, 0.0), LEFT, False),  # one of both is further
        ((LEFT, RIGHT), RIGHT, at(0.0, 0.26, 0.0), False),
        ((LEFT, at(0.5, 0.0, 0.0)), at(0.5, 0.0, 0.0), LEFT, False),  # near to its own place too
        ((LEFT, at(0.51, 0.0, 0.0)), at(0.51, 0.0, 0.0), LEFT, True),
        ((LEFT, at(0.6, 0.0, 0.0)), at(0.6, 0.0, 0.0), at(0.1, 0.0, 0.0), False),  # one of both near to its own
        ((LEFT, at(0.6, 0.0, 0.0)), at(0.5, 0.0, 0.0), LEFT, False),
        ((None, RIGHT), RIGHT, LEFT, False),
        ((LEFT, None), RIGHT, LEFT, False),
    ],
)
def test_controllers_have_changed_places_where_both_are_near_to_the_others_and_far_from_their_own(
    before, left, right, changed_places
):
    hands = [Hand(1.0, controller=controller) for controller in before]
    assert swapped(*hands, SimpleNamespace(left=left, right=right), 0.25) is changed_places
