"""The Panda, seen from the machine's process: its adapter, started in an environment of its own."""

import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.execution.adapter_frames import TOLD, Frames, Setpoint, Told

ROOT = Path(__file__).parents[2]
CONNECTING = 20.0  # s
SILENT = 0.1  # s without a frame of the adapter
CLOSING = 3.0  # s


@dataclass(frozen=True)
class ArmSettings:
    """python: the Python of the environment with the robot's library, "" for this one. address: of the robot. astray:
    rad that a joint may be from where it is sent."""

    python: Annotated[str, Field(max_length=4096)]
    address: Annotated[str, Field(min_length=1, max_length=255)]
    astray: Annotated[float, Field(gt=0, le=0.5)]


class Arm:
    """A robot, "panda", "fr3" or "fake", under its adapter's control. None of its calls waits but `begin` and `close`.

    Attributes:
        told: the adapter's newest frame, None before the first. fault: what ended it, "" while it goes.
    """

    def __init__(self, settings: ArmSettings, robot: str) -> None:
        self._settings, self._frames, self.fault = settings, Frames(TOLD.size), ""
        self.told: Told | None = None
        self._socket, theirs = socket.socketpair()
        python, path = settings.python or sys.executable, os.environ.get("PYTHONPATH", "")
        command = [python, "-m", "trunkline.execution.adapter", robot, settings.address, str(theirs.fileno())]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), path)))}
        try:
            self._process = subprocess.Popen(
                command, pass_fds=[theirs.fileno()], env=environment, stdin=subprocess.DEVNULL
            )
        except OSError as error:
            raise InputError(f"panda.python: found {python} ({error.strerror}), expected a Python") from error
        finally:
            theirs.close()
        self._socket.setblocking(False)

    @property
    def joints(self) -> np.ndarray:
        """As they were sent last, (7,), rad."""
        assert self.told is not None
        return np.array(self.told.commanded)

    @property
    def measured(self) -> np.ndarray:
        """As they are, (7,), rad."""
        assert self.told is not None
        return np.array(self.told.measured)

    def begin(self) -> None:
        """Wait until the robot is under control.

        Raises:
            InputError: it is not.
        """
        end = time.monotonic() + CONNECTING
        while self.told is None and not self.fault:
            if time.monotonic() > end:
                self.fault = f"its adapter has no robot after {CONNECTING:.0f} s"
            time.sleep(0.01)
            self.turn(time.monotonic())
        if self.fault:
            raise InputError(f"robot {self._settings.address}: {self.fault}")

    def send(self, due: float, joints: np.ndarray) -> None:
        """Where the joints shall be at `due`, s: (7,), rad."""
        try:
            self._socket.send(Setpoint(due, tuple(joints.tolist())).pack())
        except OSError as error:
            self._hear()  # an adapter that has ended has told why
            self._fail(f"its adapter takes no setpoints ({error.strerror})")

    def turn(self, now: float) -> None:
        """Hear what the adapter tells, at `now`, s."""
        self._hear()
        if self.told is not None:
            if (silent := now - self.told.time) > SILENT:
                self._fail(f"its adapter is silent for {1e3 * silent:.0f} ms")
            off = np.abs(np.subtract(self.told.measured, self.told.commanded))
            if off.max() > self._settings.astray:
                joint = int(off.argmax())
                where = f"found {off[joint]:.3g} rad from where it is sent, expected at most {self._settings.astray:g}"
                self._fail(f"joint {joint + 1}: {where}")

    def close(self) -> None:
        """The adapter hears no more: it brakes, and gives the robot back."""
        self._socket.close()
        try:
            self._process.wait(CLOSING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _hear(self) -> None:
        while data := self._heard():
            for frame in self._frames.cut(data):
                self.told = Told.unpack(frame)
                if self.told.fault:
                    self._fail(self.told.fault)

    def _heard(self) -> bytes:
        """What has come, b"" where nothing has."""
        try:
            if data := self._socket.recv(1 << 16):
                return data
        except BlockingIOError:
            return b""
        except OSError:
            pass
        self._fail("its adapter has ended")
        return b""

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault
