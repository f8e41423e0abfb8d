"""The Panda behind a controller of ROS 2, a `joint_trajectory_controller`.

Every PERIOD s the controller is sent one point, where the joints shall be when it is due; the next takes its place.
Where no more come, it stands at the last: that is its dead man. No real controller was tried.
"""

import math
import time
from typing import Protocol

import numpy as np

from trunkline.errors import InputError
from trunkline.execution.ros_settings import CONNECTING, RosSettings, Said

PERIOD = 0.01  # s between points
SILENT = 0.2  # s without the joints' state


class Link(Protocol):
    """How messages go to ROS 2 and come from it. Nothing waits but `close`."""

    @property
    def listeners(self) -> int:
        """How many controllers hear what is sent."""
        ...

    def send(self, seconds: float, joints: list[float]) -> None:
        """A trajectory of one point: the joints, rad, so many s from when it is received.

        Raises:
            InputError: it cannot be sent.
        """
        ...

    def states(self) -> list[Said]:
        """What was said since the last call, the newest last."""
        ...

    def close(self) -> None: ...


def link_of(settings: RosSettings) -> Link:
    """
    Raises:
        InputError: what the link needs is not there.
    """
    if settings.link == "dds":
        from trunkline.execution.ros_dds import DdsLink  # with what it needs installed

        return DdsLink(settings)
    try:
        from trunkline.execution.ros_node import NodeLink
    except ImportError as error:
        raise InputError(f"ros.link: found no rclpy ({error}), expected ROS 2 to be sourced, or dds") from error
    return NodeLink(settings)


class RosArm:
    """A `Limb` of the Panda's joints, rad, that a controller moves, and whose states are told."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings, self.fault, self.ready = settings, "", False
        self.measured, self._sent = np.full(settings.axes, np.nan), np.full(settings.axes, np.nan)
        self._heard, self._told = time.monotonic(), 0.0
        self._next: tuple[float, np.ndarray] | None = None
        self._until = self._heard + CONNECTING
        self.link = link_of(settings)

    @property
    def sent(self) -> np.ndarray:
        return np.where(np.isnan(self._sent), self.measured, self._sent)

    def send(self, due: float, axes: np.ndarray) -> None:
        """The newest goes with the next turn, no oftener than every PERIOD s."""
        if not (math.isfinite(due) and np.isfinite(axes).all()):
            self._fail("setpoint: found values that are not finite")
        self._next = None if self.fault else (due, np.array(axes))

    def turn(self, now: float) -> None:
        """Hear the joints' state, and send what is due."""
        self._hear(now)
        if not self.ready:
            self._look(now)
            return
        if (silent := now - self._heard) > SILENT:
            self._fail(f"{self._settings.states}: silent for {1e3 * silent:.0f} ms")
        off = np.abs(self.measured - self.sent)
        if not off.max() <= self._settings.astray:  # or no number
            name, most = self._settings.names[int(off.argmax())], self._settings.astray
            self._fail(f"{name}: found {off.max():.3g} rad from where it is sent, expected at most {most:g}")

        if self._next is not None and now - self._told >= PERIOD:
            self._send(now, *self._next)

    def close(self) -> None:
        """The controller is sent no more, and stands at the last point."""
        self.link.close()

    def _send(self, now: float, due: float, joints: np.ndarray) -> None:
        self._told, self._sent, self._next = now, joints, None
        try:
            self.link.send(max(due - now, 0.0), joints.tolist())
        except InputError as error:
            self._fail(str(error))

    def _look(self, now: float) -> None:
        """Whether the joints' state is told and a controller listens."""
        known = not np.isnan(self.measured).any()
        self.ready = known and self.link.listeners > 0
        if not self.ready and now > self._until:
            missing = self._settings.trajectory if known else self._settings.states
            side = "found nobody who listens" if known else f"found no state of {self._settings.names[0]} and others"
            self._fail(f"{missing}: {side} within {CONNECTING:.0f} s")

    def _hear(self, now: float) -> None:
        for names, positions in self.link.states():
            where = dict(zip(names, positions, strict=False))
            if all(name in where for name in self._settings.names):
                self.measured, self._heard = np.array([where[name] for name in self._settings.names]), now

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault
