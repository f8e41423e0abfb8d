"""ROS 2 messages (CDR) decoded in batches: messages of one layout become one message of columns.

Where a number lies in a CDR message depends only on the lengths and strings before it, so messages that
agree in those bytes share a layout. It is worked out once, and their numbers are then read by slicing. That is what
this module earns: many times the poses per second of the decoders in `mcap_ros2` and `rosbags`, from a log to the same
arrays (docs/measurements/speed.md).
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

NUMBERS = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    **{f"{kind}{bits}": f"{kind[0]}{bits // 8}" for kind in ("int", "uint") for bits in (8, 16, 32, 64)},
    "float32": "f4",
    "float64": "f8",
}
HEADER = 4  # bytes of encapsulation; alignment counts from behind them

Definitions = dict[str, list["MessageField"]]


@dataclass(frozen=True)
class MessageField:
    """kind: a number type, "string" or a message type. count: None for one, 0 a sequence, n an array."""

    name: str
    kind: str
    count: int | None


@dataclass
class Numbers:
    """Where a leaf lies: `count` numbers at byte `offset`, or one (count None)."""

    offset: int
    dtype: np.dtype
    count: int | None


@dataclass
class Layout:
    """The tree of one message's fields; `structure` are the bytes (lengths, strings) that make the layout."""

    fields: dict
    structure: list[int] = field(default_factory=list)


def parse_definition(schema: str, text: str) -> Definitions:
    """Message type ("package/Name") to fields, from a `ros2msg` schema: definitions between lines of "="."""
    definitions: Definitions = {}
    name = short_name(schema)
    time = [MessageField("sec", "int32", None), MessageField("nanosec", "uint32", None)]
    definitions["builtin_interfaces/Time"] = definitions["builtin_interfaces/Duration"] = time
    for part in re.split(r"^={3,}\s*$", text, flags=re.MULTILINE):
        fields = []
        for line in part.splitlines():
            line = line.split("#")[0].strip()
            if line.startswith("MSG:"):
                name = short_name(line.removeprefix("MSG:").strip())
            elif line and not re.match(r"\S+\s+\w+\s*=", line):  # constants take no bytes
                fields.append(_parse_field(line, name.split("/")[0]))
        definitions[name] = fields
    return definitions


def short_name(schema: str) -> str:
    """ "package/msg/Name" as "package/Name"."""
    return schema.replace("/msg/", "/")


def _parse_field(line: str, package: str) -> MessageField:
    match = re.match(r"([\w/]+)(?:<=\d+)?(\[(<=)?(\d*)\])?\s+(\w+)", line)
    if not match:
        raise ValueError(f"message definition: cannot read {line!r}")
    kind, array, bounded, count, name = match.groups()
    if kind not in NUMBERS and kind != "string" and "/" not in kind:
        kind = "std_msgs/Header" if kind == "Header" else f"{package}/{kind}"
    size = None if not array else int(count) if count and not bounded else 0
    return MessageField(name, short_name(kind), size)


def decode(
    messages: list[bytes], schema: str, definitions: Definitions
) -> Iterator[tuple[np.ndarray, SimpleNamespace]]:
    """Messages of one schema, a batch a layout: (indices (n,), message).

    Such a message has the fields of its schema. A number is an array (n,), a sequence of numbers (n, count);
    strings and the lengths of sequences are the same within the batch. A message that does not fit its schema
    is left out.
    """
    sizes = np.array([len(message) for message in messages])
    for size in np.unique(sizes):
        pending = np.flatnonzero(sizes == size)
        data = np.frombuffer(b"".join(messages[i] for i in pending), np.uint8).reshape(len(pending), size)
        while len(pending):
            try:
                layout = _lay_out(data[0].tobytes(), short_name(schema), definitions)
            except (struct.error, UnicodeDecodeError, ValueError):
                pending, data = pending[1:], data[1:]
                continue
            same = np.all(data[:, layout.structure] == data[0, layout.structure], axis=1)
            yield pending[same], _message(layout.fields, data[same])
            pending, data = pending[~same], data[~same]


def _lay_out(data: bytes, schema: str, definitions: Definitions) -> Layout:
    """Walk one message. Raises ValueError or struct.error where it does not fit."""
    if len(data) < HEADER or data[1] > 1:
        raise ValueError("not plain CDR")
    layout = Layout({}, [1])
    order = "<" if data[1] == 1 else ">"
    position = HEADER

    def align(size: int) -> None:
        nonlocal position
        position += -(position - HEADER) % size

    def length() -> int:
        nonlocal position
        align(4)
        (count,) = struct.unpack_from(order + "I", data, position)
        layout.structure.extend(range(position, position + 4))
        position += 4
        if count > len(data):
            raise ValueError("a length beyond the message's end")
        return count

    def string() -> str:
        nonlocal position
        count = length()
        if position + count > len(data):
            raise ValueError("a string beyond the message's end")
        layout.structure.extend(range(position, position + count))
        position += count
        return data[position - count : position].rstrip(b"\0").decode()

    def read_value(kind: str):
        return string() if kind == "string" else walk(kind)

    def walk(kind: str) -> dict:
        nonlocal position
        if kind not in definitions:
            raise ValueError(f"no definition of {kind}")
        tree = {}
        for part in definitions[kind]:
            count = length() if part.count == 0 else part.count
            if part.kind in NUMBERS:
                dtype = np.dtype(order + NUMBERS[part.kind])
                if count != 0:
                    align(dtype.itemsize)
                tree[part.name] = Numbers(position, dtype, count)
                position += dtype.itemsize * (1 if count is None else count)
                if position > len(data):
                    raise ValueError("numbers beyond the message's end")
            else:
                tree[part.name] = (
                    read_value(part.kind) if count is None else [read_value(part.kind) for _ in range(count)]
                )
        if not definitions[kind]:
            position += 1  # an empty message takes one byte
        return tree

    layout.fields = walk(schema)
    return layout


def _message(fields: dict, data: np.ndarray) -> SimpleNamespace:
    """The tree of a layout with the numbers of all rows of `data` (n, bytes)."""
    return SimpleNamespace(**{name: _extract(node, data) for name, node in fields.items()})


def _extract(node, data: np.ndarray):
    if isinstance(node, Numbers):
        width = node.dtype.itemsize * (1 if node.count is None else node.count)
        columns = np.ascontiguousarray(data[:, node.offset : node.offset + width]).view(node.dtype)
        return columns[:, 0] if node.count is None else columns.reshape(len(data), node.count)
    if isinstance(node, dict):
        return _message(node, data)
    return [_extract(child, data) for child in node] if isinstance(node, list) else node
