"""A topic's messages, decoded by the encoding and the schema that the log itself names."""

import json
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from trunkline.recordings.logs import cdr
from trunkline.recordings.logs.mcap_log import Topic

ENCODINGS = {"cdr": "ros2msg", "protobuf": "protobuf", "json": None}  # to the schema's encoding, None: any


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
    return json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))


def _protobuf(topic: Topic) -> Callable[[bytes], object]:
    try:
        read = DecoderFactory().decoder_for("protobuf", Schema(1, topic.definition, "protobuf", topic.schema))
    except Exception as error:  # a damaged descriptor fails in any way
        raise ValueError(f"its protobuf schema cannot be read: {error}") from error
    assert read is not None, "the factory declines only other encodings"
    return read
