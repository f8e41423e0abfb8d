"""What the robot's own process notes of its motion, where its reader sees it, whoever else has ended."""

import ctypes
import os
import time
from multiprocessing.context import SpawnContext

import numpy as np

from trunkline.ar.drivers.driver_client import DriverClient
from trunkline.ar.drivers.local_driver_process import start_driver
from trunkline.ar.drivers.motors import MotorsOnBus
from trunkline.ar.session import hardware_process
from trunkline.ar.session.hardware import Hardware
from trunkline.ar.session.robot_process import HOLD_TIME, MODE, MODES, SERIAL, RobotChannel
from trunkline.ar.teleop.trajectory import JOINTS

LEAST = 1e-9  # rad or m between two tellings: it moves
HEAD = 5  # numbers that a robot tells before its axes


class Witness(ctypes.Structure):
    """Made by `context.RawValue`, so that processes share it. Each number is written whole, by one process; times are s
    of the clock that all processes of a machine share.

    The robot's: held, when it was first commanded to hold in its last motion, as it brakes it is so again and again;
    moved, when its axes, as they are sent, last moved; far, by how much a joint was off its first place at most, rad;
    begun, how many motions it began; running, whether one goes on; motors, the process of its motors, if it has some.
    last_hold, held_in: the last command to hold, and the motion in which the first one was.
    """

    _fields_ = (
        *((name, ctypes.c_double) for name in ("held", "moved", "far", "last_hold", "held_in")),
        ("begun", ctypes.c_int64),
        ("running", ctypes.c_bool),
        ("motors", ctypes.c_int64),
    )

    def signal_motors(self, number: int) -> None:
        """SIGUSR1: the first motor gives no feedback for `hushed.HUSH` s."""
        assert self.motors, "a session with motors"
        os.kill(self.motors, number)

    def note(self, numbers: np.ndarray, moved: bool, far: float) -> None:
        """Of the robot's process: what it tells the server."""
        if moved:
            self.moved = time.monotonic()
        self.far = max(self.far, far)
        if numbers[HOLD_TIME] != self.last_hold and numbers[SERIAL] != self.held_in:
            self.held, self.held_in = numbers[HOLD_TIME], numbers[SERIAL]
        self.last_hold, self.begun = numbers[HOLD_TIME], int(numbers[SERIAL])
        self.running = MODES[int(numbers[MODE])] == "running"


class Watched(RobotChannel):
    """A channel whose robot tells a `witness` too, if there is one."""

    def __init__(self, context: SpawnContext, tendons: int, bodies: int, witness: Witness | None) -> None:
        super().__init__(context, tendons, bodies)
        self.witness, self._axes = witness, np.zeros(JOINTS + tendons)
        self._first: np.ndarray | None = None

    def tell(self, numbers: np.ndarray, fault: str) -> None:
        super().tell(numbers, fault)
        if self.witness is None:
            return
        axes = numbers[HEAD : HEAD + JOINTS + self.tendons]
        self._first = axes[:JOINTS].copy() if self._first is None else self._first
        far = float(np.abs(axes[:JOINTS] - self._first).max())
        self.witness.note(numbers, bool(np.abs(axes - self._axes).max() > LEAST), far)
        self._axes = axes.copy()


def machine(channel: Watched, *setup) -> None:
    """The process of a machine whose first motor can be silent."""
    witness = channel.witness
    assert witness is not None

    def motors(hardware: Hardware) -> DriverClient:
        named = MotorsOnBus(hardware.motors, hardware.bus, hardware.interface)
        found = start_driver(named, ("-c", "import sys; from qualification.hushed import main; sys.exit(main())"))
        witness.motors = found.process.pid
        return found

    hardware_process.motors_of = motors
    hardware_process.run(channel, *setup)
