"""The adapter of simulated motors, the first of which is silent for HUSH s at the signal SIGUSR1."""

import signal
import sys
import time

from trunkline.ar.drivers import local_driver_process, on_bus

HUSH = 0.05  # s


class Hushed(on_bus.SimulatedMotorsOnBus):
    """Such motors. `until`: s until which its first motor is silent."""

    until = 0.0

    def turn(self) -> None:
        self.simulated.motors[0].silent = time.monotonic() < Hushed.until
        super().turn()


def hush(*_) -> None:
    Hushed.until = time.monotonic() + HUSH


def main() -> int:
    signal.signal(signal.SIGUSR1, hush)
    on_bus.SimulatedMotorsOnBus = Hushed
    return local_driver_process.main(sys.argv[1:])
