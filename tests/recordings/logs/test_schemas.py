"""Every schema of the registry: the same motion written in each comes back the same."""

import json

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from google.protobuf.json_format import ParseDict
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set
from mcap_ros2.writer import Writer as RosWriter
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.recordings.logs.definitions import HEADER, MARKERS, RIGID_BODIES, SEPARATOR
from trunkline.recordings.session.session import Session
from trunkline.recordings.session.source import open_log

BODIES = ("base", "unit_1", "unit_2")
COUNT, START = 40, 1_760_000_000_123_456_789
STAMPS = START + np.arange(COUNT) * 8_333_333
RNG = np.random.default_rng(0)
POSITIONS = RNG.normal(size=(COUNT, 3, 3))
QUATERNIONS = Rotation.random(COUNT * 3, random_state=1).as_quat(scalar_first=True).reshape(COUNT, 3, 4)
HIDDEN = RNG.random((COUNT, 3)) < 0.2
HIDDEN[0] = False

GEOMETRY = RIGID_BODIES[RIGID_BODIES.index(f"{SEPARATOR}MSG: geometry_msgs/Pose\n") :]
POSE_STAMPED = f"std_msgs/Header header\ngeometry_msgs/Pose pose\n{HEADER}{GEOMETRY}"
POSE_ARRAY = f"std_msgs/Header header\ngeometry_msgs/Pose[] poses\n{HEADER}{GEOMETRY}"
NAMED_POSE_ARRAY = f"""std_msgs/Header header
motion_capture_tracking_interfaces/NamedPose[] poses
{HEADER}{SEPARATOR}MSG: motion_capture_tracking_interfaces/NamedPose
string name
geometry_msgs/Pose pose
{GEOMETRY}"""
TF_MESSAGE = f"""geometry_msgs/TransformStamped[] transforms
{HEADER}{SEPARATOR}MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{SEPARATOR}MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{SEPARATOR}MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{GEOMETRY}"""


def header(stamp, frame="mocap"):
    return {"stamp": dict(zip(("sec", "nanosec"), divmod(int(stamp), 10**9), strict=True)), "frame_id": frame}


def point(values):
    return dict(zip("xyz", values.tolist(), strict=True))


def rotation(values):
    return dict(zip("wxyz", values.tolist(), strict=True))


def pose(frame, body):
    return {
        "position": point(POSITIONS[frame, body]),
        "orientation": rotation(QUATERNIONS[frame, body]),
    }


def expected_poses(frame):
    return [body for body in range(3) if not HIDDEN[frame, body]]


def named_poses(frame):
    poses = [{"name": BODIES[body], "pose": pose(frame, body)} for body in expected_poses(frame)]
    return [("/poses", {"header": header(STAMPS[frame]), "poses": poses})]


def stamped_poses(frame):
    """As a driver does that looks at the clock anew for each body."""
    return [
        (
            f"/vrpn/{BODIES[body]}/pose",
            {"header": header(STAMPS[frame] + 1000 * body), "pose": pose(frame, body)},
        )
        for body in expected_poses(frame)
    ]


def pose_array(frame):
    poses = [pose(frame, body) for body in range(3)]
    return [("/poses", {"header": header(STAMPS[frame]), "poses": poses})]


def link(frame, body):
    """When, and in what frame, a body is at which place and turn."""
    return STAMPS[frame], "mocap", BODIES[body], POSITIONS[frame, body], QUATERNIONS[frame, body]


def ros_transform(stamp, parent, child, place, turn):
    transform = {"translation": point(place), "rotation": rotation(turn)}
    return {"header": header(stamp, parent), "child_frame_id": child, "transform": transform}


def foxglove_transform(stamp, parent, child, place, turn):
    return {
        "timestamp": foxglove_time(stamp), "parent_frame_id": parent, "child_frame_id": child,
        "translation": point(place), "rotation": rotation(turn),
    }  # fmt: skip


def tf_together(frame):
    return [("/tf", {"transforms": [ros_transform(*link(frame, body)) for body in expected_poses(frame)]})]


def tf_apart(frame):
    return [("/tf", {"transforms": [ros_transform(*link(frame, body))]}) for body in expected_poses(frame)]


def markers(frame):
    """Of three markers, two go by their number; hidden ones are missing, so that places and numbers differ."""
    return [
        (
            "/markers",
            {
                "header": header(STAMPS[frame]),
                "frame_number": frame,
                "markers": [
                    {
                        "id_type": 1,
                        "marker_index": body,
                        "marker_name": "base" if body == 0 else "",
                        "translation": point(POSITIONS[frame, body]),
                    }
                    for body in expected_poses(frame)
                ],
            },
        )
    ]


def foxglove_time(stamp):
    return dict(zip(("sec", "nsec"), divmod(int(stamp), 10**9), strict=True))


def foxglove_transforms(frame):
    return [("/tf", {"transforms": [foxglove_transform(*link(frame, body)) for body in expected_poses(frame)]})]


def foxglove_transforms_apart(frame):
    return [("/tf", foxglove_transform(*link(frame, body))) for body in expected_poses(frame)]


def foxglove_poses(frame):
    poses = [pose(frame, body) for body in range(3)]
    return [("/poses", {"timestamp": foxglove_time(STAMPS[frame]), "frame_id": "mocap", "poses": poses})]


def foxglove_pose(frame):
    return [
        (
            f"/mocap/{BODIES[body]}",
            {"timestamp": foxglove_time(STAMPS[frame]), "frame_id": "mocap", "pose": pose(frame, body)},
        )
        for body in expected_poses(frame)
    ]


ROS = {
    "named": ("motion_capture_tracking_interfaces/msg/NamedPoseArray", NAMED_POSE_ARRAY, named_poses),
    "stamped": ("geometry_msgs/msg/PoseStamped", POSE_STAMPED, stamped_poses),
    "array": ("geometry_msgs/msg/PoseArray", POSE_ARRAY, pose_array),
    "tf": ("tf2_msgs/msg/TFMessage", TF_MESSAGE, tf_together),
    "tf apart": ("tf2_msgs/msg/TFMessage", TF_MESSAGE, tf_apart),
    "markers": ("mocap4r2_msgs/msg/Markers", MARKERS, markers),
}
FOXGLOVE = {
    "transforms": (FrameTransforms, foxglove_transforms),
    "transform": (FrameTransform, foxglove_transforms_apart),
    "poses": (PosesInFrame, foxglove_poses),
    "pose": (PoseInFrame, foxglove_pose),
}
# of their kinds, those whose messages differ from the others'
UNNAMED = ("array", "poses")  # have no names, so that no body may be hidden
POSITIONS_ALONE = ("markers",)  # have no orientations
NUMBERED = ("markers",)  # have numbers of frames, and names of bodies that are such as "1"
STAMPED_APART = ("stamped",)  # have a stamp of each body, at most 2 µs apart


def at_stamps(messages, late=0):
    """(topic, content, log time) of all frames, of which `messages` gives topics and contents, logged `late` ns."""
    return [(topic, content, STAMPS[i] + late) for i in range(COUNT) for topic, content in messages(i)]


def in_ros(path, schema, definition, messages):
    """A log of (topic, content, log time)."""
    with open(path, "wb") as file, RosWriter(file, chunk_size=4096) as writer:
        kind = writer.register_msgdef(schema, definition)
        for topic, content, logged in messages:
            writer.write_message(topic, kind, content, int(logged))
    return path


def in_foxglove(path, encoding, message, messages):
    """The same of a schema of Foxglove's, in JSON or Protobuf."""
    with open(path, "wb") as file:
        writer, channels = Writer(file, chunk_size=4096), {}
        writer.start()
        kind = ("jsonschema", b'{"type": "object"}')
        if encoding == "protobuf":
            kind = ("protobuf", build_file_descriptor_set(message).SerializeToString())
        schema = writer.register_schema(message.DESCRIPTOR.full_name, *kind)
        for topic, content, logged in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, encoding, schema)
            data = json.dumps(content).encode() if encoding == "json" else protobuf(message, content)
            writer.add_message(channels[topic], int(logged), data, int(logged))
        writer.finish()
    return path


def write(path, encoding, kind):
    """The motion in a schema of the registry."""
    if encoding == "ros":
        schema, definition, messages = ROS[kind]
        return in_ros(path, schema, definition, at_stamps(messages, 3_000_000))
    message, messages = FOXGLOVE[kind]
    return in_foxglove(path, encoding, message, at_stamps(messages, 3_000_000))


def protobuf(kind, content):
    """Serialised; protobuf writes times in its own way."""
    text = json.dumps(content)
    message = ParseDict(json.loads(text, object_hook=_without_time), kind())
    if "timestamp" in content:
        message.timestamp.FromNanoseconds(int(content["timestamp"]["sec"]) * 10**9 + content["timestamp"]["nsec"])
    for child, plain in zip(getattr(message, "transforms", ()), content.get("transforms", ()), strict=True):
        child.timestamp.FromNanoseconds(plain["timestamp"]["sec"] * 10**9 + plain["timestamp"]["nsec"])
    return message.SerializeToString()


def _without_time(fields):
    return {key: value for key, value in fields.items() if key != "timestamp"}


def a_session(**keys):
    trial = {"file": "log.mcap", "experiment": "release", "split": "identify"}
    return Session.model_validate({"frame": {"up": [0, 0, 1]}, "base": "base", "trials": [trial], **keys})


CASES = [("ros", kind) for kind in ROS] + [(e, kind) for e in ("json", "protobuf") for kind in FOXGLOVE]


@pytest.mark.parametrize(("encoding", "kind"), CASES)
def test_poses_come_back_as_written(tmp_path, encoding, kind):
    path = write(tmp_path / "log.mcap", encoding, kind)
    unnamed = kind in UNNAMED
    poses = open_log(path, a_session(bodies=list(BODIES)) if unnamed else a_session()).poses
    assert poses.undecodable == 0
    names = ("base", "1", "2") if kind in NUMBERED else BODIES
    assert set(poses.names) == set(names)
    columns = [poses.names.index(name) for name in names]
    hidden = np.zeros_like(HIDDEN) if unnamed else HIDDEN
    shown = ~hidden.all(axis=1) if kind not in NUMBERED else np.ones(COUNT, bool)
    np.testing.assert_array_equal(poses.present[:, columns], ~hidden[shown])
    np.testing.assert_array_equal(
        poses.positions[:, columns], np.where(hidden[..., None], np.nan, POSITIONS)[shown]
    )
    if kind in NUMBERED:
        np.testing.assert_array_equal(poses.frames, np.arange(COUNT))
    if kind in POSITIONS_ALONE:
        assert poses.quaternions is None
    else:
        np.testing.assert_array_equal(
            poses.quaternions[:, columns], np.where(hidden[..., None], np.nan, QUATERNIONS)[shown]
        )
    assert np.abs(poses.stamps - STAMPS[shown]).max() <= (2000 if kind in STAMPED_APART else 0)


def test_late_samples_of_another_body_join_their_frame(tmp_path):
    """The second body's messages arrive two frames late; its clock is a millisecond off."""
    messages = [
        (f"/{BODIES[body]}", {"header": header(STAMPS[frame] + off), "pose": pose(frame, body)},
         STAMPS[frame] + late * 8_333_333 + body)
        for frame in range(COUNT) for body, late, off in ((0, 0, 0), (1, 2, 1_000_000))
    ]  # fmt: skip
    poses = open_log(in_ros(tmp_path / "log.mcap", *ROS["stamped"][:2], messages), a_session()).poses
    assert poses.present.all()
    order = [poses.names.index(name) for name in BODIES[:2]]
    np.testing.assert_array_equal(poses.positions[:, order], POSITIONS[:, :2])
    assert np.abs(poses.stamps - STAMPS).max() <= 1_000_000


def test_poses_without_names_need_some(tmp_path):
    path = write(tmp_path / "log.mcap", "ros", "array")
    with pytest.raises(InputError, match=r"/poses: found 3 poses without names, expected `bodies`"):
        open_log(path, a_session())
    with pytest.raises(InputError, match=r"/poses: no message fits its schema .* with 2 `bodies`"):
        open_log(path, a_session(bodies=["base", "unit_1"]))


def test_topics_can_be_given_by_body(tmp_path):
    path = write(tmp_path / "log.mcap", "ros", "stamped")
    wanted = {"poses": {"base": "/vrpn/base/pose", "tip": "/vrpn/unit_2/pose"}}
    poses = open_log(path, a_session(topics=wanted)).poses
    assert poses.names == ("base", "tip")
    np.testing.assert_array_equal(poses.positions[poses.present[:, 1], 1], POSITIONS[~HIDDEN[:, 2], 2])


@pytest.mark.parametrize(
    ("encoding", "schema_encoding", "encoding_found"),
    [("ros1", "ros1msg", "encoding 'ros1'"), ("cdr", "ros2idl", "schema in 'ros2idl'")],
)
def test_other_encodings_are_refused_by_name(tmp_path, encoding, schema_encoding, encoding_found):
    path = tmp_path / "log.mcap"
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("geometry_msgs/msg/PoseArray", schema_encoding, b"")
        channel = writer.register_channel("/poses", encoding, schema)
        writer.add_message(channel, 0, b"\0\1\0\0", 0)
        writer.finish()
    with pytest.raises(InputError, match=rf"log\.mcap: /poses: found (a )?{encoding_found}"):
        open_log(path, a_session())


def in_frames(path, frames):
    """PoseStamped of each body, in frames by body and number of its message."""
    def messages(number):
        return [
            (f"/vrpn/{name}/pose", {"header": header(STAMPS[number], frames(body, number)), "pose": pose(number, body)})
            for body, name in enumerate(BODIES)
        ]

    return in_ros(path, *ROS["stamped"][:2], at_stamps(messages))


@pytest.mark.parametrize(
    "frames",
    [
        lambda body, number: "camera" if body == 2 else "mocap",
        lambda body, number: "camera" if body == 0 else "mocap",
        lambda body, number: "camera" if number == COUNT // 2 else "mocap",
    ],
)
def test_poses_in_several_frames_are_refused_with_topics_and_frames(tmp_path, frames):
    with pytest.raises(InputError, match=r"header.frame_id: .*'mocap' \(/vrpn/\w+/pose.*expected all of them in one"):
        open_log(in_frames(tmp_path / "log.mcap", frames), a_session())


@pytest.mark.parametrize(
    "frames",
    [
        lambda body, number: "/mocap" if body == 2 else "mocap",
        lambda body, number: "" if body == 2 else "mocap",
        lambda body, number: BODIES[body],  # as some drivers do
    ],
)
def test_frames_that_are_one_are_left(tmp_path, frames):
    assert open_log(in_frames(tmp_path / "log.mcap", frames), a_session()).poses.names == BODIES


def test_a_body_that_is_left_out_may_be_in_another_frame(tmp_path):
    path = in_frames(tmp_path / "log.mcap", lambda body, number: "camera" if body == 2 else "mocap")
    assert open_log(path, a_session(markers={BODIES[1]: BODIES[1]})).poses.names == BODIES
