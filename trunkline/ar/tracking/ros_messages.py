"""The messages of ROS 2 with poses that a DDS participant hears, in Python alone.

Source: the definitions of geometry_msgs, tf2_msgs, motion_capture_tracking_interfaces and mocap4r2_msgs, which
`trunkline/recordings/logs/definitions.py` has as text; DDS names a type `package::msg::dds_::Type_`. Their fields have
the names of ROS, so that the readers of logs (`trunkline/recordings/logs/messages.py`) read them as they are.
"""

# pyright: reportArgumentType=false
# cyclonedds declares `sequence` as a class of its own; what it takes are lists.

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int8, int32, sequence, uint32, uint64

from trunkline.ar.drivers.ros_messages import Header


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class RosPose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: RosPose


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class NamedPose(IdlStruct, typename="motion_capture_tracking_interfaces::msg::dds_::NamedPose_"):
    name: str
    pose: RosPose


@dataclass
class NamedPoseArray(IdlStruct, typename="motion_capture_tracking_interfaces::msg::dds_::NamedPoseArray_"):
    header: Header
    poses: sequence[NamedPose]


@dataclass
class LatencyInfo(IdlStruct, typename="motion_capture_tracking_interfaces::msg::dds_::LatencyInfo_"):
    source: str
    latency: uint32


@dataclass
class NamedPoseArrayV2(IdlStruct, typename="motion_capture_tracking_interfaces::msg::dds_::NamedPoseArrayV2_"):
    header: Header
    timestamp: uint64
    latencies: sequence[LatencyInfo]
    poses: sequence[NamedPose]


@dataclass
class RosMarker(IdlStruct, typename="mocap4r2_msgs::msg::dds_::Marker_"):
    id_type: int8
    marker_index: int32
    marker_name: str
    translation: Point


@dataclass
class RigidBody(IdlStruct, typename="mocap4r2_msgs::msg::dds_::RigidBody_"):
    rigid_body_name: str
    markers: sequence[RosMarker]
    pose: RosPose


@dataclass
class RigidBodies(IdlStruct, typename="mocap4r2_msgs::msg::dds_::RigidBodies_"):
    header: Header
    frame_number: uint32
    rigidbodies: sequence[RigidBody]


@dataclass
class OlderRigidBodies(IdlStruct, typename="mocap_msgs::msg::dds_::RigidBodies_"):
    header: Header
    frame_number: uint32
    rigidbodies: sequence[RigidBody]


# By its name in a log.
TYPES: dict[str, type[IdlStruct]] = {
    "geometry_msgs/PoseStamped": PoseStamped,
    "motion_capture_tracking_interfaces/NamedPoseArray": NamedPoseArray,
    "motion_capture_tracking_interfaces/NamedPoseArrayV2": NamedPoseArrayV2,
    "mocap4r2_msgs/RigidBodies": RigidBodies,
    "mocap_msgs/RigidBodies": OlderRigidBodies,
    "tf2_msgs/TFMessage": TFMessage,
}
