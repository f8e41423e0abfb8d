"""Motors behind their adapter: on a clock that a test turns, and as a process, alone."""

import os
import signal
import socket
import subprocess
import sys
import time
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from tests.support import waiting
from tests.support.motors import PlayedMotors, Workbench, homed, motor_settings
from trunkline.ar.drivers import driver_client, local_driver_process
from trunkline.ar.drivers.driver import TICK
from trunkline.ar.drivers.driver_client import DRIVER_TIMEOUT
from trunkline.ar.drivers.driver_frames import FrameSocket, Setpoint
from trunkline.ar.drivers.local_driver_process import SETTLES, run_driver, start_driver
from trunkline.ar.drivers.motors import MotorsOnBus
from trunkline.ar.drivers.panda_process import TELL
from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.drivers.tendon_driver import TendonDriver

LEAD, NEAR = 0.03, 1e-6  # s

until = partial(waiting.until, seconds=30.0)


class Ended(Exception):
    """The adapter's process, by `kill -9`."""


class Played:
    """An adapter and the machine's process at both ends of a socket, on one clock. Whenever the adapter waits for its
    next turn the machine's process has its own: `each(now)`. `limb`: what the adapter turns, `seen`: what the machine
    has of it. `turns`: whether the adapter does."""

    def __init__(self, monkeypatch, bench):
        self.bench, self.motors, self.each = bench, PlayedMotors(bench), lambda now: None
        clock = SimpleNamespace(monotonic=lambda: self.bench.now, sleep=self._sleep)
        monkeypatch.setattr(local_driver_process, "time", clock)
        monkeypatch.setattr(driver_client, "time", SimpleNamespace(monotonic=lambda: self.bench.now))
        monkeypatch.setattr(driver_client.subprocess, "Popen", self._popen)
        self.driver = TendonDriver(self.motors, bench.now)
        self.client = start_driver(MotorsOnBus(motor_settings(), "can0", "socketcan"))

    def _popen(self, command, pass_fds, **how):
        self.theirs = socket.socket(fileno=os.dup(pass_fds[0]))
        self.line = FrameSocket(self.theirs, Setpoint.size(3))
        return SimpleNamespace(wait=lambda seconds=None: 0)

    def _sleep(self, seconds):
        """In steps of a ms, that the motors and the machine's process have too."""
        end = self.bench.now + seconds
        while self.bench.now < end - NEAR:
            self.bench.now += TICK
            for frame in self.bench.simulated.advance(self.bench.now):
                self.bench.hear(frame)
            self.bench.drive(*self.motors.wanted, self.bench.now)
            self.each(self.bench.now)

    def play(self, each=lambda now: None, seconds=60.0):
        """Until the adapter ends, or so long."""
        begun = self.bench.now

        def both(now):
            if now - begun > seconds:
                raise Ended
            each(now)
            self.client.turn(now)

        self.each = both
        try:
            run_driver(self.driver, self.line)
        except Ended:
            return self
        raise AssertionError("it has ended by itself")

    def send(self, way):
        """What the machine's process does: all cables along `way(t)`, m, from now on."""
        begun = self.bench.now
        return lambda now: self.client.send(now + LEAD, np.full(3, way(now - begun)))


@pytest.fixture
def played(monkeypatch):
    """Motors that are homed."""
    made = Played(monkeypatch, homed())
    yield made
    made.theirs.close()
    made.client.line.close()


def test_they_are_homed_and_follow_what_is_sent(monkeypatch):
    made = Played(monkeypatch, Workbench())
    made.play(seconds=0.1)
    assert not made.client.ready
    made.play(lambda now: made.client.ready and _end(), 20.0)
    assert made.client.fault == ""
    made.bench.zeros = np.array([motor.reeled for motor in made.bench.simulated.motors]) - made.bench.motors.pulls
    made.play(made.send(lambda t: 0.02 * min(t, 1.0)), 1.2)
    assert made.client.fault == ""
    np.testing.assert_allclose(made.client.sent, 0.02, atol=1e-6)
    np.testing.assert_allclose(made.client.measured, 0.02, atol=1e-3)
    np.testing.assert_allclose(made.bench.pulls, 0.02, atol=1e-3)
    made.theirs.close()
    made.client.line.close()


def _end():
    raise Ended


def test_motors_that_cannot_be_homed_are_a_fault_of_the_driver(monkeypatch):
    bench = Workbench()
    bench.simulated.motors[1].silent = True
    made = Played(monkeypatch, bench).play(seconds=2.0)
    assert made.client.fault == "motor 2: found no feedback, expected it under the id 0x206"
    assert not made.client.ready
    made.theirs.close()


def test_a_fault_is_told_at_once(played):
    """Not with the next of the frames that tell of a limb that is well."""
    played.play(played.send(lambda t: 0.0), 0.1)
    played.bench.simulated.motors[0].silent = True
    began, states = played.bench.now, []
    played.play(lambda now: states.append(now) if played.client.fault and not states else None, 0.1)
    assert played.client.fault.startswith("motor 1: silent for 2")
    assert states[0] - began < 0.02 + 4 * TICK
    played.play(seconds=0.01)
    assert played.bench.currents == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("late", "fault"), [(DRIVER_TIMEOUT - 2 * TELL * TICK, ""), (DRIVER_TIMEOUT, "its adapter is silent for")]
)
def test_a_driver_process_that_hangs_is_a_fault_after_a_while(played, late, fault):
    played.play(played.send(lambda t: 0.0), 0.1)
    assert played.client.fault == ""
    played.client.turn(played.bench.now + late)
    assert played.client.fault.startswith(fault)
    assert bool(played.client.fault) == bool(fault)


def test_it_holds_the_cables_for_a_while_once_nobody_is_there_and_then_gives_them_back(played):
    played.play(played.send(lambda t: 0.01 * min(5 * t, 1.0)), 0.5)
    began, driven = played.bench.now, []
    played.client.line.close()
    played.each = lambda now: driven.append(min(np.abs(played.bench.currents)))
    run_driver(played.driver, played.line)
    assert played.bench.now - began == pytest.approx(SETTLES, abs=2 * TICK)
    assert min(driven) > 0.05


def test_a_driver_process_that_is_late_tells_of_its_driver_and_goes_on(played):
    """By less than a setpoint may be missed; turns are not made up for without end."""
    played.play(played.send(lambda t: 0.0), 0.2)
    turns, turn = [], played.driver.turn
    played.driver.turn = lambda now: (turns.append(now), turn(now))
    send = played.send(lambda t: 0.0)
    played.bench.now += 0.04
    played.play(send, 0.1)
    assert played.client.fault == ""
    assert len(turns) <= round((0.1 + local_driver_process.LATE) / TICK) + 2


# --- as a process


@pytest.fixture
def driver():
    client = start_driver(MotorsOnBus(motor_settings(), SIMULATED, "virtual"))
    until(lambda: client.ready or client.fault, lambda: client.turn(time.monotonic()))
    assert client.fault == ""
    yield client
    client.close()


@pytest.mark.realtime
def test_in_a_process_of_their_own_they_home_and_follow(driver):
    np.testing.assert_allclose(driver.measured, 0.0, atol=2e-3)

    def each():
        driver.send(time.monotonic() + LEAD, np.full(3, 0.001))
        driver.turn(time.monotonic())

    until(lambda: driver.fault or driver.sent.min() > 0.0009, each)
    assert driver.fault == ""


@pytest.mark.realtime
def test_their_process_killed_is_a_fault(driver):
    driver.process.kill()
    driver.process.wait(waiting.SOON)
    driver.turn(time.monotonic())
    assert driver.fault == "its adapter has ended"


@pytest.mark.realtime
def test_their_process_hanging_is_a_fault(driver):
    os.kill(driver.process.pid, signal.SIGSTOP)
    stopped = time.monotonic()
    until(lambda: driver.fault, lambda: driver.turn(time.monotonic()))
    os.kill(driver.process.pid, signal.SIGCONT)
    assert driver.fault.startswith("its adapter is silent for")
    assert time.monotonic() - stopped > DRIVER_TIMEOUT - TELL * TICK


@pytest.mark.realtime
def test_it_ends_once_nobody_speaks_to_it(driver):
    driver.line.close()
    assert driver.process.wait(waiting.SOON) == 0


def test_a_bus_that_is_not_there_is_one_line():
    client = start_driver(MotorsOnBus(motor_settings(), "nowhere0", "socketcan"))
    until(lambda: client.fault, lambda: client.turn(time.monotonic()))
    assert client.fault.startswith("bus nowhere0: found no socketcan bus that opens")
    client.close()


def test_a_robot_alone_needs_no_library_of_motors():
    modules = "trunkline.ar.session.hardware_process, trunkline.ar.drivers.local_driver_process"
    code = f"import sys; sys.modules['can'] = None; import {modules}"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)  # of a busy machine


def test_a_library_that_is_not_there_is_one_line():
    program = ("-c", "import sys; sys.modules['can'] = None; from trunkline.ar.drivers import local_driver_process; "
               "sys.exit(local_driver_process.main(sys.argv[1:]))")  # fmt: skip
    client = start_driver(MotorsOnBus(motor_settings(), "can0", "socketcan"), program)
    until(lambda: client.fault, lambda: client.turn(time.monotonic()))
    assert client.fault == "found no library can, expected the extra motors to be installed"
    client.close()


class Failing:
    """A limb that fails at its first turn. `done`: what was done, in order."""

    def __init__(self, done):
        self._done = done

    def turn(self, now):
        raise RuntimeError("no more")

    def close(self):
        self._done.append("given back")


def test_a_driver_that_fails_is_given_back_before_anything_waits(monkeypatch):
    ours, theirs = socket.socketpair()
    done, settings = [], MotorsOnBus(motor_settings(), SIMULATED, "virtual")
    monkeypatch.setattr(local_driver_process, "driver_of", lambda settings: Failing(done))
    monkeypatch.setattr(local_driver_process, "raise_priority", lambda: None)
    monkeypatch.setattr(local_driver_process.signal, "signal", lambda *_: None)
    monkeypatch.setattr(FrameSocket, "end", lambda line, state: done.append(state.fault))
    arguments = [local_driver_process.DRIVER_SETTINGS.dump_json(settings).decode(), str(theirs.detach())]
    assert local_driver_process.main(arguments) == 1
    assert done == ["given back", "RuntimeError: no more"]
    ours.close()


@pytest.mark.realtime
def test_it_is_not_ended_by_a_signal_as_long_as_somebody_is_there(driver):
    os.kill(driver.process.pid, signal.SIGTERM)
    before = driver.state.time
    until(lambda: driver.state.time > before + 0.5, lambda: driver.turn(time.monotonic()))
    assert driver.process.poll() is None
    assert driver.fault == ""
