"""Panda and motors as one machine, on one clock.

Every tick both are sent where they shall be LEAD s later, and each plays that by the same clock: a process that is late
by less moves nothing otherwise. What ends one of them is the machine's fault, which lasts, and whoever turns the
machine stops it along its plan. So the limb that is well comes to rest where the plan has it, and holds.
"""

import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from trunkline.errors import InputError
from trunkline.execution.on_bus import BusMotors
from trunkline.execution.pace import Smoother
from trunkline.teleop.trajectory import JOINTS

LEAD = 0.03  # s
TICK = 0.001  # s
SMOOTH = 10  # ticks of each of the smoother's means
HOMING = 60.0  # s


class Arm(Protocol):
    """The Panda, however it is reached. Nothing waits but `begin` and `close`."""

    fault: str

    @property
    def joints(self) -> np.ndarray:
        """As they were sent last, (7,), rad."""
        ...

    @property
    def measured(self) -> np.ndarray:
        """As they are, (7,), rad."""
        ...

    def begin(self) -> None: ...
    def send(self, due: float, joints: np.ndarray) -> None: ...
    def turn(self, now: float) -> None: ...
    def close(self) -> None: ...


class Machine:
    """Of an `arm` and `motors`, or one of them; the cables' commands (K,) where the arm is straight are `straight`, m.

    To be begun, then moved every TICK s.
    """

    tick = TICK

    def __init__(
        self,
        arm: Arm | None,
        motors: BusMotors | None,
        straight: np.ndarray,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._arm, self._motors, self._straight, self._clock = arm, motors, np.array(straight, dtype=float), clock
        self._smoother: Smoother | None = None
        self._due = 0.0
        self._pulls: deque[tuple[float, np.ndarray]] = deque()
        self._turned = 0.0

    def begin(self, joints: np.ndarray) -> np.ndarray:
        """Take hold of all there is, which waits: the arm is under control, and the cables are homed.

        Args:
            joints: where the twin's arm is where there is no real one, (7,), rad.

        Returns:
            Where the joints are, (7,), rad.

        Raises:
            InputError: a limb is not there, or cannot be homed.
        """
        if self._arm is not None:
            self._arm.begin()
            joints = self._arm.joints
        if self._motors is not None:
            self._home(self._motors)  # last: motors that nobody commands let go
        self._smoother = Smoother(np.append(joints, self._straight), SMOOTH)
        return np.array(joints)

    @property
    def fault(self) -> str:
        """What ended it, "" while it goes."""
        if self._arm is not None and self._arm.fault:
            return f"robot: {self._arm.fault}"
        if self._motors is not None and self._motors.fault:
            return f"motors: {self._motors.fault}"
        return ""

    def move(self, joints: np.ndarray, commands: np.ndarray) -> None:
        """One tick, at whose end the axes shall be at `joints` (7,), rad, and `commands` (K,), m."""
        assert self._smoother is not None
        now, wanted = self._clock(), self._smoother.next(np.append(joints, commands))
        self._due += TICK
        if self._due < now:  # the first, or one that is late by more than LEAD
            self._due = now + LEAD
        if self._arm is not None:
            self._arm.send(self._due, wanted[: len(joints)])
            self._arm.turn(now)
        if self._motors is not None:
            self._pulls.append((self._due, self._straight - wanted[len(joints) :]))
            if now - self._turned > TICK / 2:
                self._turned = now
                self._motors.turn(*self._pulled(now))

    def measured(self) -> np.ndarray:
        """The arm's joints, rad (7,); NaN without an arm."""
        return np.full(JOINTS, np.nan) if self._arm is None else self._arm.measured

    def lengths(self) -> np.ndarray:
        """Of the cables, m (K,), as the motors' encoders have them; NaN without motors."""
        if self._motors is None:
            return np.full(len(self._straight), np.nan)
        return self._straight - np.array(self._motors.motors.pulls)

    def close(self) -> None:
        """Give back all there is: the motors are without current, the arm brakes."""
        if self._motors is not None:
            self._motors.close()
        if self._arm is not None:
            self._arm.close()

    def _home(self, motors: BusMotors) -> None:
        due = begun = self._clock()
        still = [0.0] * len(self._straight)
        while not motors.motors.homed and not motors.fault and due - begun < HOMING:
            time.sleep(max(due - self._clock(), 0.0))
            due = max(due + TICK, self._clock() - LEAD)
            motors.turn(still, still)
            if self._arm is not None:
                self._arm.turn(self._clock())
        if motors.fault or not motors.motors.homed:
            raise InputError(f"motors: {motors.fault or f'not homed after {HOMING:.0f} s'}")

    def _pulled(self, now: float) -> tuple[list[float], list[float]]:
        """Pulls, m, and speeds, m/s, that are due."""
        while len(self._pulls) > 1 and self._pulls[1][0] <= now:
            self._pulls.popleft()
        first, before = self._pulls[0]
        if len(self._pulls) == 1 or now < first:
            return before.tolist(), [0.0] * len(before)
        second, after = self._pulls[1]
        speed = (after - before) / (second - first)
        return (before + (now - first) * speed).tolist(), speed.tolist()
