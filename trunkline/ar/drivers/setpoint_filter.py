"""What the Panda is sent, cycle by cycle: the driver process's own logic, without robot, socket and clock.

Setpoints are stamped with when they are due, and come some time before. They are played by the robot's time, which is
drawn towards this machine's, and every cycle is held against the robot's limits before it is sent. Where setpoints run
out, do not come, or ask for too much, the joints brake by themselves and hold; nothing but a new stream moves them.

A robot that a command does not reach in time goes on at its last acceleration (libfranka, "System requirements",
"Packet handling"). What it is sent next starts where it went, and comes back to the setpoints within BRIDGED s.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trunkline.ar.drivers.driver_frames import Setpoint
from trunkline.ar.drivers.watchdog import Watchdog
from trunkline.ar.teleop.minimum_jerk import minimum_jerk
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN
from trunkline.kinematics.panda.limits import ACCELERATION, JERK, VELOCITY

BEHIND = 0.3  # s by which setpoints may be played late
SAME = 1e-7  # rad within which setpoints are of one place
NEAR = 2e-3  # rad by which the first setpoint may be off
ROUNDING = 1.02  # share of a limit that differences may show of a way that keeps it
BRAKING = 0.5  # share of accelerations and jerks with which it brakes
SLOWEST, FASTEST = 0.9, 1.5  # of the robot's time, on which setpoints are played
GAIN, SMOOTH = 5.0, 0.1  # 1/s, s: how its clock is drawn to this machine's
CYCLE = 0.001  # s, of the robot
LOST = 1e-6  # rad by which a robot that a command has reached may be elsewhere
BRIDGED = 0.1  # s within which it is back where setpoints want it


@dataclass(frozen=True)
class RobotLimits:
    """Of the joints, each of shape (7,): `low` and `high` in rad, `velocity` in rad/s, `acceleration` in rad/s²,
    `jerk` in rad/s³."""

    low: np.ndarray
    high: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray


# FR3: Franka Control Interface documentation, "Robot and interface specifications", "Limits for Franka Research 3". Its
# velocities near the ends of its range are lower still; that is left to the robot. Plans are made for the Panda, so
# the lower of both holds.
LIMITS = {
    "panda": RobotLimits(Q_MIN, Q_MAX, VELOCITY, ACCELERATION, JERK),
    "fr3": RobotLimits(
        np.maximum(Q_MIN, [-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
        np.minimum(Q_MAX, [2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
        np.minimum(VELOCITY, [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
        np.minimum(ACCELERATION, 10.0),
        np.minimum(JERK, 5000.0),
    ),
}


class Bridge:
    """An offset that goes to none within BRIDGED s, with the least jerk: from its place, speed and acceleration, the
    rows of `offset` (3, 7)."""

    def __init__(self, offset: np.ndarray) -> None:
        self._place, self._speed, self._gain = offset
        self._time = 0.0

    def next(self, dt: float) -> np.ndarray:
        """The offset `dt` s later, (7,)."""
        self._time = min(self._time + dt, BRIDGED)
        s = self._time / BRIDGED
        place = 1 - minimum_jerk(s)
        speed = s - s**3 * (6 - 8 * s + 3 * s**2)
        gain = s**2 / 2 - s**3 * (3 - 3 * s + s**2) / 2
        return place * self._place + BRIDGED * speed * self._speed + BRIDGED**2 * gain * self._gain


class SetpointFilter:
    """From rest at `joints` (7,), rad.

    Attributes:
        fault: why it brakes, "" while it follows.
    """

    def __init__(self, joints: Sequence[float], limits: RobotLimits) -> None:
        self.fault = ""
        self._limits = limits
        still = np.zeros(len(joints))
        self._sent = np.array([joints, still, still], dtype=float)  # place, speed and acceleration
        self._planned = self._sent  # the same of the setpoints
        self._bridge, self._lost = Bridge(0.0 * self._sent), False
        self._queue: deque[Setpoint] = deque()
        self._watchdog, self._clock, self._behind = Watchdog(), math.nan, 0.0

    @property
    def joints(self) -> np.ndarray:
        """As they were sent last, (7,), rad."""
        return self._sent[0]

    @property
    def resting(self) -> bool:
        """Whether it is at rest, its fault braked for."""
        return bool(self.fault) and not self._sent[1:].any()

    def synchronize(self, joints: Sequence[float], speed: Sequence[float], gain: Sequence[float]) -> None:
        """Before a cycle: where the robot's own motion generator is, (7,) each, rad, rad/s, rad/s²."""
        place, rate = np.abs(np.subtract([joints, speed], self._sent[:2])).max(axis=1)
        if place > LOST or rate > LOST / CYCLE:
            self._sent, self._lost = np.array([joints, speed, gain], dtype=float), True

    def hear(self, setpoint: Setpoint, now: float) -> None:
        """A setpoint, at `now`, s."""
        joints = np.array(setpoint.axes)
        if not (math.isfinite(setpoint.due) and np.isfinite(joints).all()):
            self.brake("setpoint: found values that are not finite")
        elif math.isinf(self._watchdog.last_setpoint) and (off := float(np.abs(joints - self.joints).max())) > NEAR:
            self.brake(f"setpoint: starts {off:.3g} rad from where the robot is, expected at most {NEAR:g}")
        elif not self._queue or setpoint.due > self._queue[-1].due:
            self._queue.append(setpoint)
        self._watchdog.feed(now)

    def brake(self, fault: str) -> None:
        """Come to rest, and stay there, because of `fault`."""
        self.fault = self.fault or fault

    def cycle(self, now: float, dt: float) -> np.ndarray:
        """What the robot is sent at `now`, s, `dt` s of its own time after the last one; (7,), rad."""
        if late := self._watchdog.late(now):
            self.brake(late)
        cycles, lost = max(round(dt / CYCLE), 1) if dt > 0 else 0, self._lost
        for later in reversed(range(cycles)):
            self._go(now - later * dt / cycles, dt / cycles, missed=lost and later > 0)
        return self.joints.copy()

    def _go(self, now: float, dt: float, missed: bool) -> None:
        """One of the robot's cycles; of one that it `missed` nothing was sent."""
        wanted = self._wanted(now, dt) if not self.fault else None
        if wanted is not None:
            self._take(wanted, dt, missed)
        if self.fault and not missed:
            self._slow(dt)

    def _wanted(self, now: float, dt: float) -> np.ndarray | None:
        """Where the setpoints want the joints now; None where there is nothing to follow yet, or no more."""
        queue = self._queue
        if not queue:
            return None
        if math.isnan(self._clock):
            if now < queue[0].due:
                return None
            self._clock = now
        else:
            self._behind += (now - self._clock - dt - self._behind) * min(dt / SMOOTH, 1.0)
            self._clock += dt * min(max(1.0 + GAIN * self._behind, SLOWEST), FASTEST)
        if not self._planned[1].any():  # at rest nothing is missed by what is left out of it
            while len(queue) > 1 and queue[1].due <= now and _same(queue[0], queue[1]):
                queue.popleft()
            self._clock = max(self._clock, min(queue[0].due, now))
        if now - self._clock > BEHIND:
            late = 1e3 * (now - self._clock)
            self.brake(f"its cycles are too few: setpoints are played {late:.0f} ms late, expected {1e3 * BEHIND:.0f}")
            return None
        while len(queue) > 1 and queue[1].due <= self._clock:
            queue.popleft()
        if len(queue) == 1:
            if self._clock > queue[0].due:
                late = 1e3 * (now - self._watchdog.last_setpoint)
                self.brake(f"setpoints have run out, the last came {late:.0f} ms ago")
                return None
            return np.array(queue[0].axes)
        share = (self._clock - queue[0].due) / (queue[1].due - queue[0].due)
        first, second = np.array(queue[0].axes), np.array(queue[1].axes)
        return first + max(share, 0.0) * (second - first)

    def _take(self, wanted: np.ndarray, dt: float, missed: bool) -> None:
        if self._lost and not missed:
            self._bridge, self._lost = Bridge(self._sent - self._planned), False
        self._planned = _moved(self._planned, wanted, dt)
        if missed:
            return
        place, speed, gain = sent = _moved(self._sent, wanted + self._bridge.next(dt), dt)
        jerk = (gain - self._sent[2]) / dt
        limits = self._limits
        for rates, most, unit in (
            (speed, limits.velocity, "rad/s"), (gain, limits.acceleration, "rad/s²"), (jerk, limits.jerk, "rad/s³")
        ):  # fmt: skip
            over = np.abs(rates) / (ROUNDING * most)
            if over.max() > 1:
                joint = int(over.argmax())
                demand = f"asks for {abs(rates[joint]):.3g} {unit}, expected at most {most[joint]:.3g}"
                self.brake(f"setpoint: joint {joint + 1} {demand}")
                return
        outside = np.maximum(limits.low - place, place - limits.high)
        if outside.max() > 0:
            joint = int(outside.argmax())
            self.brake(f"setpoint: joint {joint + 1} leaves its range at {place[joint]:.3f} rad")
            return
        self._sent = sent

    def _slow(self, dt: float) -> None:
        """One cycle of braking, each joint by itself: the acceleration that a jerk still ends at rest."""
        jerk, most = BRAKING * self._limits.jerk, BRAKING * self._limits.acceleration
        place, speed, gain = self._sent
        wanted = -np.sign(speed) * np.minimum(most, np.sqrt(jerk * np.abs(speed)))
        gain = gain + np.clip(wanted - gain, -jerk * dt, jerk * dt)
        after = speed + gain * dt
        ended = (after * speed <= 0) & (np.abs(gain) <= 4 * jerk * dt)
        speed = np.where(ended, 0.0, after)
        self._sent = np.array([place + speed * dt, speed, np.where(ended, 0.0, gain)])


def _moved(before: np.ndarray, place: np.ndarray, dt: float) -> np.ndarray:
    """Place, speed and acceleration `dt` s after those `before`, (3, 7)."""
    speed = (place - before[0]) / dt
    return np.array([place, speed, (speed - before[1]) / dt])


def _same(first: Setpoint, second: Setpoint) -> bool:
    return all(abs(a - b) < SAME for a, b in zip(first.axes, second.axes, strict=True))
