"""A hardware driver in a process of its own, as the robot's process uses it.

The driver process is started with a socket, over which it sends its state every few ms and receives setpoints. Once the
other end is closed, it brings the hardware to rest and releases it.
"""

import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.ar.drivers.driver import CONNECTING
from trunkline.ar.drivers.driver_frames import DriverState, FrameSocket, Setpoint
from trunkline.ar.drivers.panda_process import AXES
from trunkline.errors import InputError

ROOT = Path(__file__).parents[3]
DRIVER_TIMEOUT = 0.1  # s without a frame of the driver process
CLOSING = 3.0  # s


@dataclass(frozen=True)
class PandaSettings:
    """python: the Python of the environment with the robot's library, "" for this one. address: of the robot. astray:
    rad that a joint may be from where it is sent."""

    python: Annotated[str, Field(max_length=4096)]
    address: Annotated[str, Field(min_length=1, max_length=255)]
    astray: Annotated[float, Field(gt=0, le=0.5)]


class DriverClient:
    """A `Driver` of so many `axes` whose process is this `command`, with the socket's descriptor as last argument.

    Attributes:
        state: newest frame of the driver process, None before the first.

    Raises:
        OSError: the command is not there.
    """

    state: DriverState | None

    def __init__(
        self, command: Sequence[str], axes: int, patience: float = CONNECTING, astray: float = math.inf, at: str = ""
    ) -> None:
        """patience: s within which the driver process has to be ready. astray: rad that a joint may be from where it
        is sent. at: added to the fault, where the hardware should be."""
        self._axes, self._astray, self._at, self.fault, self.state = axes, astray, at, "", None
        self._patience, self._until = patience, time.monotonic() + patience
        ours, theirs = socket.socketpair()
        self.line, path = FrameSocket(ours, DriverState.size(axes)), os.environ.get("PYTHONPATH", "")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), path)))}
        try:
            self.process = subprocess.Popen(
                [*command, str(theirs.fileno())], pass_fds=[theirs.fileno()], env=environment,
                stdin=subprocess.DEVNULL, start_new_session=True,  # Ctrl-C is for whoever sends
            )  # fmt: skip
        finally:
            theirs.close()

    @property
    def ready(self) -> bool:
        return self.state is not None

    @property
    def sent(self) -> np.ndarray:
        assert self.state is not None
        return np.array(self.state.sent)

    @property
    def measured(self) -> np.ndarray:
        return np.full(self._axes, np.nan) if self.state is None else np.array(self.state.measured)

    def send(self, due: float, axes: np.ndarray) -> None:
        try:
            self.line.send(Setpoint(due, tuple(axes.tolist())).pack())
        except OSError as error:
            self._hear()  # the last frame of a driver process that has ended has the reason
            self._fail(f"its adapter takes no setpoints ({error.strerror})")

    def turn(self, now: float) -> None:
        """Read the frames of the driver process, at `now`, s."""
        self._hear()
        if self.state is None:
            if now > self._until:
                self._fail(f"its adapter is not ready after {self._patience:.0f} s{self._at}")
            return
        if (silent := now - self.state.time) > DRIVER_TIMEOUT:
            self._fail(f"its adapter is silent for {1e3 * silent:.0f} ms")

    def close(self) -> None:
        """Close the socket: the driver process brings the hardware to rest and releases it."""
        self.line.close()
        try:
            self.process.wait(CLOSING)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _hear(self) -> None:
        for frame in self.line.received():
            state = DriverState.unpack(frame)
            if state.fault:
                self._fail(state.fault)
            if self.state is not None or not state.fault:
                self.state = state
                self._check(state)
        if not self.line.open:
            self._fail("its adapter has ended")

    def _check(self, state: DriverState) -> None:
        """Whether each joint is where it is sent."""
        off = np.abs(np.subtract(state.measured, state.sent))
        if not off.max() <= self._astray:  # or no number
            where = f"found {off.max():.3g} rad from where it is sent, expected at most {self._astray:g}"
            self._fail(f"joint {int(off.argmax()) + 1}: {where}")

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault


def panda(settings: PandaSettings, robot: str) -> DriverClient:
    """A robot, "panda", "fr3" or "fake".

    Raises:
        InputError: its Python is not there.
    """
    python = settings.python or sys.executable
    command = [python, "-m", "trunkline.ar.drivers.panda_process", robot, settings.address]
    try:
        return DriverClient(command, AXES, astray=settings.astray, at=f", expected {robot} at {settings.address}")
    except OSError as error:
        raise InputError(f"panda.python: found {python} ({error.strerror}), expected a Python") from error
