"""Motors and bank on python-can's virtual bus, in real time; margins are wide, as machines are busy."""

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


def test_a_bus_that_is_not_there_is_one_line():
    with pytest.raises(InputError, match=r"^bus nowhere0: found no socketcan bus that opens"):
        open_bus("socketcan", "nowhere0")
