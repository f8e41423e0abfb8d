"""Motors and bank on python-can's virtual bus, in real time; margins are wide, as machines are busy."""

from dataclasses import replace
from functools import partial

import can
import pytest

from tests.support import waiting
from tests.support.motors import PLANTS, motor_settings
from trunkline.errors import InputError
from trunkline.execution import motors
from trunkline.execution.on_bus import BankInThread, BankOnBus, BusMotors, SimulatedMotors, open_bus

until = partial(waiting.until, seconds=5.0)


@pytest.fixture
def joined(request, monkeypatch):
    monkeypatch.setattr(motors, "SILENT", 0.5)  # a busy machine is late
    bank = BankInThread(PLANTS, can.Bus(interface="virtual", channel=request.node.name))
    driver = BusMotors(motor_settings(), can.Bus(interface="virtual", channel=request.node.name))
    yield driver, bank
    driver.close()
    bank.close()


def test_motors_are_driven_until_one_is_silent(joined):
    driver, bank = joined

    def turn():
        driver.turn([0.0] * 3, [0.0] * 3)

    until(lambda: all(motor.current for motor in bank.bank.motors), turn)  # homing has begun
    bank.bank.motors[0].silent = True
    until(lambda: driver.fault, turn)
    assert "silent for" in driver.fault
    until(lambda: not any(motor.current for motor in bank.bank.motors), turn)


def test_simulated_motors_turn_when_their_driver_does(request):
    name = request.node.name
    bank = BankOnBus(PLANTS, can.Bus(interface="virtual", channel=name))
    driver = SimulatedMotors(motor_settings(), can.Bus(interface="virtual", channel=name), bank)
    until(lambda: all(motor.current for motor in bank.bank.motors), lambda: driver.turn([0.0] * 3, [0.0] * 3))
    before = [motor.reeled for motor in bank.bank.motors]
    until(lambda: all(m.reeled > b for m, b in zip(bank.bank.motors, before, strict=True)),
          lambda: driver.turn([0.0] * 3, [0.0] * 3))  # fmt: skip
    assert driver.fault == ""
    driver.close()


def test_a_driver_that_stops_sending_leaves_no_current(joined):
    driver, bank = joined
    until(lambda: all(motor.current for motor in bank.bank.motors), lambda: driver.turn([0.0] * 3, [0.0] * 3))
    until(lambda: not any(motor.current for motor in bank.bank.motors))


def test_a_closed_driver_leaves_no_current(joined):
    driver, bank = joined
    until(lambda: all(motor.current for motor in bank.bank.motors), lambda: driver.turn([0.0] * 3, [0.0] * 3))
    driver._send(driver._off)
    until(lambda: not any(motor.current for motor in bank.bank.motors))


class BrokenBus:
    """A bus that gives nothing but errors, and takes frames but for those of the id `deaf`. `sent`: (id, data)."""

    def __init__(self, hears=False, deaf=None):
        self._hears, self._deaf, self.sent = hears, deaf, []

    def set_filters(self, filters):
        pass

    def recv(self, timeout):
        if not self._hears:
            raise can.CanOperationError("gone")

    def send(self, message):
        if message.arbitration_id == self._deaf:
            raise can.CanOperationError("full")
        self.sent.append((message.arbitration_id, bytes(message.data)))


def test_a_bus_that_gives_nothing_but_errors_is_still_told_no_current():
    bus = BrokenBus()
    driver = BusMotors(motor_settings(), bus)
    for turn in range(1, 4):
        driver.turn([0.01] * 3, [0.0] * 3)
        assert bus.sent == [(0x1FE, bytes(8))] * turn
    assert driver.fault == "bus: gone"


def test_where_one_frame_is_not_taken_the_other_still_is():
    bus = BrokenBus(hears=True, deaf=0x1FE)
    driver = BusMotors(replace(motor_settings(), numbers=(1, 5, 6)), bus)
    driver.turn([0.01] * 3, [0.0] * 3)
    assert driver.fault == "bus: full"
    assert bus.sent == [(0x2FE, bytes(8))]


def test_a_bus_that_is_not_there_is_one_line():
    with pytest.raises(InputError, match=r"^bus nowhere0: found no socketcan bus that opens"):
        open_bus("socketcan", "nowhere0")
