"""Messages as other recorders, drivers and serializers leave them: read, or refused with the reason."""

import numpy as np
import pytest
import zstandard
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from mcap.writer import Writer

from tests.recordings.logs.test_schemas import (
    BODIES,
    COUNT,
    POSITIONS,
    ROS,
    STAMPS,
    a_session,
    at_stamps,
    foxglove_time,
    header,
    in_foxglove,
    in_ros,
    named_poses,
    point,
    write,
)
from trunkline.errors import InputError
from trunkline.recordings.logs.definitions import HEADER, POINT, SEPARATOR
from trunkline.recordings.logs.mcap_log import read_log
from trunkline.recordings.session.source import open_log

OLDER_MARKERS = f"""std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/Marker[] markers
{HEADER}{SEPARATOR}MSG: mocap4r2_msgs/Marker
int64 index
geometry_msgs/Point translation
{POINT}"""


def rewritten(path, change=bytes, definition=None):
    """The same log with other bytes in its messages, or another text of the schema."""
    log = read_log(path)
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        for topic in log.topics.values():
            text = topic.definition if definition is None else definition
            schema = writer.register_schema(topic.schema, topic.schema_encoding, text)
            channel = writer.register_channel(topic.name, topic.encoding, schema)
            for data, time in zip(topic.messages, topic.log_times.tolist(), strict=True):
                writer.add_message(channel, time, change(data), time)
        writer.finish()
    return path


def named(path):
    return write(path, "ros", "named")


def same_poses(path, other):
    """What is read from both is the same but for notes."""
    mine, others = (open_log(some, a_session()).poses for some in (path, other))
    assert mine.names == others.names
    np.testing.assert_array_equal(mine.positions, others.positions)
    return mine.notes


def test_messages_that_are_compressed_one_by_one_are_unpacked(tmp_path):
    packed = rewritten(named(tmp_path / "packed.mcap"), zstandard.ZstdCompressor().compress)
    (note,) = same_poses(packed, named(tmp_path / "log.mcap"))
    assert "compressed one by one" in note


def test_a_schema_without_text_is_read_by_its_usual_definition(tmp_path):
    bare = rewritten(named(tmp_path / "bare.mcap"), definition=b"")
    (note,) = same_poses(bare, named(tmp_path / "log.mcap"))
    assert "has no text in the log" in note


@pytest.mark.parametrize(("kind", "name"), [(0x07, "CDR2"), (0x0B, "PL_CDR2")])
def test_another_encapsulation_is_named(tmp_path, kind, name):
    path = rewritten(named(tmp_path / "log.mcap"), lambda data: bytes([0, kind]) + data[2:])
    with pytest.raises(InputError, match=rf"found messages in the encapsulation {name}, expected plain CDR.*XCDR1"):
        open_log(path, a_session())


def test_older_markers_go_by_their_index(tmp_path):
    def markers(frame):
        content = [{"index": body + 4, "translation": point(POSITIONS[frame, body])} for body in range(3)]
        return [("/markers", {"header": header(STAMPS[frame]), "frame_number": frame, "markers": content})]

    path = in_ros(tmp_path / "log.mcap", "mocap4r2_msgs/msg/Markers", OLDER_MARKERS, at_stamps(markers))
    poses = open_log(path, a_session(base={"position": [0, 0, 0]})).poses
    assert poses.names == ("4", "5", "6")
    np.testing.assert_array_equal(poses.positions, POSITIONS)


def test_the_second_version_of_named_poses_is_read(tmp_path):
    def content(frame):
        ((topic, message),) = named_poses(frame)
        return [(topic, message | {"timestamp": 7})]

    schema, definition, _ = ROS["named"]
    array = "motion_capture_tracking_interfaces/NamedPose[]"
    definition = definition.replace(array, f"uint64 timestamp\n{array}")
    second = in_ros(tmp_path / "second.mcap", schema + "V2", definition, at_stamps(content, 3_000_000))
    same_poses(second, named(tmp_path / "log.mcap"))


def poses_in_json(path, of):
    """A log of foxglove.PoseInFrame in JSON, a topic a body: what `of` makes of each pose."""
    def messages(frame):
        time = {key: value for key, value in foxglove_time(STAMPS[frame]).items() if value}
        return [(f"/mocap/{name}", {"timestamp": time, "frame_id": "mocap", "pose": of(frame, body)})
                for body, name in enumerate(BODIES)]  # fmt: skip

    return in_foxglove(path, "json", PoseInFrame, at_stamps(messages))


def test_numbers_that_json_leaves_out_are_zero(tmp_path):
    """The base rests in the origin, not turned: of its pose only w is written."""

    def of(frame, body):
        if body == 0:
            return {"orientation": {"w": 1}}
        return {"position": point(POSITIONS[frame, body]), "orientation": {"w": 1}}

    poses = open_log(poses_in_json(tmp_path / "log.mcap", of), a_session()).poses
    base = poses.names.index(BODIES[0])
    assert not poses.positions[:, base].any()
    np.testing.assert_array_equal(poses.quaternions[:, base], np.tile([1, 0, 0, 0], (COUNT, 1)))


def test_numbers_of_another_name_are_no_zeros(tmp_path):
    path = poses_in_json(tmp_path / "log.mcap", lambda frame, body: {"pos": {"x": 1}, "orientation": {"w": 1}})
    with pytest.raises(InputError, match="no message fits its schema .*: it has no position$"):
        open_log(path, a_session())
