"""A limb seen from the machine's process, before an adapter that is a test, on a clock that it turns: what is a fault
of it, from both sides of each border, and what is none."""

import os
import socket
import subprocess
from contextlib import suppress

import numpy as np
import pytest

from trunkline.ar.drivers import driver_client
from trunkline.ar.drivers.driver import CONNECTING
from trunkline.ar.drivers.driver_client import CLOSING, DRIVER_TIMEOUT, DriverClient, panda
from trunkline.ar.drivers.driver_frames import DriverState, FrameSocket, Setpoint
from trunkline.ar.drivers.local_driver_process import STARTING, start_driver
from trunkline.ar.drivers.motors import HOMING, MotorsOnBus
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.pipeline.config import PROJECT, load_folder

SETTINGS = load_folder(ExecutionConfig, PROJECT / "conf/execution")
NEAR, BEGUN, PATIENCE, ASTRAY = 1e-6, 100.0, 5.0, 0.05
READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])


class Process:
    """An adapter as `subprocess` has it. `line`: its end of the socket. `ends`: whether it does as nobody is there."""

    def __init__(self, command, pass_fds, **how):
        self.command, self.how, self.ends, self.waited, self.killed = command, how, True, [], False
        self.socket = socket.socket(fileno=os.dup(pass_fds[0]))
        self.line = FrameSocket(self.socket, Setpoint.size(7))

    def wait(self, seconds=None):
        self.waited.append(seconds)
        if not self.ends and not self.killed:
            raise subprocess.TimeoutExpired("adapter", seconds)
        return 0

    def kill(self):
        self.killed = True

    def tell(self, time, measured=READY, sent=READY, fault=""):
        self.socket.sendall(DriverState(time, tuple(measured), tuple(sent), fault).pack())


@pytest.fixture
def clock(monkeypatch):
    monkeypatch.setattr(driver_client.subprocess, "Popen", Process)
    monkeypatch.setattr(driver_client.time, "monotonic", lambda: BEGUN)


@pytest.fixture
def driver(clock):
    client = DriverClient(["adapter"], 7, PATIENCE, ASTRAY, ", expected it here")
    yield client
    client.close()
    client.process.socket.close()


@pytest.fixture
def ready(driver):
    driver.process.tell(BEGUN)
    driver.turn(BEGUN)
    assert driver.ready
    assert driver.fault == ""
    return driver


def test_a_driver_process_that_tells_of_itself_is_no_fault_however_long(ready):
    for now in np.arange(BEGUN, BEGUN + 100.0, 0.5 * DRIVER_TIMEOUT):
        ready.process.tell(now)
        ready.turn(now)
    assert ready.fault == ""
    np.testing.assert_array_equal(ready.measured, READY)
    np.testing.assert_array_equal(ready.sent, READY)


@pytest.mark.parametrize(
    ("silent", "fault"),
    [(0.0, ""), (DRIVER_TIMEOUT - NEAR, ""), (DRIVER_TIMEOUT + NEAR, "its adapter is silent for 100 ms"),
     (10.0, "its adapter is silent for 10000 ms")],
)  # fmt: skip
def test_a_driver_process_that_is_silent_is_a_fault_after_so_long(ready, silent, fault):
    ready.turn(BEGUN + silent)
    assert ready.fault == fault


def test_what_it_told_long_ago_does_not_count_as_told_when_it_is_heard(ready):
    ready.process.tell(BEGUN + 1.0)
    ready.turn(BEGUN + 1.0 + DRIVER_TIMEOUT + NEAR)
    assert ready.fault == "its adapter is silent for 100 ms"


@pytest.mark.parametrize(
    ("late", "fault"),
    [(0.0, ""), (PATIENCE - NEAR, ""), (PATIENCE + NEAR, "its adapter is not ready after 5 s, expected it here")],
)  # fmt: skip
def test_a_driver_process_has_to_be_ready_within_its_time(driver, late, fault):
    driver.turn(BEGUN + late)
    assert not driver.ready
    assert driver.fault == fault
    assert np.isnan(driver.measured).all()


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("joint", range(7))
def test_a_joint_far_from_where_it_is_sent_is_a_fault(driver, joint, sign):
    off = sign * np.eye(7)[joint]
    driver.process.tell(BEGUN, READY + (ASTRAY - NEAR) * off)
    driver.turn(BEGUN)
    assert driver.fault == ""
    driver.process.tell(BEGUN, READY + (ASTRAY + NEAR) * off)
    driver.turn(BEGUN)
    assert driver.fault == f"joint {joint + 1}: found 0.05 rad from where it is sent, expected at most 0.05"


def test_a_joint_is_looked_at_in_every_frame_though_a_later_one_is_well(ready):
    ready.process.tell(BEGUN, READY + 2 * ASTRAY * np.eye(7)[0])
    ready.process.tell(BEGUN)
    ready.turn(BEGUN)
    assert ready.fault.startswith("joint 1: found 0.1 rad from where it is sent")


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_joint_that_is_nowhere_is_a_fault(driver, value, joint):
    driver.process.tell(BEGUN, np.where(np.arange(7) == joint, value, READY))
    driver.turn(BEGUN)
    assert driver.fault.startswith(f"joint {joint + 1}: found ")


@pytest.mark.parametrize("fault", ["", "reflex: too fast"])
def test_where_it_was_last_is_known_also_of_a_driver_process_with_a_fault(ready, fault):
    ready.process.tell(BEGUN, READY + 0.01, READY + 0.01, fault)
    ready.turn(BEGUN)
    assert ready.measured.tolist() == (READY + 0.01).tolist()
    assert ready.fault == fault


def test_a_driver_process_that_fails_before_it_is_ready_never_is(driver):
    driver.process.tell(BEGUN, fault="no robot")
    driver.turn(BEGUN)
    assert driver.fault == "no robot"
    assert not driver.ready


def test_a_driver_process_that_ends_is_a_fault_and_why_it_did_comes_first(clock):
    for fault, expected in (("", "its adapter has ended"), ("no robot", "no robot")):
        driver = DriverClient(["adapter"], 7)
        driver.process.tell(BEGUN, fault=fault)
        driver.process.socket.close()
        driver.turn(BEGUN)
        assert driver.fault == expected
        driver.close()


def test_a_fault_lasts_and_is_the_first(ready):
    ready.process.tell(BEGUN, fault="reflex")
    ready.turn(BEGUN)
    ready.turn(BEGUN + 1.0)
    ready.process.tell(BEGUN + 1.0, READY + 1.0)
    ready.turn(BEGUN + 1.0)
    ready.process.tell(BEGUN + 1.0)
    ready.turn(BEGUN + 1.0)
    assert ready.fault == "reflex"


def test_what_is_sent_comes_to_the_driver_process(ready):
    for number in range(3):
        ready.send(BEGUN + 0.001 * number, READY + number)
    setpoints = [Setpoint.unpack(frame) for frame in ready.process.line.received()]
    assert setpoints == [Setpoint(BEGUN + 0.001 * number, tuple(READY + number)) for number in range(3)]


def test_a_driver_process_that_takes_no_setpoints_is_a_fault_unless_it_has_told_one(clock):
    for reason, expected in (("", "its adapter has ended"), ("reflex", "reflex")):
        driver = DriverClient(["adapter"], 7)
        driver.process.tell(BEGUN, fault=reason)
        driver.process.socket.close()
        driver.send(BEGUN, READY)
        assert driver.fault == expected
        driver.close()
    full = DriverClient(["adapter"], 7)
    while not full.fault:
        full.send(BEGUN, READY)
    assert full.fault.startswith("its adapter takes no setpoints (")
    full.close()


@pytest.mark.parametrize("ends", [True, False])
def test_a_driver_process_that_does_not_end_is_killed_after_a_while(clock, ends):
    driver = DriverClient(["adapter"], 7)
    driver.process.ends = ends
    driver.close()
    driver.process.line.received()
    assert not driver.process.line.open
    assert driver.process.waited[0] == CLOSING
    assert driver.process.killed == (not ends)
    assert len(driver.process.waited) == (1 if ends else 2)  # none is left behind that has ended


def test_nobody_else_has_the_driver_process_end(driver):
    """Or its end would not show, as long as somebody still has it."""
    number, adapters = int(driver.process.command[-1]), os.fstat(driver.process.socket.fileno())
    with suppress(OSError):  # it is closed
        assert os.fstat(number).st_ino != adapters.st_ino


def test_ctrl_c_is_for_whoever_sends_and_not_for_the_driver_process(driver):
    assert driver.process.how["start_new_session"] is True
    assert driver.process.how["stdin"] == subprocess.DEVNULL


def test_a_robots_joint_may_be_as_far_off_as_the_settings_say(clock):
    """A Panda's: 0.05 rad."""
    assert SETTINGS.panda.astray == ASTRAY
    for off, fault in ((ASTRAY - NEAR, ""), (ASTRAY + NEAR, "joint 4: found 0.05 rad from where it is sent, ")):
        driver = panda(SETTINGS.panda, "panda")
        assert driver.process.command[1:5] == [
            "-m",
            "trunkline.ar.drivers.panda_process",
            "panda",
            SETTINGS.panda.address,
        ]
        driver.process.tell(BEGUN, READY + off * np.eye(7)[3])
        driver.turn(BEGUN)
        assert driver.fault.startswith(fault)
        assert bool(driver.fault) == bool(fault)
        driver.close()


@pytest.mark.parametrize(
    ("driver_of", "patience"),
    [(lambda: panda(SETTINGS.panda, "fr3"), CONNECTING),
     (lambda: start_driver(MotorsOnBus(SETTINGS.motors, "can0", "socketcan")), HOMING + STARTING),
     (lambda: start_driver(SETTINGS.ros), CONNECTING + STARTING)],
)  # fmt: skip
def test_how_long_each_driver_is_waited_for(clock, driver_of, patience):
    """Motors have to be homed until then, a robot has to be there."""
    driver = driver_of()
    driver.turn(BEGUN + patience - NEAR)
    assert driver.fault == ""
    driver.turn(BEGUN + patience + NEAR)
    assert driver.fault.startswith(f"its adapter is not ready after {patience:.0f} s")
    driver.close()
