"""The tendons' motors as a driver: homed first, then on their way through what they are sent."""

import math
from collections import deque

import numpy as np

from trunkline.ar.drivers.motors import HOMING
from trunkline.ar.drivers.on_bus import BusMotors
from trunkline.ar.drivers.watchdog import Watchdog


class TendonDriver:
    """A `Driver` whose axes are the cables' pulls from zero, m.

    Where setpoints end, or this process is late itself, the cables hold at the last one, and follow no more. Where a
    motor fails, none is driven.
    """

    def __init__(self, motors: BusMotors, begun: float) -> None:
        """begun: s at which homing begins."""
        self._motors, self._until, self._fault = motors, begun + HOMING, ""
        self.sent = np.zeros(len(motors.motors.winches))
        self._queue: deque[tuple[float, np.ndarray]] = deque()
        self._watchdog, self._fresh = Watchdog(), False  # whether setpoints came since the last turn

    @property
    def fault(self) -> str:
        return self._motors.fault or self._fault

    @property
    def ready(self) -> bool:
        return self._motors.motors.homed

    @property
    def measured(self) -> np.ndarray:
        return np.array(self._motors.motors.pulls)

    def send(self, due: float, axes: np.ndarray) -> None:
        if not (math.isfinite(due) and np.isfinite(axes).all()):
            self._fail("setpoint: found values that are not finite")
        if not self._fault:
            self._queue.append((due, axes))
            self._fresh = True

    def turn(self, now: float) -> None:
        if not self.ready and now > self._until:
            self._fail(f"not homed after {HOMING:.0f} s")
        if late := self._watchdog.late(now):
            self._fail(late)
        if self._fresh:
            self._watchdog.feed(now)
            self._fresh = False
        self.sent, speeds = self._at(now)
        self._motors.turn(self.sent.tolist(), speeds.tolist())

    def close(self) -> None:
        """Without current, and off the bus."""
        self._motors.close()

    def _at(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Pulls, m, and speeds, m/s, that are due."""
        queue, still = self._queue, np.zeros_like(self.sent)
        while len(queue) > 1 and queue[1][0] <= now:
            queue.popleft()
        if not queue or now < queue[0][0]:
            return self.sent, still
        (first, before), (second, after) = queue[0], queue[min(1, len(queue) - 1)]
        if second <= first:
            return before, still
        speed = (after - before) / (second - first)
        return before + (now - first) * speed, speed

    def _fail(self, fault: str) -> None:
        self._fault = self._fault or fault
