"""The adapter as a process, before a robot that is none; margins are wide, as machines are busy."""

import ast
import re
import time
from pathlib import Path

import numpy as np
import pytest

from tests.support.waiting import SOON, until
from trunkline.errors import InputError
from trunkline.execution import adapter
from trunkline.execution.adapted import ArmSettings, panda

SETTINGS = ArmSettings(python="", address="nowhere", astray=0.1)
ROOT = Path(__file__).parents[2]


@pytest.fixture
def arm():
    found = panda(SETTINGS, "fake")
    until(lambda: found.ready or found.fault, lambda: found.turn(time.monotonic()))
    yield found
    found.close()


def test_it_brakes_when_setpoints_end(arm):
    for ahead in (0.02, 0.04):
        arm.send(time.monotonic() + ahead, np.array(adapter.Fake.READY))
    until(lambda: arm.fault, lambda: arm.turn(time.monotonic()))
    assert arm.fault.startswith(("setpoints have run out", "heard no setpoint for ", "its adapter is silent"))


def test_it_refuses_what_starts_elsewhere(arm):
    arm.send(time.monotonic() + 0.03, np.array(adapter.Fake.READY) + 0.1)
    until(lambda: arm.fault, lambda: arm.turn(time.monotonic()))
    assert arm.fault.startswith(("setpoint: starts 0.1 rad from where the robot is", "its adapter is silent"))


def test_it_gives_the_robot_back_once_nobody_speaks_to_it(arm):
    arm.line.close()
    assert arm.process.wait(SOON) == 0


def test_an_adapter_that_is_killed_is_a_fault(arm):
    arm.process.kill()
    until(lambda: arm.fault, lambda: arm.turn(time.monotonic()))
    assert arm.fault == "its adapter has ended"


def test_a_library_that_is_not_there_is_one_line():
    arm = panda(SETTINGS, "fr3")
    until(lambda: arm.fault, lambda: arm.turn(time.monotonic()))
    assert re.match(r"\w+Error: ", arm.fault)
    assert not arm.ready
    arm.close()


def test_a_python_that_is_not_there_is_one_line():
    with pytest.raises(InputError, match=r"^arm\.python: found /nowhere/python"):
        panda(ArmSettings("/nowhere/python", "nowhere", 0.1), "panda")


def test_it_imports_what_any_environment_has():
    for name in ("adapter", "limb", "limb_frames", "stream", "urgency"):
        tree = ast.parse((ROOT / f"trunkline/execution/{name}.py").read_text(encoding="utf-8"))
        modules = {node.module for node in tree.body if isinstance(node, ast.ImportFrom)}
        assert modules <= {
            "collections", "collections.abc", "dataclasses", "typing", "trunkline.execution.limb",
            "trunkline.execution.limb_frames", "trunkline.execution.stream", "trunkline.execution.urgency",
            "trunkline.panda.kinematics", "trunkline.panda.limits",
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
        q, q_d, dq_d, ddq_d = adapter.Fake.READY, adapter.Fake.READY, (0.0,) * 7, (0.5,) * 7

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
    ("device", "rates"), [(adapter.PandaPython, None), (adapter.PyLibfranka, ((0.0,) * 7, (0.5,) * 7))]
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
    assert counted[0] == (adapter.Fake.READY, adapter.Fake.READY, 0.001, rates)
