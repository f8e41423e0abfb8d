"""Whether setpoints are late: it reports a fault, on which the driver that asks halts its axes by its own means."""

import math

from trunkline.ar.drivers.driver import TICK

SETPOINT_TIMEOUT = 0.05  # s without a setpoint


class Watchdog:
    """Over setpoints, which come every TICK s once they have begun.

    Attributes:
        last_setpoint: s at which the last one came, infinite before the first.
    """

    def __init__(self) -> None:
        self.last_setpoint = math.inf

    def feed(self, now: float) -> None:
        """A setpoint has come at `now`, s."""
        self.last_setpoint = now

    def late(self, now: float) -> str:
        """The fault at `now`, s, that none came for SETPOINT_TIMEOUT s; "" for none. Called before those that wait are
        read, it finds too that this process itself was late."""
        silent = now - self.last_setpoint
        if silent <= SETPOINT_TIMEOUT:
            return ""
        return f"heard no setpoint for {1e3 * silent:.0f} ms, expected one every {1e3 * TICK:.0f} ms"
