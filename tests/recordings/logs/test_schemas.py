"""Every schema of the registry: the same motion written in each comes back the same."""

import json

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from google.protobuf.json_format import ParseDict
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as RosWriter
from scipy.spatial.transform import Rotation

from tests.support.sessions import curl_truth, instruments, record
from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.logs.definitions import HEADER, MARKERS, RIGID_BODIES, SEPARATOR
from trunkline.recordings.session.session import Session, read_session
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
FLOAT_ARRAY = f"""std_msgs/MultiArrayLayout layout
float64[] data
{SEPARATOR}MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
{SEPARATOR}MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""


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


def transforms(frame):
    return [
        {
            "header": header(STAMPS[frame]),
            "child_frame_id": BODIES[body],
            "transform": {
                "translation": point(POSITIONS[frame, body]),
                "rotation": rotation(QUATERNIONS[frame, body]),
            },
        }
        for body in expected_poses(frame)
    ]


def tf_together(frame):
    return [("/tf", {"transforms": transforms(frame)})]


def tf_apart(frame):
    return [("/tf", {"transforms": [transform]}) for transform in transforms(frame)]


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


def foxglove_time(frame):
    return dict(zip(("sec", "nsec"), divmod(int(STAMPS[frame]), 10**9), strict=True))


def foxglove_transform(frame, body):
    return {
        "timestamp": foxglove_time(frame),
        "parent_frame_id": "mocap",
        "child_frame_id": BODIES[body],
        "translation": point(POSITIONS[frame, body]),
        "rotation": rotation(QUATERNIONS[frame, body]),
    }


def foxglove_transforms(frame):
    return [("/tf", {"transforms": [foxglove_transform(frame, body) for body in expected_poses(frame)]})]


def foxglove_transforms_apart(frame):
    return [("/tf", foxglove_transform(frame, body)) for body in expected_poses(frame)]


def foxglove_poses(frame):
    poses = [pose(frame, body) for body in range(3)]
    return [("/poses", {"timestamp": foxglove_time(frame), "frame_id": "mocap", "poses": poses})]


def foxglove_pose(frame):
    return [
        (
            f"/mocap/{BODIES[body]}",
            {"timestamp": foxglove_time(frame), "frame_id": "mocap", "pose": pose(frame, body)},
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


def write_ros(path, kind):
    name, definition, messages = ROS[kind]
    with open(path, "wb") as file, RosWriter(file, chunk_size=4096) as writer:
        schema = writer.register_msgdef(name, definition)
        for frame in range(COUNT):
            for topic, content in messages(frame):
                writer.write_message(topic, schema, content, int(STAMPS[frame]) + 3_000_000)


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


def write_foxglove(path, kind, encoding):
    message, messages = FOXGLOVE[kind]
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=4096)
        writer.start()
        if encoding == "json":
            schema = writer.register_schema(message.DESCRIPTOR.full_name, "jsonschema", b'{"type": "object"}')
        else:
            descriptors = build_file_descriptor_set(message).SerializeToString()
            schema = writer.register_schema(message.DESCRIPTOR.full_name, "protobuf", descriptors)
        channels = {}
        for frame in range(COUNT):
            for topic, content in messages(frame):
                if topic not in channels:
                    channels[topic] = writer.register_channel(topic, encoding, schema)
                data = json.dumps(content).encode() if encoding == "json" else protobuf(message, content)
                logged = int(STAMPS[frame]) + 3_000_000
                writer.add_message(channels[topic], logged, data, logged)
        writer.finish()


def a_session(**keys):
    trial = {"file": "log.mcap", "experiment": "release", "split": "identify"}
    return Session.model_validate({"frame": {"up": [0, 0, 1]}, "base": "base", "trials": [trial], **keys})


CASES = [("ros", kind) for kind in ROS] + [(e, kind) for e in ("json", "protobuf") for kind in FOXGLOVE]


@pytest.mark.parametrize(("encoding", "kind"), CASES)
def test_poses_come_back_as_written(tmp_path, encoding, kind):
    path = tmp_path / "log.mcap"
    if encoding == "ros":
        write_ros(path, kind)
    else:
        write_foxglove(path, kind, encoding)
    unnamed = kind in ("array", "poses")
    poses = open_log(path, a_session(bodies=list(BODIES)) if unnamed else a_session()).poses
    assert poses.undecodable == 0
    names = ("base", "1", "2") if kind == "markers" else BODIES
    assert set(poses.names) == set(names)
    columns = [poses.names.index(name) for name in names]
    hidden = np.zeros_like(HIDDEN) if unnamed else HIDDEN
    shown = ~hidden.all(axis=1) if kind != "markers" else np.ones(COUNT, bool)
    np.testing.assert_array_equal(poses.present[:, columns], ~hidden[shown])
    np.testing.assert_array_equal(
        poses.positions[:, columns], np.where(hidden[..., None], np.nan, POSITIONS)[shown]
    )
    if kind == "markers":
        assert poses.quaternions is None
        np.testing.assert_array_equal(poses.frames, np.arange(COUNT))
    else:
        np.testing.assert_array_equal(
            poses.quaternions[:, columns], np.where(hidden[..., None], np.nan, QUATERNIONS)[shown]
        )
    assert np.abs(poses.stamps - STAMPS[shown]).max() <= (2000 if kind == "stamped" else 0)


def test_late_samples_of_another_body_join_their_frame(tmp_path):
    """The second body's messages arrive two frames late; its clock is a millisecond off."""
    path = tmp_path / "log.mcap"
    with open(path, "wb") as file, RosWriter(file) as writer:
        schema = writer.register_msgdef("geometry_msgs/msg/PoseStamped", POSE_STAMPED)
        for frame in range(COUNT):
            for body, late, off in ((0, 0, 0), (1, 2, 1_000_000)):
                content = {"header": header(STAMPS[frame] + off), "pose": pose(frame, body)}
                writer.write_message(f"/{BODIES[body]}", schema, content, int(STAMPS[frame]) + late * 8_333_333 + body)
    poses = open_log(path, a_session()).poses
    assert poses.present.all()
    order = [poses.names.index(name) for name in BODIES[:2]]
    np.testing.assert_array_equal(poses.positions[:, order], POSITIONS[:, :2])
    assert np.abs(poses.stamps - STAMPS).max() <= 1_000_000


def test_poses_without_names_need_some(tmp_path):
    path = tmp_path / "log.mcap"
    write_ros(path, "array")
    with pytest.raises(InputError, match=r"/poses: found 3 poses without names, expected `bodies`"):
        open_log(path, a_session())
    with pytest.raises(InputError, match=r"/poses: no message fits its schema .* with 2 `bodies`"):
        open_log(path, a_session(bodies=["base", "unit_1"]))


def test_topics_can_be_given_by_body(tmp_path):
    path = tmp_path / "log.mcap"
    write_ros(path, "stamped")
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


def rewrite_motors(source, target):
    """The log `source` with the motors' messages as float arrays without a stamp."""
    with open(source, "rb") as file, open(target, "wb") as out, RosWriter(out) as writer:
        floats = writer.register_msgdef("std_msgs/msg/Float64MultiArray", FLOAT_ARRAY)
        bodies = writer.register_msgdef("mocap4r2_msgs/msg/RigidBodies", RIGID_BODIES)
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, content in reader.iter_decoded_messages():
            if schema.name.endswith("JointState"):
                plain = {"layout": {"dim": [], "data_offset": 0}, "data": list(content.position)}
                writer.write_message(channel.topic, floats, plain, message.log_time)
            else:
                writer.write_message(channel.topic, bodies, content, message.log_time)


def test_float_arrays_count_by_log_time(tmp_path):
    record(tmp_path, [curl_truth()], instruments())
    limits = TrialLimits(duration=0.5, coverage=0.3, disorder=0.1, clock_offset=1.0)
    ((_, stamped, _),) = load_raw_trials(tmp_path, read_session(tmp_path), limits)
    log = tmp_path / "curl_40.mcap"
    original = log.rename(tmp_path / "original.log")
    rewrite_motors(original, log)
    ((_, refused, _),) = load_raw_trials(tmp_path, read_session(tmp_path), limits)
    assert "/tendon_commands: found 3 numbers without names, expected `tendons`" in str(refused)
    with open(tmp_path / "session.yaml", "a") as file:
        file.write("tendons: [tendon_1, tendon_2, tendon_3]\n")
    ((_, raw, findings),) = load_raw_trials(tmp_path, read_session(tmp_path), limits)
    assert raw.tendons == stamped.tendons
    # the recorder dates all messages by one clock, so that of the offset of 137 ms only the delivery's jitter is left
    pulls = np.interp(raw.command_time, stamped.command_time - 0.137, stamped.commands[:, 0])
    np.testing.assert_allclose(raw.commands[:, 0], pulls, atol=2e-3)
    assert findings.by_log_times.offset == pytest.approx(0, abs=0.02)
    assert abs(raw.command_time[0]) < 0.02


def in_frames(path, frames):
    """PoseStamped of each body, in frames by body and number of its message."""
    with open(path, "wb") as file, RosWriter(file) as writer:
        schema = writer.register_msgdef("geometry_msgs/msg/PoseStamped", POSE_STAMPED)
        for number in range(COUNT):
            for body, name in enumerate(BODIES):
                content = {"header": header(STAMPS[number], frames(body, number)), "pose": pose(number, body)}
                writer.write_message(f"/vrpn/{name}/pose", schema, content, int(STAMPS[number]))
    return path


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
