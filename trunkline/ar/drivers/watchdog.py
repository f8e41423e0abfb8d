"""Where a driver stops its axes because no setpoints come any more."""

import math

from trunkline.ar.drivers.driver import TICK

SILENT = 0.05  # s without a setpoint


class Watchdog:
    """Over setpoints, which come every TICK s once they have begun.

    Attributes:
        heard: s at which the last one was, infinite before the first.
    """

    def __init__(self) -> None:
        self.heard = math.inf

    def feed(self, now: float) -> None:
        """A setpoint is heard at `now`, s."""
        self.heard = now

    def late(self, now: float) -> str:
        """The fault at `now`, s, that none was heard for SILENT s; "" for none. Asked before those that wait are heard,
        it finds too that this process itself was late."""
        silent = now - self.heard
        if silent <= SILENT:
            return ""
        return f"heard no setpoint for {1e3 * silent:.0f} ms, expected one every {1e3 * TICK:.0f} ms"
