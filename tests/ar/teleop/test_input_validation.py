"""What is taken for sound, from both sides of each border: controllers, clocks, silence, settings, hands that swap."""

from dataclasses import replace

import pytest

from tests.support.operator import PACKAGE, REFERENCE, config
from trunkline.ar.teleop.headset_silence import silence_fault
from trunkline.ar.teleop.input_validation import UNIT, clock_fault, fault_of, setting_fault, swapped
from trunkline.ar.teleop.messages import Controller, Input, Pose, World
from trunkline.ar.teleop.tracked_controller import Hand

NAN, INFINITY, NEAR = float("nan"), float("inf"), 1e-6
SAFETY, FORWARD = config().core.safety, (1.0, 0.0, 0.0, 0.0)
HAND = Controller((0.1, 0.2, 0.3), FORWARD)
MESSAGE = Input(100.0, HAND, HAND, REFERENCE, (0.0,) * 7, World("world"), PACKAGE)


def of_length(length):
    return (0.6 * length, 0.0, 0.8 * length, 0.0)


CONTROLLERS = [
    (HAND, ""),
    (replace(HAND, tracked=False), "not tracked"),
    (replace(HAND, tracked=False, position=(NAN, 0.0, 0.0)), "not tracked"),
    *((replace(HAND, position=tuple(bad if i == n else 0.0 for i in range(3))), "pose is not a number")
      for n in range(3) for bad in (NAN, INFINITY, -INFINITY)),
    *((replace(HAND, quaternion=tuple(NAN if i == n else 0.5 for i in range(4))), "pose is not a number")
      for n in range(4)),
    *((replace(HAND, stick=tuple(NAN if i == n else 0.0 for i in range(2))), "pose is not a number") for n in range(2)),
    (replace(HAND, quaternion=of_length(1 + UNIT - NEAR)), ""),
    (replace(HAND, quaternion=of_length(1 + UNIT + NEAR)), "quaternion is not of unit length"),
    (replace(HAND, quaternion=of_length(1 - UNIT + NEAR)), ""),
    (replace(HAND, quaternion=of_length(1 - UNIT - NEAR)), "quaternion is not of unit length"),
    (replace(HAND, quaternion=(0.0,) * 4), "quaternion is not of unit length"),
]  # fmt: skip


@pytest.mark.parametrize(("controller", "fault"), CONTROLLERS)
def test_a_controller(controller, fault):
    assert fault_of(controller) == fault


@pytest.mark.parametrize(
    ("last", "stamp", "dt", "fault"),
    [
        (None, 100.0, 0.01, ""),
        (99.0, 100.0, 0.01, ""),
        (100.0, 100.0, 0.01, ""),
        (100.0 + NEAR, 100.0, 0.01, "clock went back by 1e-06 s; holding"),
        (99.0, 100.0, 0.0, "step of 0 s: expected a positive time; holding"),
        (99.0, 100.0, -0.01, "step of -0.01 s: expected a positive time; holding"),
        (99.0, 100.0, NAN, "step of nan s: expected a positive time; holding"),
        (99.0, 100.0, INFINITY, "step of inf s: expected a positive time; holding"),
        (99.0, NAN, 0.01, "stamp is not a number; holding"),
        (99.0, INFINITY, 0.01, "stamp is not a number; holding"),
        (None, -INFINITY, 0.01, "stamp is not a number; holding"),
        (101.0, NAN, 0.0, "step of 0 s: expected a positive time; holding"),
    ],
)
def test_a_clock(last, stamp, dt, fault):
    assert clock_fault(last, replace(MESSAGE, stamp=stamp), dt) == fault


@pytest.mark.parametrize(
    ("last", "stamp", "silent", "faulty"),
    [
        (None, 100.0, 0.0, False),
        (None, 100.0, SAFETY.silence - NEAR, False),
        (None, 100.0, SAFETY.silence + NEAR, True),
        (100.0, 100.0 + SAFETY.silence - NEAR, 0.0, False),
        (100.0, 100.0 + SAFETY.silence + NEAR, 0.0, True),  # by its own clock
        (100.0, 100.0, SAFETY.silence + NEAR, True),  # by ours
        (100.0, 100.0 + SAFETY.silence - NEAR, SAFETY.silence - NEAR, False),
    ],
)
def test_silence(last, stamp, silent, faulty):
    assert bool(silence_fault(last, stamp, silent, SAFETY)) == faulty


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, ""),
        ({"package": "b" * 64}, "package: found digest bbbbbbbbbbbb, expected aaaaaaaaaaaa; holding"),
        ({"package": ""}, "package: found digest none, expected aaaaaaaaaaaa; holding"),
        ({"alignment": None}, "base is not aligned; holding"),
        ({"alignment": Pose((NAN, 0.0, 0.0), FORWARD)}, "base alignment is not a pose; holding"),
        ({"alignment": Pose((0.0, 0.0, 0.0), (NAN, 0.0, 0.0, 0.0))}, "base alignment is not a pose; holding"),
        ({"alignment": Pose((0.0, 0.0, 0.0), of_length(1 + UNIT + NEAR))}, "base alignment is not a pose; holding"),
        ({"alignment": Pose((0.0, 0.0, 0.0), of_length(1 - UNIT - NEAR))}, "base alignment is not a pose; holding"),
        ({"alignment": Pose((0.0, 0.0, 0.0), of_length(1 + UNIT - NEAR))}, ""),
        *(({"joints": tuple(NAN if i == n else 0.0 for i in range(7))}, "robot's joints are not numbers; holding")
          for n in range(7)),
        ({"package": "", "alignment": None, "joints": (NAN,) * 7},
         "package: found digest none, expected aaaaaaaaaaaa; holding"),
        ({"alignment": None, "joints": (NAN,) * 7}, "base is not aligned; holding"),
    ],
)  # fmt: skip
def test_settings(changes, fault):
    assert setting_fault(replace(MESSAGE, **changes), PACKAGE) == fault


def swap(apart, left, right, visible=(True, True)):
    """Hands that were `apart` m, and are now `left` and `right` m from where the left one was."""
    before = [Hand(0.6, controller=replace(HAND, position=(at, 0.0, 0.0)) if there else None)
              for at, there in zip((0.0, apart), visible, strict=True)]  # fmt: skip
    message = replace(
        MESSAGE, left=replace(HAND, position=(left, 0.0, 0.0)), right=replace(HAND, position=(right, 0.0, 0.0))
    )
    return swapped(*before, message, SAFETY.swap)


@pytest.mark.parametrize(
    ("apart", "left", "right", "visible", "expected"),
    [
        (0.4, 0.4, 0.0, (True, True), True),
        (0.4, 0.0, 0.4, (True, True), False),
        (0.4, 0.4 - SAFETY.swap + NEAR, 0.0, (True, True), True),
        (0.4, 0.4 - SAFETY.swap - NEAR, 0.0, (True, True), False),
        (0.4, 0.4, SAFETY.swap - NEAR, (True, True), True),
        (0.4, 0.4, SAFETY.swap + NEAR, (True, True), False),
        (2 * SAFETY.swap + NEAR, 2 * SAFETY.swap + NEAR, 0.0, (True, True), True),
        (2 * SAFETY.swap - NEAR, 2 * SAFETY.swap - NEAR, 0.0, (True, True), False),  # as near: nobody can tell
        (0.4, 0.4, 0.0, (False, True), False),
        (0.4, 0.4, 0.0, (True, False), False),
    ],
)
def test_hands_that_have_changed_places(apart, left, right, visible, expected):
    assert swap(apart, left, right, visible) == expected
