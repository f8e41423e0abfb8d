"""The Panda behind a controller of ROS 2, a `joint_trajectory_controller`: by DDS, without ROS on this side.

Every PERIOD s the controller is sent one point, where the joints shall be when it is due; the next takes its place.
Where no more come, it stands at the last: that is its dead man. No real controller was tried.
"""

import time

import numpy as np
from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from trunkline.errors import InputError
from trunkline.execution.ros_messages import JointState, JointTrajectory, trajectory
from trunkline.execution.ros_settings import RosSettings

PERIOD = 0.01  # s between points
CONNECTING = 20.0  # s
SILENT = 0.2  # s without the joints' state


class RosArm:
    """A robot that a controller moves, and whose joints' states are told. measured: the newest, (7,), rad."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings, self.fault = settings, ""
        self.measured, self._sent = np.full(len(settings.names), np.nan), np.full(len(settings.names), np.nan)
        self._heard, self._told = time.monotonic(), 0.0
        try:
            participant = DomainParticipant(settings.domain)
            orders = Topic(participant, f"rt{settings.trajectory}", JointTrajectory)
            states = Topic(participant, f"rt{settings.states}", JointState)
            self._writer = DataWriter(
                participant, orders, Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(1))
            )
            self._reader = DataReader(
                participant, states, Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
            )
        except DDSException as error:
            raise InputError(f"ros.domain: found no DDS in domain {settings.domain} ({error})") from error

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
        while np.isnan(self.measured).any() or not self._writer.get_matched_subscriptions():
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
            self._writer.write(trajectory(self._settings.names, [(max(due - now, 0.0), joints.tolist())]))
        except DDSException as error:
            self._fail(f"{self._settings.trajectory}: {error}")

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
        """Nothing: the controller is sent no more, and stands at the last point."""

    def _hear(self, now: float) -> None:
        for state in self._reader.take(10):
            where: dict[str, float] = dict(
                zip(getattr(state, "name", ()), getattr(state, "position", ()), strict=False)
            )
            if all(name in where for name in self._settings.names):
                self.measured, self._heard = np.array([where[name] for name in self._settings.names]), now

    def _fail(self, fault: str) -> None:
        self.fault = self.fault or fault
