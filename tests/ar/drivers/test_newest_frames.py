"""Which frames of a bus are heard, the newest of each motor and no other's, and which are sent."""

from types import SimpleNamespace

import can
import pytest

from tests.support.motors import motor_settings
from trunkline.ar.drivers.gm6020 import FEEDBACK, NUMBERS, command_frames
from trunkline.ar.drivers.on_bus import BusMotors

FIRST, SECOND = sorted(NUMBERS)[:2]


def frame(number: int, angle: int = 100, size: int = 8, error: bool = False) -> can.Message:
    data = angle.to_bytes(2, "big") + bytes(6)
    return can.Message(arbitration_id=FEEDBACK + number, data=data[:size], is_extended_id=False, is_error_frame=error)


@pytest.mark.parametrize(
    ("frames", "heard"),
    [
        ([], []),
        ([frame(FIRST, 100)], [(FIRST, 100)]),
        ([frame(FIRST, 100), frame(FIRST, 200)], [(FIRST, 200)]),
        ([frame(FIRST, 100), frame(SECOND, 300)], [(FIRST, 100), (SECOND, 300)]),
        ([frame(max(NUMBERS) + 1), frame(-1), frame(FIRST, 100)], [(FIRST, 100)]),  # another's
        ([frame(FIRST, 100), frame(FIRST, 200, size=7)], [(FIRST, 100)]),  # cut
        ([frame(FIRST, 100), frame(FIRST, 200, error=True)], [(FIRST, 100)]),
    ],
)
def test_the_newest_whole_frame_of_each_motor_is_heard(frames, heard):
    waiting, newest = iter(frames), []
    bus = SimpleNamespace(recv=lambda _: next(waiting, None), send=lambda _: None, set_filters=lambda _: None)
    driver = BusMotors(motor_settings(), bus)  # type: ignore[arg-type]
    hear = lambda feedback, _: newest.append((feedback.number, feedback.angle))  # noqa: E731
    driver.motors = SimpleNamespace(fault="", hear=hear, currents=lambda *_: {})  # type: ignore[assignment]
    driver.turn([0.0], [0.0])
    assert (newest, driver.fault) == (heard, "")


def test_currents_go_out_in_standard_frames():
    sent: list[can.Message] = []
    bus = SimpleNamespace(recv=lambda _: None, send=sent.append, set_filters=lambda _: None)
    driver = BusMotors(motor_settings(), bus)  # type: ignore[arg-type]
    driver.motors = SimpleNamespace(fault="", currents=lambda *_: {FIRST: 0.5})  # type: ignore[assignment]
    driver.turn([0.0], [0.0])
    expected = list(command_frames({FIRST: 0.5}))
    assert [(message.arbitration_id, bytes(message.data)) for message in sent] == expected
    assert not any(message.is_extended_id for message in sent)


def test_the_first_fault_of_a_bus_is_the_one_that_is_named():
    causes = iter([OSError("unplugged"), OSError("gone")])

    def recv(_):
        raise next(causes)

    bus = SimpleNamespace(recv=recv, send=lambda _: None, set_filters=lambda _: None)
    driver = BusMotors(motor_settings(), bus)  # type: ignore[arg-type]
    for _ in range(2):
        driver.turn([0.0], [0.0])
        assert driver.fault == "bus: unplugged"
