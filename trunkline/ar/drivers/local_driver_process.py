"""The driver process of hardware that runs in this environment: the tendons' motors, or a controller of ROS 2.

    python -m trunkline.ar.drivers.local_driver_process SETTINGS DESCRIPTOR

SETTINGS: of either, as JSON. DESCRIPTOR: of the socket to the robot's process, which starts it; by hand it is of
no use.
"""

import gc
import math
import signal
import socket
import sys
import time
from collections.abc import Sequence
from contextlib import closing

import numpy as np
from pydantic import TypeAdapter

from trunkline.ar.drivers.driver import CONNECTING, TICK, Driver
from trunkline.ar.drivers.driver_client import DriverClient
from trunkline.ar.drivers.driver_frames import DriverState, FrameSocket, Setpoint
from trunkline.ar.drivers.motors import HOMING, MotorsOnBus
from trunkline.ar.drivers.panda_process import TELL
from trunkline.ar.drivers.realtime_priority import raise_priority
from trunkline.ar.drivers.ros_settings import RosSettings
from trunkline.errors import InputError

LATE = 0.02  # s that turns may be behind before some are left out
SETTLES = 0.2  # s for which a driver without setpoints holds before it is released
STARTING = 5.0  # s that a process has to start

DriverSettings = MotorsOnBus | RosSettings
DRIVER_SETTINGS: TypeAdapter[DriverSettings] = TypeAdapter(DriverSettings)


def start_driver(
    settings: DriverSettings, program: Sequence[str] = ("-m", "trunkline.ar.drivers.local_driver_process")
) -> DriverClient:
    """The driver of these settings, in a process of its own: Python's, which runs the `program`."""
    patience = CONNECTING if isinstance(settings, RosSettings) else HOMING
    command = [sys.executable, *program, DRIVER_SETTINGS.dump_json(settings).decode()]
    return DriverClient(command, settings.axes, patience + STARTING)


def driver_of(settings: DriverSettings) -> Driver:
    """The same, in this process.

    Raises:
        InputError: what it needs is not there.
    """
    try:
        if isinstance(settings, RosSettings):
            from trunkline.ar.drivers.ros_panda import RosPanda

            return RosPanda(settings)
        from trunkline.ar.drivers.on_bus import motors_on
        from trunkline.ar.drivers.tendon_driver import TendonDriver
    except ImportError as error:
        extra = "ros2" if isinstance(settings, RosSettings) else "motors"
        raise InputError(f"found no library {error.name}, expected the extra {extra} to be installed") from error
    return TendonDriver(motors_on(settings), time.monotonic())


def run_driver(driver: Driver, line: FrameSocket) -> None:
    """Turn the driver until nobody is at the other end, and SETTLES s more."""
    due, gone, turns, fault = time.monotonic(), math.inf, 0, ""
    while (now := time.monotonic()) - gone < SETTLES:
        for frame in line.received():
            setpoint = Setpoint.unpack(frame)
            driver.send(setpoint.due, np.array(setpoint.axes))
        gone = gone if line.open else min(gone, now)
        driver.turn(now)
        if driver.fault != fault or (driver.ready and turns % TELL == 0):
            fault = driver.fault
            line.tell(DriverState(now, tuple(driver.measured), tuple(driver.sent), fault))
        turns, due = turns + 1, max(due + TICK, now - LATE)
        time.sleep(max(due - time.monotonic(), 0.0))


def main(arguments: list[str]) -> int:
    settings, descriptor = DRIVER_SETTINGS.validate_json(arguments[0]), int(arguments[1])
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it ends once nobody is at the other end
    with socket.socket(fileno=descriptor) as channel:
        line = FrameSocket(channel, Setpoint.size(settings.axes))
        try:
            with closing(driver_of(settings)) as driver:
                gc.freeze()
                raise_priority()
                run_driver(driver, line)
        except Exception as error:  # whatever a library raises is the fault that is told, once the driver is closed
            reason = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
            unknown = (math.nan,) * settings.axes
            line.end(DriverState(time.monotonic(), unknown, unknown, " ".join(reason.split())))
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
