"""Panda and motors as one robot, on one clock.

Every tick both are sent where they shall be LEAD s later, and each plays that by the same clock: a process that is late
by less moves nothing otherwise. What ends one of them is the robot's fault, which lasts, and the caller stops the robot
along its plan. So the driver without a fault comes to rest where the plan has it, and holds.
"""

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from trunkline.ar.drivers.driver import TICK, Driver
from trunkline.ar.drivers.time_scaling import Smoother
from trunkline.ar.teleop.trajectory import JOINTS
from trunkline.errors import InputError

LEAD = 0.03  # s
SMOOTH = 10  # ticks of each of the smoother's means


class HardwareRobot:
    """Of a `panda`, whose axes are joints, and `motors`, whose axes are pulls, or one of them; the cables' commands
    (K,) where the soft arm is straight are `straight`, m.

    To be begun, then moved every TICK s.
    """

    tick = TICK

    def __init__(
        self,
        panda: Driver | None,
        motors: Driver | None,
        straight: np.ndarray,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._panda, self._motors, self._straight, self._clock = panda, motors, np.array(straight, dtype=float), clock
        self._drivers = {name: driver for name, driver in (("robot", panda), ("motors", motors)) if driver is not None}
        self._smoother: Smoother | None = None
        self._due, self._anew = 0.0, False

    def begin(self, joints: np.ndarray, left: Callable[[], bool] = lambda: False) -> np.ndarray:
        """Take hold of all there is, which waits: the Panda is under control, and the cables are homed.

        Args:
            joints: where the twin's Panda is if there is no real one, (7,), rad.
            left: whether whoever wants it is gone.

        Returns:
            Where the joints are, (7,), rad.

        Raises:
            InputError: a driver is not there, or cannot be homed, or nobody waits any more.
        """
        while not (self.fault or left() or all(driver.ready for driver in self._drivers.values())):
            time.sleep(TICK)
            for driver in self._drivers.values():
                driver.turn(self._clock())
        if self.fault or left():
            raise InputError(self.fault or "the session is gone")
        joints = np.array(joints if self._panda is None else self._panda.sent)
        self._smoother = Smoother(np.append(joints, self._straight), SMOOTH)
        return joints

    @property
    def fault(self) -> str:
        """What ended it, "" while it goes."""
        return next((f"{name}: {driver.fault}" for name, driver in self._drivers.items() if driver.fault), "")

    def move(self, joints: np.ndarray, commands: np.ndarray) -> None:
        """One tick, at whose end the axes shall be at `joints` (7,), rad, and `commands` (K,), m."""
        assert self._smoother is not None
        now, wanted = self._clock(), self._smoother.next(np.append(joints, commands))
        self._due += TICK
        self._anew = self._due < now  # the first, or one that is late by more than LEAD
        if self._anew:
            self._due = now + LEAD
        if self._panda is not None:
            self._panda.send(self._due, wanted[:JOINTS])
        if self._motors is not None:
            self._motors.send(self._due, self._straight - wanted[JOINTS:])
        for driver in self._drivers.values():
            driver.turn(now)

    @property
    def behind(self) -> float:
        """s by which moves may be late and be made up for: none once they are due anew, LEAD s from now. If they were,
        all that follows would be due that much later for good."""
        return 0.0 if self._anew else math.inf

    def measured(self) -> np.ndarray:
        """The Panda's joints, rad (7,); NaN without one."""
        return np.full(JOINTS, np.nan) if self._panda is None else self._panda.measured

    def lengths(self) -> np.ndarray:
        """Of the cables, m (K,), as the motors' encoders have them; NaN without motors."""
        return self._straight - (np.nan if self._motors is None else self._motors.measured)

    def close(self) -> None:
        """Give back all there is: the motors are without current, the Panda brakes."""
        with ThreadPoolExecutor() as pool:  # each waits for its own
            list(pool.map(lambda driver: driver.close(), self._drivers.values()))
