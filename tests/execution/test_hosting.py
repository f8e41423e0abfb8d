"""Motors behind their adapter, in real time; margins are wide, as machines are busy."""

import os
import signal
import socket
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest

from tests.support import waiting
from tests.support.motors import motor_settings
from trunkline.execution import hosting
from trunkline.execution.bank import SIMULATED
from trunkline.execution.hosting import hosted
from trunkline.execution.limb_frames import Line
from trunkline.execution.motors import MotorsOnBus

LEAD = 0.03  # s

until = partial(waiting.until, seconds=30.0)

@pytest.fixture
def limb():
    found = hosted(MotorsOnBus(motor_settings(), SIMULATED, "virtual"))
    until(lambda: found.ready or found.fault, lambda: found.turn(time.monotonic()))
    yield found
    found.close()


def test_in_a_process_of_their_own_they_home_and_follow(limb):
    if limb.fault:
        pytest.skip(f"this machine is too busy: {limb.fault}")
    np.testing.assert_allclose(limb.measured, 0.0, atol=2e-3)

    def each():
        limb.send(time.monotonic() + LEAD, np.full(3, 0.001))
        limb.turn(time.monotonic())

    until(lambda: limb.fault or limb.sent.min() > 0.0009, each)
    assert limb.fault == "" or "silent" in limb.fault or "no setpoint" in limb.fault


def test_their_process_killed_is_a_fault(limb):
    limb.process.kill()
    until(lambda: limb.fault, lambda: limb.turn(time.monotonic()))
    assert limb.fault == "its adapter has ended" or "silent" in limb.fault


def test_their_process_hanging_is_a_fault(limb):
    os.kill(limb.process.pid, signal.SIGSTOP)
    until(lambda: limb.fault, lambda: limb.turn(time.monotonic()))
    os.kill(limb.process.pid, signal.SIGCONT)
    assert "silent for" in limb.fault


def test_it_ends_once_nobody_speaks_to_it(limb):
    limb.line.close()
    assert limb.process.wait(waiting.SOON) == 0


def test_a_bus_that_is_not_there_is_one_line():
    found = hosted(MotorsOnBus(motor_settings(), "nowhere0", "socketcan"))
    until(lambda: found.fault, lambda: found.turn(time.monotonic()))
    assert found.fault.startswith("bus nowhere0: found no socketcan bus that opens")
    found.close()


def test_a_robot_alone_needs_no_library_of_motors():
    code = "import sys; sys.modules['can'] = None; import trunkline.live.real, trunkline.execution.hosting"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_a_library_that_is_not_there_is_one_line():
    program = ("-c", "import sys; sys.modules['can'] = None; from trunkline.execution import hosting; "
               "sys.exit(hosting.main(sys.argv[1:]))")  # fmt: skip
    found = hosted(MotorsOnBus(motor_settings(), "can0", "socketcan"), program)
    until(lambda: found.fault, lambda: found.turn(time.monotonic()))
    assert found.fault == "found no library can, expected the extra motors to be installed"
    found.close()


class Failing:
    """A limb that fails at its first turn. `done`: what was done, in order."""

    def __init__(self, done):
        self._done = done

    def turn(self, now):
        raise RuntimeError("no more")

    def close(self):
        self._done.append("given back")


def test_a_limb_that_fails_is_given_back_before_anything_waits(monkeypatch):
    ours, theirs = socket.socketpair()
    done, settings = [], MotorsOnBus(motor_settings(), SIMULATED, "virtual")
    monkeypatch.setattr(hosting, "limb_of", lambda settings: Failing(done))
    monkeypatch.setattr(hosting, "be_urgent", lambda: None)
    monkeypatch.setattr(hosting.signal, "signal", lambda *_: None)
    monkeypatch.setattr(Line, "end", lambda line, told: done.append(told.fault))
    assert hosting.main([hosting.HOSTED.dump_json(settings).decode(), str(theirs.detach())]) == 1
    assert done == ["given back", "RuntimeError: no more"]
    ours.close()


def test_it_is_not_ended_by_a_signal_as_long_as_somebody_is_there(limb):
    os.kill(limb.process.pid, signal.SIGTERM)
    limb.fault, before = "", limb.told.time
    until(lambda: limb.told.time > before + 0.5, lambda: limb.turn(time.monotonic()))
    assert limb.process.poll() is None
