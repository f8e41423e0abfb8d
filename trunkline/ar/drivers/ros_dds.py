"""A controller of ROS 2 by DDS, without ROS on this side."""

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from trunkline.ar.drivers.ros_messages import JointState, JointTrajectory, trajectory
from trunkline.ar.drivers.ros_settings import NEWEST, JointReading, RosSettings
from trunkline.errors import InputError


class DdsLink:
    """
    Raises:
        InputError: there is no DDS in the settings' domain.
    """

    def __init__(self, settings: RosSettings) -> None:
        self._settings = settings
        try:
            participant = DomainParticipant(settings.domain)
            orders = Topic(participant, f"rt{settings.trajectory}", JointTrajectory)
            states = Topic(participant, f"rt{settings.states}", JointState)
            self._writer = DataWriter(
                participant, orders, Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(1))
            )
            self._reader = DataReader(
                participant, states, Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(NEWEST))
            )
        except DDSException as error:
            raise InputError(f"ros.domain: found no DDS in domain {settings.domain} ({error})") from error

    @property
    def listeners(self) -> int:
        return len(self._writer.get_matched_subscriptions())

    def send(self, seconds: float, joints: list[float]) -> None:
        try:
            self._writer.write(trajectory(self._settings.names, [(seconds, joints)]))
        except DDSException as error:
            raise InputError(f"{self._settings.trajectory}: {error}") from error

    def states(self) -> list[JointReading]:
        # what was disposed of has neither
        taken = self._reader.take(NEWEST)
        return [(list(getattr(state, "name", ())), list(getattr(state, "position", ()))) for state in taken]

    def close(self) -> None:
        """Nothing: it ends with its process."""
