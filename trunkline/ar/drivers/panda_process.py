"""The Panda's driver process, in the environment of the robot's own library. It speaks to nothing but the robot and,
over a socket, the process that started it.

    python -m trunkline.ar.drivers.panda_process ROBOT ADDRESS DESCRIPTOR

ROBOT: `panda` (panda-python, libfranka 0.9), `fr3` (pylibfranka) or `fake`, which is no robot. DESCRIPTOR: of the
socket. `trunkline.ar.drivers.driver_client` starts it; by hand it is of no use.
"""

import importlib
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from trunkline.ar.drivers.driver_frames import DriverState, FrameSocket, Setpoint
from trunkline.ar.drivers.realtime_priority import raise_priority
from trunkline.ar.drivers.setpoint_filter import LIMITS, SetpointFilter

TELL = 5  # cycles from one frame told to the next
AXES = len(LIMITS["panda"].velocity)
CUTOFF = 100.0  # Hz, of the filter that libfranka 0.9 has by default

Joints = Sequence[float]
Cycle = Callable[[Joints, Joints, float, tuple[Joints, Joints] | None], tuple[list[float], bool]]


class Device(Protocol):
    """A robot under control: `cycle(measured, desired, dt, rates)` gives what it is sent, rad, and whether that is all.

    `desired` is where the robot's own motion generator is, rad; `rates` its speed and acceleration, rad/s and rad/s²,
    None where the robot's library itself evens out what lost commands leave.
    """

    def control(self, cycle: Cycle) -> None: ...


class PandaPython:
    """The Panda by panda-python. Not tried on a robot: no simulator speaks its protocol."""

    def __init__(self, address: str) -> None:
        self._library = importlib.import_module("panda_py.libfranka")  # of the other environment
        self._robot = self._library.Robot(address, self._library.RealtimeConfig.kIgnore)

    def control(self, cycle: Cycle) -> None:
        library = self._library

        def step(state, duration):
            joints, ended = cycle(state.q, state.q_d, duration.to_sec(), None)  # its rate limiter is on
            command = library.JointPositions(joints)
            command.motion_finished = ended
            return command

        self._robot.control_joint_position(step, library.ControllerMode.kJointImpedance, True, CUTOFF)


class PyLibfranka:
    """The FR3 by pylibfranka."""

    def __init__(self, address: str) -> None:
        self._library = importlib.import_module("pylibfranka")  # of the other environment
        self._robot = self._library.Robot(address, self._library.RealtimeConfig.kIgnore)

    def control(self, cycle: Cycle) -> None:
        control, ended = self._robot.start_joint_position_control(self._library.ControllerMode.JointImpedance), False
        while not ended:
            state, duration = control.readOnce()
            joints, ended = cycle(state.q, state.q_d, duration.to_sec(), (state.dq_d, state.ddq_d))
            command = self._library.JointPositions(joints)
            command.motion_finished = ended
            control.writeOnce(command)


class FakeDevice:
    """No robot: joints that go where they are sent within LAG s, 1000 times a second of this machine's time."""

    LAG, READY = 0.005, (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)  # s, rad

    def __init__(self, address: str) -> None:
        self.joints = list(self.READY)

    def control(self, cycle: Cycle) -> None:
        sent, ended, due = list(self.joints), False, time.monotonic()
        while not ended:
            sent, ended = cycle(self.joints, sent, 0.001, None)
            self.joints = [q + 0.001 / self.LAG * (s - q) for q, s in zip(self.joints, sent, strict=True)]
            due = max(due + 0.001, time.monotonic() - 0.02)
            time.sleep(max(due - time.monotonic(), 0.0))


DEVICES = {"panda": PandaPython, "fr3": PyLibfranka, "fake": FakeDevice}


class PandaProcess:
    """Between the socket and the device."""

    def __init__(self, robot: str, channel: socket.socket) -> None:
        self._limits, self._line = (
            LIMITS["fr3" if robot == "fr3" else "panda"],
            FrameSocket(channel, Setpoint.size(AXES)),
        )
        self._stream, self._count = None, 0

    def cycle(
        self, measured: Joints, desired: Joints, dt: float, rates: tuple[Joints, Joints] | None
    ) -> tuple[list[float], bool]:
        """One cycle of the robot; it ends once the other side is gone and the joints are at rest."""
        if self._stream is None:
            self._stream = SetpointFilter(desired, self._limits)
        now, stream = time.monotonic(), self._stream
        if rates is not None:
            stream.synchronize(desired, *rates)
        for frame in self._line.received():
            stream.hear(Setpoint.unpack(frame), now)
        if not self._line.open:
            stream.brake("the machine's process is gone")
        sent = stream.cycle(now, dt).tolist()
        if self._count % TELL == 0:
            self._line.tell(DriverState(now, tuple(measured), tuple(sent), stream.fault))
        self._count += 1
        return sent, stream.resting and not self._line.open

    def fail(self, fault: str) -> None:
        """The robot has ended control."""
        sent = tuple(self._stream.joints) if self._stream is not None else (0.0,) * AXES
        self._line.end(DriverState(time.monotonic(), sent, sent, fault))


def main(arguments: list[str]) -> int:
    robot, address, descriptor = arguments
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it ends once nobody is at the other end, and the joints rest
    with socket.socket(fileno=int(descriptor)) as channel:
        adapter = PandaProcess(robot, channel)
        try:
            device = DEVICES[robot](address)
            raise_priority()
            device.control(adapter.cycle)
        except Exception as error:  # whatever the robot's library raises is the fault that is told
            adapter.fail(" ".join(f"{type(error).__name__}: {error}".split()))
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
