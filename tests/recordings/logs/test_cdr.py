"""The batched decoder against the reference one, and on messages that are not what their schema says."""

import struct

import numpy as np
import pytest
from mcap_ros2.decoder import DecoderFactory

from tests.support.sessions import curl_truth, instruments, record
from trunkline.recordings.logs.cdr import decode, parse_definition, short_name
from trunkline.recordings.logs.definitions import JOINT_STATE, RIGID_BODIES
from trunkline.recordings.logs.mcap_log import read_log
from trunkline.recordings.logs.messages import JOINTS, POSES


class Schema:
    def __init__(self, topic):
        self.id, self.name, self.encoding, self.data = (
            1,
            topic.schema,
            "ros2msg",
            topic.definition,
        )


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Half of the bodies hidden at some time, so that layouts vary."""
    folder = tmp_path_factory.mktemp("session")
    record(folder, [curl_truth()], instruments(occlusions_per_s=2.0))
    return read_log(folder / "curl_40.mcap")


@pytest.mark.parametrize("name", ["/rigid_bodies", "/tendon_commands", "/tendon_states"])
def test_batches_equal_the_reference_decoder(log, name):
    topic = log.topics[name]
    reader = {**POSES, **JOINTS}[short_name(topic.schema)]
    reference = DecoderFactory().decoder_for("cdr", Schema(topic))
    count, layouts = 0, 0
    for rows, message in decode(
        topic.messages, topic.schema, parse_definition(topic.schema, topic.definition.decode())
    ):
        batch = reader(message)
        layouts += 1
        for place, row in enumerate(rows):
            single = reader(reference(topic.messages[row]))
            assert list(single.names) == list(batch.names)
            for got, expected in zip(batch, single, strict=True):
                if isinstance(expected, np.ndarray):
                    np.testing.assert_array_equal(got[place], expected)
            count += 1
    assert count == len(topic.messages)
    assert layouts > 3 or name != "/rigid_bodies"


def test_big_endian_markers_and_padding():
    """A body with two markers, written byte by byte in the other byte order."""
    data = bytearray(b"\0\0\0\0")

    def put(form, *values):
        size = struct.calcsize(">" + form[-1])
        data.extend(b"\xaa" * (-(len(data) - 4) % size))  # padding may hold anything
        data.extend(struct.pack(">" + form, *values))

    def text(value):
        put("I", len(value) + 1)
        data.extend(value.encode() + b"\0")

    put("i", 7)
    put("I", 500)
    text("m")
    put("I", 42)
    put("I", 1)
    text("tip")
    put("I", 2)
    for index in range(2):
        put("b", 1)
        put("i", index)
        text("x" * index)
        put("3d", 9.0, 9.0, 9.0)
    put("7d", 1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.9)
    schema = "mocap4r2_msgs/msg/RigidBodies"
    ((rows, message),) = decode([bytes(data)] * 3, schema, parse_definition(schema, RIGID_BODIES))
    poses = POSES[short_name(schema)](message)
    assert list(rows) == [0, 1, 2]
    assert poses.names == ["tip"]
    assert poses.time.tolist() == [7_000_000_500] * 3
    np.testing.assert_array_equal(poses.positions, np.tile([1.0, 2.0, 3.0], (3, 1, 1)))
    np.testing.assert_array_equal(poses.orientations[0, 0], [0.9, 0.1, 0.2, 0.3])


def test_messages_that_do_not_fit_are_left_out(log):
    topic = log.topics["/tendon_states"]
    broken = [*topic.messages[:5], topic.messages[0][:-3], b"", b"\0\1\0\0" + b"\xff" * 60]
    definitions = parse_definition(topic.schema, topic.definition.decode())
    decoded = np.concatenate([rows for rows, _ in decode(broken, topic.schema, definitions)])
    assert sorted(decoded) == [0, 1, 2, 3, 4]


def test_definitions_with_constants_bounds_and_defaults():
    text = 'int8 A=1\nstring NAME = "a # b"\nfloat64[3] p  # m\nuint8[<=4] few\nstring<=8 label "x"\nHeader header\n'
    fields = parse_definition("some_msgs/msg/Thing", text)["some_msgs/Thing"]
    assert [(f.name, f.kind, f.count) for f in fields] == [
        ("p", "float64", 3),
        ("few", "uint8", 0),
        ("label", "string", None),
        ("header", "std_msgs/Header", None),
    ]
    assert (
        parse_definition("sensor_msgs/msg/JointState", JOINT_STATE)["builtin_interfaces/Time"][0].name
        == "sec"
    )
