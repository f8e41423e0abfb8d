"""A controller of ROS 2 by a node of rclpy, in an environment of ROS 2 that was sourced. Tried against a stub alone."""

# pyright: reportMissingImports=false
# rclpy and its messages come with ROS 2, and from no package index.

import threading
from collections import deque

import rclpy
from builtin_interfaces.msg import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from trunkline.ar.drivers.ros_settings import NANO, NEWEST, JointReading, RosSettings
from trunkline.errors import InputError

PARTING = 1.0  # s that its thread has to end


class NodeLink:
    """A node `trunkline`, in a context of its own, which leaves signals alone. It listens in a thread: to wait for a
    message in the machine's would take longer than its tick.

    Raises:
        InputError: ROS begins no node.
    """

    def __init__(self, settings: RosSettings) -> None:
        self._settings, self._readings = settings, deque(maxlen=NEWEST)
        self._context = rclpy.Context()
        try:
            rclpy.init(args=[], context=self._context, domain_id=settings.domain)
            self._node = Node("trunkline", context=self._context, use_global_arguments=False)
        except RuntimeError as error:
            raise InputError(f"ros.link: found no ROS in domain {settings.domain} ({error})") from error
        self._orders = self._node.create_publisher(JointTrajectory, settings.trajectory, QoSProfile(depth=1))
        self._node.create_subscription(JointState, settings.states, self._hear, qos_profile_sensor_data)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True, name="rclpy")
        self._thread.start()

    @property
    def listeners(self) -> int:
        return self._orders.get_subscription_count()

    def send(self, seconds: float, joints: list[float]) -> None:
        whole, nano = divmod(round(seconds * NANO), NANO)
        point = JointTrajectoryPoint(positions=joints, time_from_start=Duration(sec=whole, nanosec=nano))
        try:
            self._orders.publish(JointTrajectory(joint_names=list(self._settings.names), points=[point]))
        except RuntimeError as error:
            raise InputError(f"{self._settings.trajectory}: {error}") from error

    def states(self) -> list[JointReading]:
        return [self._readings.popleft() for _ in range(len(self._readings))]

    def close(self) -> None:
        """End the node."""
        self._executor.shutdown()
        self._thread.join(PARTING)
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _hear(self, state: JointState) -> None:
        self._readings.append((list(state.name), list(state.position)))
