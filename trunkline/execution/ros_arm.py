"""The Panda behind a controller of ROS 2, a `joint_trajectory_controller`.

Every PERIOD s the controller is sent one point, where the joints shall be when it is due; the next takes its place.
Where no more come, it stands at the last: that is its dead man. No real controller was tried.
"""

import time
from typing import Protocol

import numpy as np

from trunkline.errors import InputError
from trunkline.execution.ros_settings import RosSettings, Said

PERIOD = 0.01  # s between points
CONNECTING = 20.0  # s
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
    """A robot that a controller moves, and whose joints' states are told. measured: the newest, (7,), rad."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings, self.fault = settings, ""
        self.measured, self._sent = np.full(len(settings.names), np.nan), np.full(len(settings.names), np.nan)
        self._heard, self._told = time.monotonic(), 0.0
        self.link = link_of(settings)

    @property
    def joints(self) -> np.ndarray:
        """As they were sent last, or are where nothing was sent, (7,), rad."""
        return np.where(np.isnan(self._sent), self.measured, self._sent)

    def begin(self) -> None:
        """Wait until the joints' state is told and a controller listens.

        Raises:
            InputError: either is not there.
        """
        end = time.monotonic() + CONNECTING
        while np.isnan(self.measured).any() or not self.link.listeners:
            if time.monotonic() > end:
                known = not np.isnan(self.measured).any()
                missing = self._settings.trajectory if known else self._settings.states
                side = (
                    "found nobody who listens" if known else f"found no state of {self._settings.names[0]} and others"
                )
                raise InputError(f"{missing}: {side} within {CONNECTING:.0f} s")
            time.sleep(0.01)
            self._hear(time.monotonic())

    def send(self, due: float, joints: np.ndarray) -> None:
        """Where the joints shall be at `due`, s: (7,), rad."""
        now = time.monotonic()
        if now - self._told < PERIOD:
            return
        self._told, self._sent = now, np.array(joints)
        try:
            self.link.send(max(due - now, 0.0), joints.tolist())
        except InputError as error:
            self._fail(str(error))

    def turn(self, now: float) -> None:
        """Hear the joints' state."""
        self._hear(now)
        if (silent := now - self._heard) > SILENT:
            self._fail(f"{self._settings.states}: silent for {1e3 * silent:.0f} ms")
        off = np.abs(self.measured - self.joints)
        if off.max() > self._settings.astray:
            name, most = self._settings.names[int(off.argmax())], self._settings.astray
            self._fail(f"{name}: found {off.max():.3g} rad from where it is sent, expected at most {most:g}")

    def close(self) -> None:
        """The controller is sent no more, and stands at the last point."""
        self.link.close()

    def _hear(self, now: float) -> None:
        for names, positions in self.link.states():
            where = dict(zip(names, positions, strict=False))
            if all(name in where for name in self._settings.names):
                self.measured, self._heard = np.array([where[name] for name in self._settings.names]), now

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault
