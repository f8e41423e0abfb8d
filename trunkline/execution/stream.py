"""What the Panda is sent, cycle by cycle: the adapter's own logic, without robot, socket and clock.

Setpoints are stamped with when they are due, and come some time before. They are played by the robot's time, which is
drawn towards this machine's, and every cycle is held against the robot's limits before it is sent. Where setpoints run
out, do not come, or ask for too much, the joints brake by themselves and hold; nothing but a new stream moves them.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trunkline.execution.adapter_frames import Setpoint
from trunkline.panda.kinematics import Q_MAX, Q_MIN
from trunkline.panda.limits import ACCELERATION, JERK, VELOCITY

SILENT = 0.05  # s without a setpoint
BEHIND = 0.3  # s by which setpoints may be played late
SAME = 1e-7  # rad within which setpoints are of one place
NEAR = 2e-3  # rad by which the first setpoint may be off
ROUNDING = 1.02  # share of a limit that differences may show of a way that keeps it
BRAKING = 0.5  # share of accelerations and jerks with which it brakes
SLOWEST, FASTEST = 0.9, 1.5  # of the robot's time, on which setpoints are played
GAIN, SMOOTH = 5.0, 0.1  # 1/s, s: how its clock is drawn to this machine's


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


class Stream:
    """From rest at `joints` (7,), rad.

    Attributes:
        joints: that were sent last, (7,), rad. fault: why it brakes, "" while it follows. resting: whether it is at
            rest, its fault braked for.
    """

    def __init__(self, joints: Sequence[float], limits: RobotLimits) -> None:
        self.joints, self.fault = np.array(joints, dtype=float), ""
        self._limits = limits
        self._speed, self._gain = np.zeros(len(self.joints)), np.zeros(len(self.joints))
        self._queue: deque[Setpoint] = deque()
        self._heard = self._clock = math.nan
        self._behind = 0.0

    @property
    def resting(self) -> bool:
        return bool(self.fault) and not self._speed.any() and not self._gain.any()

    def hear(self, setpoint: Setpoint, now: float) -> None:
        """A setpoint, at `now`, s."""
        joints = np.array(setpoint.joints)
        if not (math.isfinite(setpoint.due) and np.isfinite(joints).all()):
            self.brake("setpoint: found values that are not finite")
        elif math.isnan(self._heard) and (off := float(np.abs(joints - self.joints).max())) > NEAR:
            self.brake(f"setpoint: starts {off:.3g} rad from where the robot is, expected at most {NEAR:g}")
        elif not self._queue or setpoint.due > self._queue[-1].due:
            self._queue.append(setpoint)
        self._heard = now

    def brake(self, fault: str) -> None:
        """Come to rest, and stay there, because of `fault`."""
        self.fault = self.fault or fault

    def cycle(self, now: float, dt: float) -> np.ndarray:
        """What the robot is sent at `now`, s, `dt` s of its own time after the last one; (7,), rad."""
        if not self.fault and self._queue and now - self._heard > SILENT:
            self.brake(f"silent for {1e3 * (now - self._heard):.0f} ms, expected setpoints every 1 ms")
        wanted = self._wanted(now, dt) if not self.fault else None
        if wanted is not None and dt > 0:
            self._take(wanted, dt)
        if self.fault and dt > 0:
            self._slow(dt)
        return self.joints.copy()

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
        if not self._speed.any():  # at rest nothing is missed by what is left out of it
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
                late = 1e3 * (now - self._heard)
                self.brake(f"setpoints have run out, the last came {late:.0f} ms ago")
                return None
            return np.array(queue[0].joints)
        share = (self._clock - queue[0].due) / (queue[1].due - queue[0].due)
        first, second = np.array(queue[0].joints), np.array(queue[1].joints)
        return first + max(share, 0.0) * (second - first)

    def _take(self, wanted: np.ndarray, dt: float) -> None:
        speed = (wanted - self.joints) / dt
        gain = (speed - self._speed) / dt
        jerk = (gain - self._gain) / dt
        limits = self._limits
        for found, most, unit in (
            (speed, limits.velocity, "rad/s"), (gain, limits.acceleration, "rad/s²"), (jerk, limits.jerk, "rad/s³")
        ):  # fmt: skip
            over = np.abs(found) / (ROUNDING * most)
            if over.max() > 1:
                joint = int(over.argmax())
                asked = f"asks for {abs(found[joint]):.3g} {unit}, expected at most {most[joint]:.3g}"
                self.brake(f"setpoint: joint {joint + 1} {asked}")
                return
        outside = np.maximum(limits.low - wanted, wanted - limits.high)
        if outside.max() > 0:
            joint = int(outside.argmax())
            self.brake(f"setpoint: joint {joint + 1} leaves its range at {wanted[joint]:.3f} rad")
            return
        self.joints, self._speed, self._gain = wanted, speed, gain

    def _slow(self, dt: float) -> None:
        """One cycle of braking, each joint by itself: the acceleration that a jerk still ends at rest."""
        jerk, most = BRAKING * self._limits.jerk, BRAKING * self._limits.acceleration
        speed, gain = self._speed, self._gain
        wanted = -np.sign(speed) * np.minimum(most, np.sqrt(jerk * np.abs(speed)))
        gain = gain + np.clip(wanted - gain, -jerk * dt, jerk * dt)
        after = speed + gain * dt
        ended = (after * speed <= 0) & (np.abs(gain) <= 4 * jerk * dt)
        self._gain, self._speed = np.where(ended, 0.0, gain), np.where(ended, 0.0, after)
        self.joints = self.joints + self._speed * dt


def _same(first: Setpoint, second: Setpoint) -> bool:
    return all(abs(a - b) < SAME for a, b in zip(first.joints, second.joints, strict=True))
