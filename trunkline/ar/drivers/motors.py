"""The tendons' motors together: all homed, all followed, or none driven.

They are driven only while each of them is heard. What is found wrong is a fault that lasts: from then on every current
is zero, and only new motors, homed anew, can follow again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from trunkline.ar.drivers.gm6020 import FEEDBACK, Feedback
from trunkline.ar.drivers.winch import Winch, WinchSettings

FEEDBACK_TIMEOUT = 0.02  # s without feedback of a motor
HOMING = 60.0  # s
PRESENT = 1.0  # s within which each must be heard at first


@dataclass(frozen=True)
class MotorSettings:
    """numbers: of the motors, in the order of the tendons. sides: 1 where a positive current reels in, else -1.
    astray: m that a cable may be from where it shall be. hot: °C that a motor may have."""

    numbers: Annotated[tuple[Annotated[int, Field(ge=1, le=7)], ...], Field(min_length=1, max_length=7)]
    sides: tuple[Literal[-1, 1], ...]
    astray: Annotated[float, Field(gt=0, le=0.1)]
    hot: Annotated[float, Field(ge=30, le=120)]
    reel: WinchSettings

    def __post_init__(self) -> None:
        if len(self.sides) != len(self.numbers):
            raise ValueError(f"sides: found {len(self.sides)}, expected one for each of {len(self.numbers)} motors")
        if len(set(self.numbers)) < len(self.numbers):
            raise ValueError(f"numbers: found {list(self.numbers)}, expected each once")


@dataclass(frozen=True)
class MotorsOnBus:
    """`motors` on a `bus` of python-can's `interface`; on the bus `simulated_motors.SIMULATED`, simulated ones."""

    motors: MotorSettings
    bus: str
    interface: str

    @property
    def axes(self) -> int:
        """How many cables."""
        return len(self.motors.numbers)


class MotorGroup:
    """Feedback in, currents out; it knows no bus and no clock. `begun`: s at which listening began."""

    def __init__(self, settings: MotorSettings, begun: float) -> None:
        self._settings, self._begun = settings, begun
        self.winches = [Winch(settings.reel, side) for side in settings.sides]
        self._by_number = dict(zip(settings.numbers, self.winches, strict=True))
        self.fault = ""

    @property
    def homed(self) -> bool:
        """Whether every cable's zero is known."""
        return all(winch.homed for winch in self.winches)

    @property
    def pulls(self) -> list[float]:
        """Of the cables, m."""
        return [winch.pull for winch in self.winches]

    def hear(self, feedback: Feedback, now: float) -> None:
        """What a motor says at `now`, s."""
        winch = self._by_number.get(feedback.number)
        if winch is None:
            return
        winch.read(feedback, now)
        if feedback.celsius > self._settings.hot:
            self._fail(f"motor {feedback.number}: found {feedback.celsius} °C, expected at most {self._settings.hot:g}")

    def currents(self, pulls: Sequence[float], speeds: Sequence[float], now: float) -> dict[int, float]:
        """A, by the motor's number, at `now`, s, so that the cables follow `pulls` (K,), m, moving at `speeds` (K,),
        m/s; until all are homed, so that they become so."""
        currents = dict.fromkeys(self._settings.numbers, 0.0)
        if not self._all_respond(now):
            return currents
        wanted = zip(self._by_number.items(), pulls, speeds, strict=True)
        homed = self.homed
        for (number, winch), pull, speed in wanted:
            if not homed:
                currents[number] = winch.current(0.0, 0.0, now) if winch.homed else winch.home(now)
            elif abs(pull - winch.pull) > self._settings.astray:
                where = f"{1e3 * abs(pull - winch.pull):.0f} mm from where its cable shall be"
                self._fail(f"motor {number}: found {where}, expected at most {1e3 * self._settings.astray:.0f}")
            else:
                currents[number] = winch.current(pull, speed, now)
            if winch.fault:
                self._fail(f"motor {number}: {winch.fault}")
        return dict.fromkeys(currents, 0.0) if self.fault else currents

    def _all_respond(self, now: float) -> bool:
        """Whether each is heard, and none failed."""
        for number, winch in self._by_number.items():
            if winch.last_feedback is None:
                if now - self._begun > PRESENT:
                    self._fail(f"motor {number}: found no feedback, expected it under the id {FEEDBACK + number:#x}")
                return False
            if (silent := now - winch.last_feedback) > FEEDBACK_TIMEOUT:
                self._fail(f"motor {number}: silent for {1e3 * silent:.0f} ms, expected feedback every 1 ms")
        return not self.fault

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault
