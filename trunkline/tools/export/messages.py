"""Foxglove's messages in protobuf, by the schemas that it publishes, and messages of plain numbers.

Positions are in the base frame, m; `stamp` is ns.
"""

import re
from collections.abc import Iterable, Sequence

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from google.protobuf.timestamp_pb2 import Timestamp

BASE = "base"  # the frame that all others are in
PACKAGE = "trunkline"
RGBA = ("red", "green", "blue", "alpha")
POINT = np.dtype([(axis, "<f4") for axis in "xyz"] + [(share, "u1") for share in RGBA])
FIELDS = [
    *(PackedElementField(name=n, offset=4 * i, type=PackedElementField.FLOAT32) for i, n in enumerate("xyz")),
    *(PackedElementField(name=n, offset=12 + i, type=PackedElementField.UINT8) for i, n in enumerate(RGBA)),
]


def transforms(
    stamp: int, prefix: str, names: Sequence[str], positions: np.ndarray, quaternions: np.ndarray | None
) -> FrameTransforms:
    """Of the S bodies `prefix/name` those whose positions (S, 3) are finite. quaternions: wxyz, (S, 4), None where
    nobody knows how they are turned: then they are as the base is."""
    turns = np.tile((1.0, 0.0, 0.0, 0.0), (len(names), 1)) if quaternions is None else quaternions
    links = [
        FrameTransform(timestamp=_time(stamp), parent_frame_id=BASE, child_frame_id=f"{prefix}/{name}",
                       translation=_vector(place), rotation=_quaternion(turn))
        for name, place, turn in zip(names, positions, turns, strict=True)
        if np.isfinite(place).all() and np.isfinite(turn).all()
    ]  # fmt: skip
    return FrameTransforms(transforms=links)


def scene(stamp: int, name: str, points: np.ndarray, radii: np.ndarray, color: Color) -> SceneUpdate:
    """An arm through points (N, 3) from the base on, as a cone from each to the next; points that are not finite are
    left out. radii: m, (N,). It takes the place of the last one of the same name."""
    there = np.isfinite(points).all(axis=1)
    points, radii = points[there], radii[there]
    ends = zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True)
    cones = [_cone(*end, color) for end in ends]
    return SceneUpdate(entities=[SceneEntity(timestamp=_time(stamp), frame_id=BASE, id=name, cylinders=cones)])


def _cone(start: np.ndarray, end: np.ndarray, thick: float, thin: float, color: Color) -> CylinderPrimitive:
    """From `start` with the radius `thick` to `end` with `thin`. Its axis is z, turned the short way, never by 180°."""
    if end[2] < start[2]:
        start, end, thick, thin = end, start, thin, thick
    along, widest = end - start, 2 * max(thick, thin)
    length = float(np.linalg.norm(along))
    x, y, z = along / length if length else (0.0, 0.0, 1.0)
    turn = np.array([1 + z, -y, x, 0.0])
    return CylinderPrimitive(
        pose=Pose(position=_vector((start + end) / 2), orientation=_quaternion(turn / np.linalg.norm(turn))),
        size=Vector3(x=widest, y=widest, z=length),
        bottom_scale=2 * thick / widest, top_scale=2 * thin / widest, color=color,
    )  # fmt: skip


def cloud(stamp: int, points: np.ndarray, color: Color) -> PointCloud:
    """Those of points (N, 3) that are finite, m in 32 bits. Rerun draws these, and no scene."""
    points = points[np.isfinite(points).all(axis=1)]
    packed = np.empty(len(points), POINT)
    packed["x"], packed["y"], packed["z"] = points.T
    for name in RGBA:
        packed[name] = round(255 * getattr(color, name[0]))
    return PointCloud(timestamp=_time(stamp), frame_id=BASE, pose=Pose(position=Vector3(), orientation=Quaternion(w=1)),
                      point_stride=POINT.itemsize, fields=FIELDS, data=packed.tobytes())  # fmt: skip


def line(stamp: int, text: str) -> Log:
    """A line of text, for viewers that list them."""
    return Log(timestamp=_time(stamp), level=Log.Level.INFO, message=text, name=PACKAGE)


def numbers_type(name: str, fields: Iterable[str]) -> type[Message]:
    """The type of a message `trunkline.<name>` of doubles, which viewers draw over time by its schema."""
    file = FileDescriptorProto(name=f"{PACKAGE}/{name}.proto", package=PACKAGE, syntax="proto3")
    message = file.message_type.add(name=name)
    for number, field in enumerate(fields, 1):
        message.field.add(
            name=field, number=number, type=FieldDescriptorProto.TYPE_DOUBLE, label=FieldDescriptorProto.LABEL_OPTIONAL
        )
    pool = DescriptorPool()
    pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(f"{PACKAGE}.{name}"))


def identifier(name: str) -> str:
    """A body's or tendon's name as that of a field, which has letters, digits and underscores alone."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain[:1].isalpha() else f"n{plain}"


def _time(stamp: int) -> Timestamp:
    return Timestamp(seconds=stamp // 10**9, nanos=stamp % 10**9)


def _vector(values: Iterable[float]) -> Vector3:
    x, y, z = map(float, values)
    return Vector3(x=x, y=y, z=z)


def _quaternion(wxyz: Iterable[float]) -> Quaternion:
    w, x, y, z = map(float, wxyz)
    return Quaternion(w=w, x=x, y=y, z=z)
