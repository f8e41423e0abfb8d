"""Frames of the motors, byte by byte."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trunkline.ar.drivers.gm6020 import FULL, Feedback, command_frames, commanded, feedback_frame, feedback_of


def test_a_command_as_the_public_drivers_have_it():
    assert command_frames({1: 3.0, 2: -3.0, 4: 1.5}) == [(0x1FE, bytes.fromhex("4000c00000002000"))]
    assert command_frames({5: -1.5, 7: 3.0}) == [(0x2FE, bytes.fromhex("e000000040000000"))]
    assert [identifier for identifier, _ in command_frames({4: 0.0, 5: 0.0})] == [0x1FE, 0x2FE]


def test_a_current_beyond_the_most_is_cut():
    (frame,) = command_frames({1: 100.0, 2: -100.0})
    assert frame == command_frames({1: 3.0, 2: -3.0})[0]


def test_feedback_as_the_public_drivers_have_it():
    feedback = feedback_of(0x205, bytes.fromhex("1fff0064e0002a00"))
    assert feedback == Feedback(1, 8191, 100, -1.5, 42)
    assert feedback_of(0x20B, bytes.fromhex("0000ff9c20002a00")) == Feedback(7, 0, -100, 1.5, 42)


@pytest.mark.parametrize(("identifier", "data"), [(0x204, bytes(8)), (0x20C, bytes(8)), (0x205, bytes(7)), (1, b"")])
def test_other_frames_are_nothing(identifier, data):
    assert feedback_of(identifier, data) is None
    assert commanded(identifier, data) == {}


@given(st.dictionaries(st.integers(1, 7), st.floats(-3, 3), min_size=1))
def test_currents_come_back(currents):
    decoded = {}
    for frame in command_frames(currents):
        decoded |= commanded(*frame)
    for number, current in decoded.items():
        assert current == pytest.approx(currents.get(number, 0.0), abs=1.5 / FULL + 1e-12)
    assert currents.keys() <= decoded.keys()


@given(st.integers(1, 7), st.integers(0, 8191), st.integers(-500, 500), st.integers(0, 120))
def test_feedback_comes_back(number, angle, rpm, celsius):
    feedback = Feedback(number, angle, rpm, 0.75, celsius)
    assert feedback_of(*feedback_frame(feedback)) == feedback
