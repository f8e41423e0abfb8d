"""The Panda behind a controller of ROS 2, a `joint_trajectory_controller`.

Every PERIOD s the controller is sent one point, where the joints shall be when it is due; the next takes its place.
Points have no velocities, so it goes there evenly from where it then is, however fast that is: what is too fast is
refused here. Where no more come, it stands at the last: that is its dead man. No real controller was tried.
"""

import math
import time
from typing import Protocol

import numpy as np

from trunkline.ar.drivers.driver import CONNECTING, TICK
from trunkline.ar.drivers.ros_settings import JointReading, RosSettings
from trunkline.ar.drivers.setpoint_filter import LIMITS, ROUNDING
from trunkline.ar.drivers.watchdog import Watchdog
from trunkline.errors import InputError

PERIOD = 0.01  # s between points
JOINT_STATE_TIMEOUT = 0.2  # s without the joints' state
VELOCITY = LIMITS["panda"].velocity  # (7,), rad/s


class Link(Protocol):
    """How messages go to ROS 2 and come from it. Nothing waits but `close`."""

    @property
    def listeners(self) -> int:
        """How many hear what is sent; that they are controllers, nobody knows."""
        ...

    def send(self, seconds: float, joints: list[float]) -> None:
        """A trajectory of one point: the joints, rad, so many s from when it is received.

        Raises:
            InputError: it cannot be sent.
        """
        ...

    def states(self) -> list[JointReading]:
        """What was said since the last call, the newest last."""
        ...

    def close(self) -> None: ...


def link_of(settings: RosSettings) -> Link:
    """
    Raises:
        InputError: what the link needs is not there.
    """
    if settings.link == "dds":
        from trunkline.ar.drivers.ros_dds import DdsLink  # with what it needs installed

        return DdsLink(settings)
    try:
        from trunkline.ar.drivers.ros_node import NodeLink
    except ImportError as error:
        raise InputError(f"ros.link: found no rclpy ({error}), expected ROS 2 to be sourced, or dds") from error
    return NodeLink(settings)


class RosPanda:
    """A `Driver` of the Panda's joints, rad, that a controller moves, and whose states are told.

    After a fault nothing is sent: the controller stands at the last point, which is on the way, at most the setpoints'
    lead from where the joints are. Any other point, such as where they are measured, would turn them back.
    """

    def __init__(self, settings: RosSettings) -> None:
        self._settings, self.fault, self.ready = settings, "", False
        self.measured, self._sent = np.full(settings.axes, np.nan), np.full(settings.axes, np.nan)
        self._state_time, self._sent_at = time.monotonic(), 0.0
        self._next: tuple[float, np.ndarray] | None = None
        self._watchdog, self._fresh = Watchdog(), False  # whether setpoints came since the last turn
        self._way: tuple[float, np.ndarray] | None = None  # when the last point is due, and where it was gone to from
        self._until = self._state_time + CONNECTING
        self.link = link_of(settings)

    @property
    def sent(self) -> np.ndarray:
        return np.where(np.isnan(self._sent), self.measured, self._sent)

    def send(self, due: float, axes: np.ndarray) -> None:
        """The newest goes with the next turn, no oftener than every PERIOD s."""
        if not (math.isfinite(due) and np.isfinite(axes).all()):
            self._fail("setpoint: found values that are not finite")
        self._next, self._fresh = (due, np.array(axes)), True

    def turn(self, now: float) -> None:
        """Hear the joints' state, and send what is due."""
        self._hear(now)
        if not self.ready:
            self._look(now)
            return
        self._check(now)
        if not self.fault and self._next is not None and now - self._sent_at >= PERIOD:
            self._send(now, *self._next)

    def close(self) -> None:
        """The controller is sent no more, and stands at the last point."""
        self.link.close()

    def _check(self, now: float) -> None:
        """Whether setpoints and states come, somebody listens, and each joint is where it is sent."""
        settings = self._settings
        if late := self._watchdog.late(now):
            self._fail(late)
        if self._fresh:
            self._watchdog.feed(now)
            self._fresh = False
        if not self.link.listeners:
            self._fail(f"{settings.trajectory}: nobody listens any more")
        if (silent := now - self._state_time) > JOINT_STATE_TIMEOUT:
            self._fail(f"{settings.states}: silent for {1e3 * silent:.0f} ms")
        off = np.abs(self.measured - self.sent)
        if not off.max() <= settings.astray:  # or no number
            name = settings.names[int(off.argmax())]
            self._fail(f"{name}: found {off.max():.3g} rad from where it is sent, expected at most {settings.astray:g}")

    def _send(self, now: float, due: float, joints: np.ndarray) -> None:
        """A point, unless the way there from where the last ones have the joints by now is too fast."""
        here = self._at(now)
        speed = np.abs(joints - here) / max(due - now, TICK)
        joint = int((speed / VELOCITY).argmax())
        if speed[joint] > ROUNDING * VELOCITY[joint]:
            demand = f"asks for {speed[joint]:.3g} rad/s, expected at most {VELOCITY[joint]:.3g}"
            self._fail(f"setpoint: {self._settings.names[joint]} {demand}")
            return
        self._sent_at, self._sent, self._next, self._way = now, joints, None, (due, here)
        try:
            self.link.send(max(due - now, 0.0), joints.tolist())
        except InputError as error:
            self._fail(str(error))

    def _at(self, now: float) -> np.ndarray:
        """Where the points that were sent have the joints at `now`, s; (7,), rad."""
        if self._way is None:
            return self.measured
        due, here = self._way
        return here + min((now - self._sent_at) / max(due - self._sent_at, TICK), 1.0) * (self._sent - here)

    def _look(self, now: float) -> None:
        """Whether the joints' state is told and a controller listens."""
        measured = not np.isnan(self.measured).any()
        self.ready = measured and self.link.listeners > 0
        if not self.ready and now > self._until:
            missing = self._settings.trajectory if measured else self._settings.states
            side = "found nobody who listens" if measured else f"found no state of {self._settings.names[0]} and others"
            self._fail(f"{missing}: {side} within {CONNECTING:.0f} s")

    def _hear(self, now: float) -> None:
        for names, positions in self.link.states():
            where = dict(zip(names, positions, strict=False))
            if all(name in where for name in self._settings.names):
                self.measured, self._state_time = np.array([where[name] for name in self._settings.names]), now

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault
