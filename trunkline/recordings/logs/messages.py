"""The one registry of message schemas: schema name to the function that reads poses or joints from it.

A function here takes one decoded message, or a batch of one layout (see `encodings`): numbers have shape () or
(n,), so write along the last axes. Adding a schema is one such function under `@poses` or `@joints`. Where a log
holds several of them, the one that is registered first is read.
"""

import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class DecodedPoses(NamedTuple):
    """positions: (..., S, 3) in the log's unit. orientations: (..., S, 4) wxyz, or None.

    time: ns, (...) or, where every body has its own, (..., S); None where only the recorder's clock tells.
    names: S, or an array (..., S) where messages of one layout may differ; None where the topic or the session
    names the bodies. frame: (...) frame number, or None where the schema has none. parents: S names of the frames
    that the poses are in, or None where a message has but one.
    """

    time: np.ndarray | None
    names: list[str] | np.ndarray | None
    positions: np.ndarray
    orientations: np.ndarray | None
    frame: np.ndarray | None = None
    parents: list[str] | None = None


class DecodedJoints(NamedTuple):
    """positions: (..., K) m. time: (...) ns, names: K; None where the recorder's clock and the session tell. efforts:
    (..., K) N or Nm, where messages have a field of their own for these; None where not."""

    time: np.ndarray | None
    names: list[str] | None
    positions: np.ndarray
    efforts: np.ndarray | None = None


UNLABELLED = re.compile(r"(.*[:_ ])?unlabell?ed([:_ ]*\d+)?", re.IGNORECASE)  # what Motive calls a marker of no asset
POSES: dict[str, Callable[..., DecodedPoses]] = {}
JOINTS: dict[str, Callable[..., DecodedJoints]] = {}
TOPIC_PER_BODY: set[str] = set()  # schemas of one pose, which the topic names
# what a reader raises where a message is not as expected
READING = (AttributeError, TypeError, ValueError, IndexError, OverflowError)


def misfit(error: Exception) -> str:
    """Why a message is not as a reader expects it, in words, by what the reader raised (`READING`)."""
    return f"it has no {error.name or error}" if isinstance(error, AttributeError) else str(error)


def poses(
    *schemas: str, topic_per_body: bool = False
) -> Callable[[Callable[..., DecodedPoses]], Callable[..., DecodedPoses]]:
    """Register the decorated function as the reader of pose schemas."""
    TOPIC_PER_BODY.update(schemas if topic_per_body else ())
    return lambda function: POSES.update({schema: function for schema in schemas}) or function


def joints(*schemas: str) -> Callable[[Callable[..., DecodedJoints]], Callable[..., DecodedJoints]]:
    """Register the decorated function as the reader of joint schemas."""
    return lambda function: JOINTS.update({schema: function for schema in schemas}) or function


@poses("mocap4r2_msgs/RigidBodies", "mocap_msgs/RigidBodies")
def rigid_bodies(message) -> DecodedPoses:
    bodies = message.rigidbodies
    return DecodedPoses(
        moment(message.header.stamp),
        [body.rigid_body_name for body in bodies],
        vectors([body.pose.position for body in bodies]),
        quaternions([body.pose.orientation for body in bodies]),
        np.asarray(message.frame_number),
    )


@poses("interfaces/TrunkRigidBodies")
def trunk_rigid_bodies(message) -> DecodedPoses:
    return DecodedPoses(
        moment(message.header.stamp),
        message.rigid_body_names,
        vectors(message.positions),
        quaternions(message.orientations) if message.orientations else None,
        np.asarray(message.frame_number),
    )


@poses("motion_capture_tracking_interfaces/NamedPoseArray", "motion_capture_tracking_interfaces/NamedPoseArrayV2")
def named_pose_array(message) -> DecodedPoses:
    named = message.poses
    return DecodedPoses(
        moment(message.header.stamp),
        [body.name for body in named],
        vectors([body.pose.position for body in named]),
        quaternions([body.pose.orientation for body in named]),
    )


@poses("geometry_msgs/PoseStamped", topic_per_body=True)
def pose_stamped(message) -> DecodedPoses:
    return _unnamed(moment(message.header.stamp)[..., None], [message.pose])


@poses("foxglove.PoseInFrame", "foxglove_msgs/PoseInFrame", topic_per_body=True)
def pose_in_frame(message) -> DecodedPoses:
    return _unnamed(moment(message.timestamp)[..., None], [message.pose])


@poses("vicon_receiver/Position", topic_per_body=True)
def vicon_position(message) -> DecodedPoses:
    """In mm; older versions have no header, and so the recorder's time."""
    place = np.stack([message.x_trans, message.y_trans, message.z_trans], axis=-1)[..., None, :]
    turn = np.stack([message.w, message.x_rot, message.y_rot, message.z_rot], axis=-1)[..., None, :]
    time = moment(message.header.stamp) if hasattr(message, "header") else None
    return DecodedPoses(time, None, place.astype(float), turn.astype(float), np.asarray(message.frame_number))


@poses("geometry_msgs/TransformStamped", topic_per_body=True)
def transform_stamped(message) -> DecodedPoses:
    """A segment of vicon_bridge."""
    place, turn = vectors([message.transform.translation]), quaternions([message.transform.rotation])
    return DecodedPoses(moment(message.header.stamp)[..., None], None, place, turn)


@poses("geometry_msgs/PoseArray")
def pose_array(message) -> DecodedPoses:
    return _unnamed(moment(message.header.stamp), message.poses)


@poses("foxglove.PosesInFrame", "foxglove_msgs/PosesInFrame")
def poses_in_frame(message) -> DecodedPoses:
    return _unnamed(moment(message.timestamp), message.poses)


@poses("foxglove.FrameTransforms", "foxglove_msgs/FrameTransforms")
def frame_transforms(message) -> DecodedPoses:
    return _transforms([(t.timestamp, t.parent_frame_id, t.child_frame_id, t) for t in message.transforms])


@poses("foxglove.FrameTransform", "foxglove_msgs/FrameTransform")
def frame_transform(message) -> DecodedPoses:
    return _transforms([(message.timestamp, message.parent_frame_id, message.child_frame_id, message)])


@poses("tf2_msgs/TFMessage")
def tf_message(message) -> DecodedPoses:
    return _transforms(
        [(t.header.stamp, t.header.frame_id, t.child_frame_id, t.transform) for t in message.transforms]
    )


@poses("mocap4r2_msgs/Markers", "mocap_msgs/Markers")
def markers(message) -> DecodedPoses:
    """Markers have no orientation; one without a name goes by its index, which older messages call `index`."""
    names = [getattr(marker, "marker_name", "") for marker in message.markers]
    if not all(names):
        indices = [getattr(marker, "marker_index", getattr(marker, "index", None)) for marker in message.markers]
        indices = [np.asarray(index).astype(str) for index in indices]
        pairs = zip(names, indices, strict=True)
        names = np.stack([np.full(index.shape, name) if name else index for name, index in pairs], axis=-1)
    positions = vectors([marker.translation for marker in message.markers])
    return DecodedPoses(moment(message.header.stamp), names, positions, None, np.asarray(message.frame_number))


@joints("sensor_msgs/JointState")
def joint_state(message) -> DecodedJoints:
    positions = np.asarray(message.position, dtype=float)
    efforts = np.asarray(getattr(message, "effort", []), dtype=float)  # JSON may leave it out
    names = message.name if any(message.name) or not max(positions.shape[-1], efforts.shape[-1]) else None
    return DecodedJoints(moment(message.header.stamp), names, positions, efforts if efforts.shape[-1] else None)


@joints("std_msgs/Float64MultiArray", "std_msgs/Float32MultiArray")
def float_array(message) -> DecodedJoints:
    return DecodedJoints(None, None, np.asarray(message.data, dtype=float))


@joints("std_msgs/Float64", "std_msgs/Float32")
def one_float(message) -> DecodedJoints:
    return DecodedJoints(None, None, np.asarray(message.data, dtype=float)[..., None])


def moment(time) -> np.ndarray:
    """A ROS 2 (sec, nanosec), Foxglove (sec, nsec) or protobuf (seconds, nanos) time to ns, (...); JSON may leave out
    a part that is 0."""
    for whole, rest in (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("sec", "sec")):
        if hasattr(time, rest) and (rest != whole or vars(time).keys() == {whole}):
            seconds = np.asarray(getattr(time, whole, 0))
            nanoseconds = np.asarray(getattr(time, rest) if rest != whole else 0)
            if seconds.dtype.kind not in "iu" or nanoseconds.dtype.kind not in "iu":
                raise TypeError("a time of whole numbers expected")
            return seconds.astype(np.int64) * 1_000_000_000 + nanoseconds.astype(np.int64)
    raise AttributeError("no time of a known form")


def vectors(points: list) -> np.ndarray:
    """Points (x, y, z) to (..., S, 3)."""
    return _stack(points, "xyz")


def quaternions(rotations: list) -> np.ndarray:
    """Quaternions (x, y, z, w) to (..., S, 4), w first."""
    return _stack(rotations, "wxyz")


def _unnamed(time: np.ndarray, bodies) -> DecodedPoses:
    """geometry_msgs/Pose, or foxglove.Pose, list."""
    return DecodedPoses(
        time, None, vectors([b.position for b in bodies]), quaternions([b.orientation for b in bodies])
    )


def _transforms(items: list) -> DecodedPoses:
    """(time, parent, child, transform) of each body."""
    return DecodedPoses(
        np.stack([moment(time) for time, *_ in items], axis=-1) if items else np.empty(0, np.int64),
        [child for _, _, child, _ in items],
        vectors([transform.translation for *_, transform in items]),
        quaternions([transform.rotation for *_, transform in items]),
        parents=[parent for _, parent, _, _ in items],
    )


def _stack(items: list, axes: str) -> np.ndarray:
    """Columns of numbers side by side; a batch of messages without any body is (0, len(axes)) whatever its size."""
    if not items:
        return np.empty((0, len(axes)))
    rows = [np.stack([getattr(item, axis) for axis in axes], axis=-1) for item in items]
    return np.stack(rows, axis=-2).astype(float, copy=False)
