"""The one registry of message schemas: schema name to the function that reads poses or joints from it.

A function here takes one decoded message, or a batch of one layout (see `cdr.decode`): numbers have shape ()
or (n,), so write along the last axes. Adding a schema is one such function under `@poses` or `@joints`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Poses(NamedTuple):
    """time: (...) ns. names: S. positions: (..., S, 3) in the log's unit.

    orientations: (..., S, 4) wxyz, or None. frame: (...) frame number, or None where the schema has none.
    """

    time: np.ndarray
    names: list[str]
    positions: np.ndarray
    orientations: np.ndarray | None
    frame: np.ndarray | None


class Joints(NamedTuple):
    """time: (...) ns. names: K. positions: (..., K) m."""

    time: np.ndarray
    names: list[str]
    positions: np.ndarray


POSES: dict[str, Callable[..., Poses]] = {}
JOINTS: dict[str, Callable[..., Joints]] = {}


def poses(schema: str):
    """Register the decorated function as the reader of a pose schema."""
    return lambda function: POSES.setdefault(schema, function)


def joints(schema: str):
    """Register the decorated function as the reader of a joint schema."""
    return lambda function: JOINTS.setdefault(schema, function)


@poses("mocap4r2_msgs/RigidBodies")
def rigid_bodies(message) -> Poses:
    bodies = message.rigidbodies
    return Poses(
        stamp(message.header),
        [body.rigid_body_name for body in bodies],
        vectors(message, [body.pose.position for body in bodies]),
        quaternions(message, [body.pose.orientation for body in bodies]),
        np.asarray(message.frame_number),
    )


@poses("interfaces/TrunkRigidBodies")
def trunk_rigid_bodies(message) -> Poses:
    return Poses(
        stamp(message.header),
        message.rigid_body_names,
        vectors(message, message.positions),
        quaternions(message, message.orientations) if message.orientations else None,
        np.asarray(message.frame_number),
    )


@joints("sensor_msgs/JointState")
def joint_state(message) -> Joints:
    return Joints(stamp(message.header), message.name, np.asarray(message.position, dtype=float))


def stamp(header) -> np.ndarray:
    """std_msgs/Header to ns since the epoch, (...)."""
    return np.asarray(header.stamp.sec, np.int64) * 1_000_000_000 + np.asarray(
        header.stamp.nanosec, np.int64
    )


def vectors(message, points: list) -> np.ndarray:
    """geometry_msgs/Point list to (..., S, 3)."""
    return _stack(message, points, "xyz")


def quaternions(message, rotations: list) -> np.ndarray:
    """geometry_msgs/Quaternion list to (..., S, 4), w first."""
    return _stack(message, rotations, "wxyz")


def _stack(message, items: list, axes: str) -> np.ndarray:
    if not items:
        return np.empty((*np.shape(message.header.stamp.sec), 0, len(axes)))
    return np.stack(
        [np.stack([getattr(item, axis) for axis in axes], axis=-1) for item in items], axis=-2
    )
