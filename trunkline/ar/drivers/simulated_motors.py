"""Simulated motors: GM6020 with spools of cable, the other end of a bus.

Each has a rotor with dry and viscous friction, and a cable that is a spring from a slack length on:

    J θ'' = k_t i - f sign(θ') - b θ' - r T,    T = max(0, k (r θ - slack))

What its encoder reads moves with the current, nine times a turn. No command for WATCHDOG s, and it drives no current:
what a real motor does then is the maker's business, and was not tried.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from trunkline.ar.drivers.gm6020 import COUNTS, NUMBERS, TORQUE, Feedback, commanded, feedback_frame

SIMULATED = "virtual"  # the bus behind which such motors are
WATCHDOG = 0.1  # s
STEP = 0.00025  # s
RIPPLE, PER_TURN = 6.4e-3, 9  # rad/A, as one lab measured it
SLOW = 0.05  # rad/s below which dry friction is less than all of it


@dataclass(frozen=True)
class MotorParameters:
    """inertia: kg m². dry: N m. viscous: N m s. radius: of the spool, m. stiffness: of the cable with what it pulls,
    N/m. slack: m that it is loose at first. side: 1 where a positive current reels in. begins: encoder's first angle,
    counts. All assumed: nobody measured the rotor's inertia or friction."""

    inertia: float = 3e-4
    dry: float = 0.03
    viscous: float = 1e-3
    radius: float = 0.015
    stiffness: float = 400.0
    slack: float = 0.02
    side: int = 1
    begins: int = 0


class SimulatedMotor:
    """`silent`: whether it gives no feedback. `angle`: rad, since it began, that reels in where it is positive."""

    def __init__(self, number: int, plant: MotorParameters) -> None:
        self.number, self.plant = number, plant
        self.angle = self.rate = self.current = 0.0
        self.silent, self._commanded = False, -math.inf

    @property
    def reeled(self) -> float:
        """m of cable."""
        return self.angle * self.plant.radius

    @property
    def tension(self) -> float:
        """N."""
        return max(0.0, self.plant.stiffness * (self.reeled - self.plant.slack))

    def command(self, current: float, now: float) -> None:
        """A."""
        self.current, self._commanded = current, now

    def step(self, now: float) -> None:
        """One STEP, that ends at `now`, s."""
        if now - self._commanded > WATCHDOG:
            self.current = 0.0
        plant = self.plant
        rubs = plant.dry * math.tanh(self.rate / SLOW) + plant.viscous * self.rate
        drives = plant.side * TORQUE * self.current
        self.rate += STEP * (drives - rubs - plant.radius * self.tension) / plant.inertia
        self.angle += STEP * self.rate

    def feedback(self) -> Feedback:
        """As it is now."""
        read = self.angle + RIPPLE * self.current * math.sin(PER_TURN * self.angle)
        counts = self.plant.begins + self.plant.side * read / (2 * math.pi) * COUNTS
        rpm = round(self.plant.side * self.rate * 60 / (2 * math.pi))
        return Feedback(self.number, math.floor(counts) % COUNTS, rpm, self.current, 30)


class SimulatedMotors:
    """Motors 1, 2, …; `now`: s at which it begins."""

    def __init__(self, plants: Sequence[MotorParameters], now: float) -> None:
        self.motors = [SimulatedMotor(number, plant) for number, plant in zip(NUMBERS, plants, strict=False)]
        self._now = now

    def hear(self, identifier: int, data: bytes, now: float) -> None:
        """A frame."""
        currents = commanded(identifier, data)
        for motor in self.motors:
            if motor.number in currents:
                motor.command(currents[motor.number], now)

    def advance(self, now: float) -> list[tuple[int, bytes]]:
        """Until `now`, s; the frames, (id, data), that the motors send then."""
        while self._now + STEP <= now + 1e-9:
            self._now += STEP
            for motor in self.motors:
                motor.step(self._now)
        return [feedback_frame(motor.feedback()) for motor in self.motors if not motor.silent]
