"""A motor with a spool of cable: its encoder in, a current out.

A pull x is the cable reeled in since zero, in m. The motor has no position mode, so the loop is ours. With e = x_d - x,
the mass of the turning parts as the cable feels it, m = J / r², and ω the angular frequency at which the loop's gain
has fallen to about 1, the force on the cable is

    F = m (ω (v_d - v) + 0.4 ω² e + 0.08 ω³ ∫ e dt) + k x_d + f sign(v_d),    i = F r / k_t

Its poles are at -0.54 ω and ω (-0.23 ± 0.31 i). k, what a cable's tension grows by with its pull, and f, the friction
of motor and cable, spare the integral most of its work. ω stays below what one lab saw at 14 to 17 Hz: the encoder's
reading moves with the current, nine times a turn, and a quick loop answers that (docs/hardware.md).
"""

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from trunkline.ar.drivers.gm6020 import COUNTS, MOST_AMPERES, TORQUE, Feedback

SMOOTH = 0.004  # s, of the speed
SETTLED = 0.05  # s, of the tension as the motor's current tells it
LONGEST = 0.01  # s that the integral takes into account at once
CREEP = 0.002  # m/s below which f is less than all of it


@dataclass(frozen=True)
class WinchSettings:
    """Of a motor and its spool.

    radius: of the spool, m. inertia: J of rotor and spool, kg m². crossover: ω / 2π, Hz. most: A. stiffness: k, N/m.
    friction: f, N. pretension: N at zero, more than the friction of cable and motor. homing: m/s. slack: m of cable
    that may be loose when homing begins.
    """

    radius: Annotated[float, Field(ge=0.002, le=0.1)]
    inertia: Annotated[float, Field(ge=1e-6, le=1e-2)]
    crossover: Annotated[float, Field(ge=0.5, le=10)]
    most: Annotated[float, Field(gt=0, le=MOST_AMPERES)]
    stiffness: Annotated[float, Field(ge=0, le=20_000)]
    friction: Annotated[float, Field(ge=0, le=20)]
    pretension: Annotated[float, Field(gt=0, le=50)]
    homing: Annotated[float, Field(gt=0, le=0.05)]
    slack: Annotated[float, Field(gt=0, le=0.5)]


class Winch:
    """One of them; `side` is 1 where a positive current reels in, else -1.

    Attributes:
        pull: m; before homing has ended, since the first reading. speed: m/s. tension: N, smoothed, of what the motor
            says of its current; friction is in it. last_feedback: s at which it was last read, None if never. homed:
            whether zero is known. fault: why it cannot be homed.
    """

    def __init__(self, settings: WinchSettings, side: int) -> None:
        self._settings, self._side = settings, side
        omega, self._mass = 2 * math.pi * settings.crossover, settings.inertia / settings.radius**2
        self._gains = omega, 0.4 * omega**2, 0.08 * omega**3
        self.pull = self.speed = self.tension = 0.0
        self.last_feedback: float | None = None
        self.homed, self.fault = False, ""
        self._angle, self._integral, self._stepped = 0, 0.0, None
        self._goal, self._leg = 0.0, "in"  # of homing
        self._met: float | None = None

    def read(self, feedback: Feedback, now: float) -> None:
        """What the motor says at `now`, s. Between two readings it turns by less than half a turn."""
        if self.last_feedback is not None:
            counts = (feedback.angle - self._angle + COUNTS // 2) % COUNTS - COUNTS // 2
            moved = self._side * counts / COUNTS * 2 * math.pi * self._settings.radius
            dt = now - self.last_feedback
            self.pull += moved
            self.speed += (moved - self.speed * dt) / max(SMOOTH, dt)
            force = self._side * feedback.current * TORQUE / self._settings.radius
            self.tension += (force - self.tension) * min(dt / SETTLED, 1.0)
        self._angle, self.last_feedback = feedback.angle, now

    def current(self, pull: float, speed: float, now: float) -> float:
        """A, so that the cable is at `pull`, m, and moves at `speed`, m/s."""
        dt = self._lapse(now)
        damping, stiffness, integral = (self._mass * gain for gain in self._gains)
        error, feedforward = pull - self.pull, self._settings.friction * min(max(speed / CREEP, -1.0), 1.0)
        if self.homed:
            feedforward += self._settings.stiffness * pull
        force = damping * (speed - self.speed) + stiffness * error + self._integral + feedforward
        most = self._settings.most * TORQUE / self._settings.radius
        if abs(force) < most:
            self._integral += integral * error * dt
        return self._side * min(max(force, -most), most) * self._settings.radius / TORQUE

    def home(self, now: float) -> float:
        """A, on the way to zero: where the tension is the pretension. To be called until `homed`, or a `fault`.

        The winch goes in until the motor bears twice the pretension, then out until it bears it no longer. Friction
        adds to the one and takes from the other, so zero is the middle of both places where it bore the pretension.
        """
        dt = min(now - self._stepped, LONGEST) if self._stepped is not None else 0.0
        settings, speed = self._settings, self._settings.homing
        if self._leg == "in":
            if self._met is None and self.tension >= settings.pretension:
                self._met = self.pull
            if self.tension >= 2 * settings.pretension:
                self._leg = "out"
            elif self.pull > settings.slack:
                within = f"within {1e3 * settings.slack:.0f} mm"
                self.fault = f"found no tension {within}, expected {settings.pretension:g} N"
                return 0.0
        elif self._leg == "out":
            speed = -speed
            if self.tension <= settings.pretension:
                assert self._met is not None
                self._met, self._leg = (self._met + self.pull) / 2, "back"
        else:
            assert self._met is not None
            away = self._met - self._goal
            speed = math.copysign(min(speed, abs(away) / dt if dt else 0.0), away)
            if abs(away) < 1e-6 and abs(self.pull - self._met) < 5e-4:
                self.pull, self._goal, self.homed = self.pull - self._met, 0.0, True
                return self.current(0.0, 0.0, now)
        self._goal += speed * dt
        return self.current(self._goal, speed, now)

    def _lapse(self, now: float) -> float:
        """s since the last call, at most LONGEST."""
        lapse = 0.0 if self._stepped is None else min(now - self._stepped, LONGEST)
        self._stepped = now
        return lapse
