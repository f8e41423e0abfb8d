"""Motors on a bus: on a clock that a test turns, and on python-can's virtual bus, alone."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import can
import numpy as np
import pytest

from tests.support import waiting
from tests.support.motors import PLANTS, TICK, Workbench, homed, motor_settings
from trunkline.ar.drivers import on_bus
from trunkline.ar.drivers.gm6020 import FEEDBACK, NUMBERS, Feedback, command_frames
from trunkline.ar.drivers.motors import FEEDBACK_TIMEOUT
from trunkline.ar.drivers.on_bus import (
    FILTERS,
    BusMotors,
    SimulatedBusMotors,
    SimulatedMotorsOnBus,
    SimulatedMotorsThread,
    open_bus,
)
from trunkline.errors import InputError

until = partial(waiting.until, seconds=5.0)
GONE = can.CanOperationError("gone")


class BenchBus:
    """A bus with a bench's bank on its other end, on the bench's clock. `hears`, `takes`: whether it does; `deaf`: the
    id of a frame that it does not take. `sent`: (id, data) of what it took."""

    def __init__(self, bench):
        self.bench, self.waiting, self.sent = bench, [], []
        self.hears = self.takes = True
        self.deaf, self.filters, self.closed = None, None, False

    def set_filters(self, filters):
        self.filters = filters

    def tick(self):
        self.bench.now += TICK
        self.waiting += self.bench.simulated.advance(self.bench.now)

    def recv(self, timeout):
        assert timeout == 0
        if not self.hears:
            raise GONE
        if not self.waiting:
            return None
        identifier, data = self.waiting.pop(0)
        return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)

    def send(self, message):
        if not self.takes or message.arbitration_id == self.deaf:
            raise can.CanOperationError("full")
        self.sent.append((message.arbitration_id, bytes(message.data)))
        self.bench.simulated.hear(message.arbitration_id, bytes(message.data), self.bench.now)

    def shutdown(self):
        self.closed = True


class Played:
    """Motors on a bench's bus. They are homed, and pull, so that all of them carry current."""

    def __init__(self, monkeypatch, bench):
        self.bench, self.bus = bench, BenchBus(bench)
        monkeypatch.setattr(on_bus, "time", SimpleNamespace(monotonic=lambda: bench.now))
        self.driver = BusMotors(motor_settings(), self.bus)
        self.driver.motors = bench.motors

    def turn(self, seconds=TICK, pull=0.01):
        for _ in range(max(round(seconds / TICK), 1)):
            self.bus.tick()
            self.driver.turn([pull] * 3, [0.0] * 3)
        return self

    @property
    def currents(self):
        return np.abs(self.bench.currents)


@pytest.fixture
def driven(monkeypatch):
    played = Played(monkeypatch, homed()).turn(0.3)
    assert played.currents.min() > 0.05
    assert played.driver.fault == ""
    return played


def test_motors_that_are_heard_are_homed_and_driven(monkeypatch):
    played = Played(monkeypatch, Workbench())
    for _ in range(10_000):
        played.turn()
        if played.driver.motors.homed:
            break
    assert played.driver.motors.homed
    assert played.driver.fault == ""
    assert played.bus.filters == FILTERS


def test_a_bus_that_gives_nothing_but_errors_ends_all_current_at_once(driven):
    """At that very turn, long before anybody finds a motor silent; and for good."""
    driven.bus.hears = False
    driven.turn()
    assert driven.currents.max() == 0.0
    assert driven.driver.fault == "bus: gone"
    assert driven.bus.sent[-1] == (0x1FE, bytes(8))
    driven.turn(FEEDBACK_TIMEOUT / 2)
    assert driven.driver.motors.fault == ""
    assert driven.currents.max() == 0.0
    driven.bus.hears = True
    driven.turn(0.1)
    assert driven.currents.max() == 0.0
    assert driven.driver.fault == "bus: gone"


def test_a_bus_that_takes_nothing_is_a_fault_and_no_current_is_sent_once_it_does(driven):
    before = len(driven.bus.sent)
    driven.bus.takes = False
    driven.turn()
    assert driven.driver.fault == "bus: full"
    assert len(driven.bus.sent) == before
    driven.bus.takes = True
    driven.turn(0.05)
    assert set(driven.bus.sent[before:]) == {(0x1FE, bytes(8))}
    assert driven.currents.max() == 0.0
    driven.bus.hears = False
    driven.turn()
    assert driven.driver.fault == "bus: full", "the first"


def test_a_motor_that_is_silent_ends_all_current(driven):
    driven.bench.simulated.motors[0].silent = True
    driven.turn(FEEDBACK_TIMEOUT - TICK)
    assert driven.driver.fault == ""
    assert driven.currents.min() > 0.0
    driven.turn(3 * TICK)
    assert driven.driver.fault.startswith("motor 1: silent for 2")
    assert driven.currents.max() == 0.0
    driven.bench.simulated.motors[0].silent = False
    driven.turn(0.1)
    assert driven.currents.max() == 0.0


def test_a_fault_of_the_motors_ends_all_current_though_the_bus_is_well(driven):
    driven.bench.motors.hear(Feedback(2, 0, 0, 0.0, 119), driven.bench.now)
    driven.turn()
    assert driven.driver.fault.startswith("motor 2: found 119 °C")
    assert driven.currents.max() == 0.0


def test_a_closed_driver_leaves_no_current_and_no_bus(driven):
    driven.driver.close()
    assert driven.currents.max() == 0.0
    assert driven.bus.closed


def test_where_one_frame_is_not_taken_the_other_still_is(monkeypatch):
    played = Played(monkeypatch, Workbench())
    driver = BusMotors(replace(motor_settings(), numbers=(1, 5, 6)), played.bus)
    played.bus.deaf = 0x1FE
    driver.turn([0.01] * 3, [0.0] * 3)
    assert driver.fault == "bus: full"
    assert played.bus.sent == [(0x2FE, bytes(8))]


# --- which frames are heard and sent


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
def test_the_newest_whole_frame_of_each_motor_is_heard_and_currents_go_out_in_standard_frames(frames, heard):
    waiting, newest, sent = iter(frames), [], []
    bus = SimpleNamespace(recv=lambda _: next(waiting, None), send=sent.append, set_filters=lambda _: None)
    driver = BusMotors(motor_settings(), bus)  # type: ignore[arg-type]
    hear = lambda feedback, _: newest.append((feedback.number, feedback.angle))  # noqa: E731
    driver.motors = SimpleNamespace(fault="", hear=hear, currents=lambda *_: {FIRST: 0.5})  # type: ignore[assignment]
    driver.turn([0.0], [0.0])
    assert (newest, driver.fault) == (heard, "")
    assert [(message.arbitration_id, bytes(message.data)) for message in sent] == list(command_frames({FIRST: 0.5}))
    assert not any(message.is_extended_id for message in sent)


# --- on a bus of python-can


@pytest.mark.realtime
def test_motors_in_real_time_are_driven_until_one_is_silent(request):
    simulated = SimulatedMotorsThread(PLANTS, can.Bus(interface="virtual", channel=request.node.name))
    driver = BusMotors(motor_settings(), can.Bus(interface="virtual", channel=request.node.name))
    begun = len(simulated.reeled)

    def turn():
        driver.turn([0.0] * 3, [0.0] * 3)

    try:
        until(lambda: all(motor.current for motor in simulated.simulated.motors), turn)  # homing has begun
        until(lambda: len(simulated.reeled) > begun + 200, turn)
        assert driver.fault == ""
        simulated.simulated.motors[0].silent = True
        until(lambda: driver.fault, turn)
        assert driver.fault.startswith("motor 1: silent for 2")
        until(lambda: not any(motor.current for motor in simulated.simulated.motors), turn)
    finally:
        driver.close()
        simulated.close()


@pytest.mark.realtime
def test_simulated_motors_turn_when_their_driver_does(request):
    name = request.node.name
    simulated = SimulatedMotorsOnBus(PLANTS, can.Bus(interface="virtual", channel=name))
    driver = SimulatedBusMotors(motor_settings(), can.Bus(interface="virtual", channel=name), simulated)
    until(lambda: all(motor.current for motor in simulated.simulated.motors), lambda: driver.turn([0.0] * 3, [0.0] * 3))
    before = [motor.reeled for motor in simulated.simulated.motors]
    until(lambda: all(m.reeled > b for m, b in zip(simulated.simulated.motors, before, strict=True)),
          lambda: driver.turn([0.0] * 3, [0.0] * 3))  # fmt: skip
    assert driver.fault == ""
    driver.close()


def test_a_bus_that_is_not_there_is_one_line():
    with pytest.raises(InputError, match=r"^bus nowhere0: found no socketcan bus that opens"):
        open_bus("socketcan", "nowhere0")
