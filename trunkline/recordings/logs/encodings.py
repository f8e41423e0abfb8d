"""A topic's messages, decoded by the encoding and the schema that the log itself names."""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace

import lz4.frame
import numpy as np
import zstandard
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from trunkline.recordings.logs import cdr
from trunkline.recordings.logs.definitions import BEFORE, KNOWN
from trunkline.recordings.logs.mcap_log import Topic
from trunkline.recordings.logs.records import LARGEST_EXPANSION

ENCODINGS = {"cdr": "ros2msg", "protobuf": "protobuf", "json": None}  # to the schema's encoding, None: any
ZSTD, LZ4 = b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"  # with which a compressed message begins
# by the first two bytes of a message: encapsulations beside plain CDR (RTPS 2.5, table 10.3)
ENCAPSULATIONS = {
    0x02: "PL_CDR", 0x03: "PL_CDR", 0x06: "CDR2", 0x07: "CDR2", 0x08: "D_CDR2", 0x09: "D_CDR2", 0x0A: "PL_CDR2",
    0x0B: "PL_CDR2",
}  # fmt: skip
# numbers and texts that JSON leaves out where they are 0 or empty, each with all that its object may have beside it
VECTOR, POSE = frozenset("xyzw"), frozenset({"position", "orientation"})
TRANSFORM = frozenset({"timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"})
JSON_ZEROS = (
    dict.fromkeys("xyzw", (VECTOR, lambda: 0.0))
    | dict.fromkeys(POSE, (POSE, lambda: _Fields()))
    | dict.fromkeys(("translation", "rotation"), (TRANSFORM, lambda: _Fields()))
    | dict.fromkeys(("parent_frame_id", "child_frame_id"), (TRANSFORM, str))
)


class _Fields(SimpleNamespace):
    """An object of JSON."""

    def __getattr__(self, name: str):
        beside, zero = JSON_ZEROS.get(name, (frozenset(), None))
        if zero is None or not vars(self).keys() <= beside:
            raise AttributeError(name)
        return zero()


def readable_topic(topic: Topic) -> tuple[Topic, list[str]]:
    """The topic with its messages as they were sent and with a definition, and what that took, a sentence each.

    Raises:
        ValueError: no message can be read, with a reason that the log itself shows.
    """
    notes = []
    packed = sum(data[:4] in (ZSTD, LZ4) for data in topic.messages)
    if packed and packed == len(topic.messages):
        topic = replace(topic, messages=[_unpacked(data) for data in topic.messages])
        notes.append(f"{topic.name}: messages that are compressed one by one unpacked")
    if topic.encoding != "cdr":
        return topic, notes
    kinds = Counter(data[1] for data in topic.messages if len(data) >= cdr.HEADER)
    kind = kinds.most_common(1)[0][0] if kinds else 0
    if kind > 1 and not kinds[0] + kinds[1]:
        name = ENCAPSULATIONS.get(kind, f"0x{kind:04x}")
        raise ValueError(f"found messages in the encapsulation {name}, expected plain CDR, which ROS 2 writes unless a "
                         "QoS profile of the middleware sets another data representation: set XCDR1 there")  # fmt: skip
    if topic.schema_encoding in ("", "ros2msg") and not topic.definition.strip():
        name = cdr.short_name(topic.schema)
        usual = KNOWN.get(name)
        if usual is None:
            raise ValueError(f"found no text in the schema {topic.schema}, expected its definition: where ROS knows "
                             "it, `ros2 bag convert` to MCAP writes it beside the messages")  # fmt: skip
        if name in BEFORE and not _fits(topic, usual):
            usual = BEFORE[name]
        topic = replace(topic, definition=usual.encode(), schema_encoding="ros2msg")
        notes.append(f"{topic.name}: the schema {topic.schema} has no text in the log: read by its usual definition")
    return topic, notes


def _fits(topic: Topic, definition: str) -> bool:
    """Whether some of the first messages are of a definition."""
    return any(cdr.decode(topic.messages[:10], topic.schema, cdr.parse_definition(topic.schema, definition)))


def _unpacked(data: bytes) -> bytes:
    """What was compressed; `data` itself where it is damaged, which then fits no schema."""
    most = LARGEST_EXPANSION * len(data)
    try:
        if data[:4] == ZSTD:
            return zstandard.ZstdDecompressor().stream_reader(data).read(most)
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most)
    except (zstandard.ZstdError, RuntimeError):
        return data


def decode(topic: Topic) -> Iterator[tuple[np.ndarray, object]]:
    """(rows, message): rows (n,) and a batch of n messages whose numbers are arrays (n,), or () and one message.

    Messages that do not fit their schema are left out.

    Raises:
        ValueError: no message can be read, as the encoding or the schema is not understood.
    """
    if topic.encoding not in ENCODINGS:
        raise ValueError(f"found encoding {topic.encoding!r}, expected one of {', '.join(ENCODINGS)}")
    wanted = ENCODINGS[topic.encoding]
    if wanted is not None and topic.schema_encoding != wanted:
        raise ValueError(f"found a schema in {topic.schema_encoding!r}, expected {wanted!r}")
    if topic.encoding == "cdr":
        definitions = cdr.parse_definition(topic.schema, topic.definition.decode())
        yield from cdr.decode(topic.messages, topic.schema, definitions)
        return
    read = _protobuf(topic) if topic.encoding == "protobuf" else _json
    for row, data in enumerate(topic.messages):
        try:
            message = read(data)
        except Exception:  # parsers differ in what they raise on damaged bytes; the caller counts the loss
            continue
        yield np.array(row), message


def _json(data: bytes) -> object:
    return json.loads(data, object_hook=lambda fields: _Fields(**fields))


def _protobuf(topic: Topic) -> Callable[[bytes], object]:
    try:
        read = DecoderFactory().decoder_for("protobuf", Schema(1, topic.definition, "protobuf", topic.schema))
    except Exception as error:  # a damaged descriptor fails in any way
        raise ValueError(f"its protobuf schema cannot be read: {error}") from error
    assert read is not None, "the factory declines only other encodings"
    return read
