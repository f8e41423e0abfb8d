"""Frames of the GM6020 motor on a CAN bus, driven by current: numbers to bytes and back, and nothing else.

A current command drives four motors: four big-endian int16, of which ±16384 are ±3 A; motors 1 to 4 hear the id 0x1FE,
motors 5 to 7 the id 0x2FE. Each motor answers under the id 0x204 + its number, 1000 times a second: angle of its
single-turn encoder (0 to 8191), speed in turns a minute, current as in a command, temperature in °C.

Source: several public drivers, which agree with each other. It was not compared with the maker's sheet.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass

MOST_AMPERES = 3.0
FULL = 16384  # what a command says for MOST_AMPERES
COUNTS = 8192  # of the encoder in a turn
TORQUE = 0.741  # N m/A
RATE = 1000.0  # Hz, of feedback
NUMBERS = range(1, 8)
GROUPS = {0x1FE: (1, 2, 3, 4), 0x2FE: (5, 6, 7)}  # id of a command to the motors that hear it
FEEDBACK = 0x204


@dataclass(frozen=True)
class Feedback:
    """Of motor `number`: encoder `angle` in counts, speed `rpm`, `current` in A, `celsius`."""

    number: int
    angle: int
    rpm: int
    current: float
    celsius: int


def command_frames(currents: Mapping[int, float]) -> list[tuple[int, bytes]]:
    """(id, data) of each frame that sends the motors, by number, their `currents`, A, cut at ±MOST_AMPERES.

    A motor of the same group that is not named is sent 0.
    """
    frames = []
    for identifier, group in GROUPS.items():
        if not currents.keys().isdisjoint(group):
            raw = [_raw(currents.get(number, 0.0)) for number in group]
            frames.append((identifier, struct.pack(">4h", *raw, *[0] * (4 - len(raw)))))
    return frames


def commanded(identifier: int, data: bytes) -> dict[int, float]:
    """Currents, A, by the motor's number, of a command's frame; none of another frame."""
    if identifier not in GROUPS or len(data) != 8:
        return {}
    raw = struct.unpack(">4h", data)
    return {number: value * MOST_AMPERES / FULL for number, value in zip(GROUPS[identifier], raw, strict=False)}


def feedback_frame(feedback: Feedback) -> tuple[int, bytes]:
    """(id, data)."""
    rest = feedback.angle, feedback.rpm, _raw(feedback.current), feedback.celsius
    return FEEDBACK + feedback.number, struct.pack(">HhhBx", *rest)


def feedback_of(identifier: int, data: bytes) -> Feedback | None:
    """None of another frame."""
    if identifier - FEEDBACK not in NUMBERS or len(data) != 8:
        return None
    angle, rpm, raw, celsius = struct.unpack(">HhhBx", data)
    return Feedback(identifier - FEEDBACK, angle % COUNTS, rpm, raw * MOST_AMPERES / FULL, celsius)


def _raw(current: float) -> int:
    return round(min(max(current / MOST_AMPERES, -1.0), 1.0) * FULL)
