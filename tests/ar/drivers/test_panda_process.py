"""The adapter, before a robot that is none: on a clock that a test turns, and as a process, alone."""

import ast
import re
import socket
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.waiting import SOON, until
from trunkline.ar.drivers import panda_process
from trunkline.ar.drivers.driver_client import PandaSettings, panda
from trunkline.ar.drivers.driver_frames import DriverState, FrameSocket, Setpoint
from trunkline.ar.drivers.setpoint_filter import LIMITS
from trunkline.errors import InputError

SETTINGS = PandaSettings(python="", address="nowhere", astray=0.1)
ROOT = Path(__file__).parents[3]
DT, LEAD, READY = 0.001, 0.03, panda_process.FakeDevice.READY


class Played:
    """An adapter and whoever started it at both ends of a socket, on one clock. The robot is where it is sent."""

    def __init__(self, monkeypatch, robot="panda"):
        ours, theirs = socket.socketpair()
        self.line, self.theirs, self.now, self.states = FrameSocket(ours, DriverState.size(7)), theirs, 100.0, []
        monkeypatch.setattr(panda_process, "time", SimpleNamespace(monotonic=lambda: self.now))
        self.adapter, self.joints, self.ended = panda_process.PandaProcess(robot, theirs), list(READY), False

    def play(self, seconds, way=None):
        """Sent `way(t)`, (7,), rad, LEAD s ahead; nothing without it."""
        begun = self.now
        for _ in range(round(seconds / DT)):
            self.now += DT
            if way is not None:
                self.line.send(Setpoint(self.now + LEAD, tuple(way(self.now - begun))).pack())
            self.joints, self.ended = self.adapter.cycle(self.joints, self.joints, DT, None)
            if self.line.open:
                self.states += [DriverState.unpack(frame) for frame in self.line.received()]
            if self.ended:
                break
        return self

    @property
    def fault(self):
        return self.states[-1].fault


@pytest.fixture
def played(monkeypatch):
    made = Played(monkeypatch)
    yield made
    made.line.close()
    made.theirs.close()


def turning(time):
    return np.array(READY) + 0.2 * min(time, 1.0) ** 2 * np.eye(7)[0]


def test_it_plays_what_it_is_sent_and_tells_of_the_robot_as_often_as_it_should(played):
    played.play(0.5, turning)
    assert played.fault == ""
    np.testing.assert_allclose(played.joints, turning(0.5 - LEAD), atol=1e-3)
    times = [state.time for state in played.states]
    np.testing.assert_allclose(np.diff(times), panda_process.TELL * DT)
    np.testing.assert_allclose(played.states[-1].sent, played.joints, atol=panda_process.TELL * DT)


def test_where_setpoints_end_it_brakes_and_says_so(played):
    played.play(0.5, turning).play(0.5)
    assert played.fault.startswith("setpoints have run out, the last came ")
    assert not played.ended
    rests = played.joints
    assert played.play(0.2, turning).joints == rests
    assert played.fault.startswith("setpoints have run out, the last came ")


def test_what_starts_elsewhere_moves_nothing(played):
    played.play(0.2, lambda time: np.array(READY) + 0.1)
    assert played.fault.startswith("setpoint: starts 0.1 rad from where the robot is")
    assert played.joints == list(READY)


@pytest.mark.parametrize("moves", [True, False])
def test_once_nobody_is_there_it_brakes_and_gives_the_robot_back_at_rest(played, moves):
    played.play(0.5, turning if moves else None)
    before = np.array(played.joints)
    played.line.close()
    played.now += DT
    sent = [played.joints]
    while not played.ended:
        played.play(DT)
        sent.append(played.joints)
        assert len(sent) < 1000
    assert played.adapter._stream.fault == "the machine's process is gone"
    assert (len(sent) > 10) == moves
    assert np.abs(sent[-1] - before).max() < 0.05
    assert (np.abs(np.diff(sent, 2, axis=0)) / DT**2 <= 0.6 * LIMITS["panda"].acceleration).all()


def test_an_fr3_is_held_against_its_own_limits(monkeypatch):
    """Its fourth joint's range ends sooner than a Panda's."""
    for robot, fault in (("panda", ""), ("fr3", "setpoint: joint 4 leaves its range at -3.04")):
        made = Played(monkeypatch, robot)
        made.joints[3] = -3.03
        start = np.array(made.joints)
        made.play(1.2, lambda time, start=start: start - 0.01 * (1 - np.cos(np.pi * min(time, 1.0))) * np.eye(7)[3])
        assert made.fault.startswith(fault)
        assert bool(made.fault) == bool(fault)
        made.line.close()


def test_why_control_has_ended_is_told_last(played):
    played.play(0.1)
    played.adapter.fail("ControlException: reflex")
    (state,) = (DriverState.unpack(frame) for frame in played.line.received())
    assert state.fault == "ControlException: reflex"
    assert state.sent == tuple(played.joints)


# --- as a process


@pytest.fixture
def arm():
    client = panda(SETTINGS, "fake")
    until(lambda: client.ready or client.fault, lambda: client.turn(time.monotonic()))
    assert client.fault == ""
    yield client
    client.close()


@pytest.mark.realtime
def test_it_brakes_when_setpoints_end(arm):
    for ahead in (0.02, 0.04):
        arm.send(time.monotonic() + ahead, np.array(panda_process.FakeDevice.READY))
    until(lambda: arm.fault, lambda: arm.turn(time.monotonic()))
    assert arm.fault.startswith("setpoints have run out")


@pytest.mark.realtime
def test_it_gives_the_robot_back_once_nobody_speaks_to_it(arm):
    arm.line.close()
    assert arm.process.wait(SOON) == 0


def test_a_library_that_is_not_there_is_one_line():
    arm = panda(SETTINGS, "fr3")
    until(lambda: arm.fault, lambda: arm.turn(time.monotonic()))
    assert re.match(r"\w+Error: ", arm.fault)
    assert not arm.ready
    arm.close()


def test_a_python_that_is_not_there_is_one_line():
    with pytest.raises(InputError, match=r"^panda\.python: found /nowhere/python"):
        panda(PandaSettings("/nowhere/python", "nowhere", 0.1), "panda")


def test_it_imports_what_any_environment_has():
    modules_of_it = ("panda_process", "driver", "driver_frames", "setpoint_filter", "realtime_priority", "watchdog")
    for name in (*(f"drivers/{name}" for name in modules_of_it), "teleop/minimum_jerk"):
        tree = ast.parse((ROOT / f"trunkline/ar/{name}.py").read_text(encoding="utf-8"))
        modules = {node.module for node in tree.body if isinstance(node, ast.ImportFrom)}
        assert modules <= {
            "collections", "collections.abc", "dataclasses", "typing", "trunkline.ar.drivers.driver",
            "trunkline.ar.drivers.driver_frames", "trunkline.ar.drivers.setpoint_filter",
            "trunkline.ar.drivers.realtime_priority", "trunkline.ar.drivers.watchdog",
            "trunkline.ar.teleop.minimum_jerk",
            "trunkline.kinematics.panda.kinematics", "trunkline.kinematics.panda.limits",
        }  # fmt: skip
        plain = {alias.name for node in tree.body if isinstance(node, ast.Import) for alias in node.names}
        assert plain <= {"contextlib", "importlib", "math", "numpy", "os", "signal", "socket", "struct", "sys", "time"}


class Library:
    """What is asked of the robots' libraries, and no more."""

    class ControllerMode:
        kJointImpedance = JointImpedance = "joint impedance"

    class JointPositions:
        def __init__(self, q):
            self.q, self.motion_finished = q, False

    class State:
        q, q_d, dq_d, ddq_d = panda_process.FakeDevice.READY, panda_process.FakeDevice.READY, (0.0,) * 7, (0.5,) * 7

    class Duration:
        def to_sec(self):
            return 0.001


class Robot:
    def __init__(self):
        self.sent = []

    def control_joint_position(self, step, mode, limit_rate, cutoff):
        assert mode == "joint impedance"
        while not (self.sent and self.sent[-1].motion_finished):
            self.sent.append(step(Library.State(), Library.Duration()))

    def start_joint_position_control(self, mode):
        assert mode == "joint impedance"
        return self

    def readOnce(self):
        return Library.State(), Library.Duration()

    def writeOnce(self, command):
        self.sent.append(command)


@pytest.mark.parametrize(
    ("device", "rates"), [(panda_process.PandaPython, None), (panda_process.PyLibfranka, ((0.0,) * 7, (0.5,) * 7))]
)
def test_both_libraries_are_called_in_their_own_way(device, rates):
    made, counted = object.__new__(device), []
    made._library, made._robot = Library, Robot()

    def cycle(measured, desired, dt, rates):
        counted.append((measured, desired, dt, rates))
        return [0.1 * len(counted)] * 7, len(counted) == 3

    made.control(cycle)
    assert [command.motion_finished for command in made._robot.sent] == [False, False, True]
    assert made._robot.sent[1].q == [0.2] * 7
    assert counted[0] == (panda_process.FakeDevice.READY, panda_process.FakeDevice.READY, 0.001, rates)
