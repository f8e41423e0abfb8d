"""ROS 2 messages as DDS has them, in Python alone: a trajectory of joints, and joints' states.

Source: the definitions of builtin_interfaces, std_msgs, trajectory_msgs and sensor_msgs; DDS names a type
`package::msg::dds_::Type_`, and a topic `rt/` and its name.
"""

# pyright: reportArgumentType=false
# cyclonedds declares `sequence` as a class of its own; what it takes are lists.

from collections.abc import Sequence
from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32

from trunkline.ar.drivers.ros_settings import NANO


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class JointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    positions: sequence[float64]
    velocities: sequence[float64]
    accelerations: sequence[float64]
    effort: sequence[float64]
    time_from_start: Duration


@dataclass
class JointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    header: Header
    joint_names: sequence[str]
    points: sequence[JointTrajectoryPoint]


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


def trajectory(names: Sequence[str], rows: Sequence[tuple[float, Sequence[float]]]) -> JointTrajectory:
    """The joints of these `names` at positions, rad, so many s from when it is received: `rows` of (s, positions).

    Its stamp is 0, which begins at once, and it says no velocities: a controller goes straight from point to point, and
    stands at the last.
    """
    points = [
        JointTrajectoryPoint([float(q) for q in positions], [], [], [], _duration(seconds))
        for seconds, positions in rows
    ]
    return JointTrajectory(Header(Time(0, 0), ""), list(names), points)


def _duration(seconds: float) -> Duration:
    return Duration(*divmod(round(seconds * NANO), NANO))
