"""What is fast, in binary: one table of both directions. Little-endian, no padding; docs/live-sessions.md tells the
rest.

A message is a head and rows of float32. Positions in m, in the rigid robot's base frame, z up; quaternions w first.
What a client sends of its controllers is in its own reference frame, in which `hello` says how it stands.
"""

import struct
from dataclasses import dataclass

import numpy as np

from trunkline.errors import InputError

VERSION = 1

Field = tuple[str, str]  # name, and u8, u16, u32 or f64

HEAD: tuple[Field, ...] = (("type", "u8"), ("flags", "u8"), ("count", "u16"), ("sequence", "u32"), ("time", "f64"))
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
HAND = (*POSE, "trigger", "grip", "stick_x", "stick_y", "stick_pressed", "primary", "secondary")
POINT = ("x", "y", "z")
HANDS = ("left", "right")

# Poses that follow those of the model's bodies in a frame of the robot; numbers that are not there are NaN.
MARKERS = ("left_ray", "right_ray", "rigid_target", "tip_target")


@dataclass(frozen=True)
class BinaryMessage:
    """A binary message. row: the float32 numbers of a row. flags: by bit, from the lowest. The three others say in
    words what fields of the head hold."""

    number: int
    row: tuple[str, ...]
    flags: tuple[str, ...]
    count: str
    sequence: str
    time: str


FROM_SERVER = {
    "robot": BinaryMessage(
        1, POSE, ("moving", "stopped", "stale"), "rows: the bodies of the scene, then the markers",
        "number of the frame", "s of the server's clock at which the robot was so",
    ),
    "preview": BinaryMessage(
        2, POSE, ("last",), "bodies of the scene; as many rows for each frame of the piece, one frame after the other",
        "number of the piece's first frame in the preview", "s of the plan at that frame",
    ),
    "shell": BinaryMessage(
        3, POINT, (), "rows: points of the reach of the tip, `around` × `along` of the scene, along fastest; in the "
        "frame of the marker rigid_target", "number of the shell", "s of the server's clock",
    ),
}  # fmt: skip
FROM_CLIENT = {
    "input": BinaryMessage(
        16, HAND, ("left_tracked", "right_tracked", "visible", "drawn", "correct"), "2: the left, then the right hand",
        "binary messages received so far, on this connection", "s of the client's clock at which the poses were so",
    ),
    "view": BinaryMessage(
        19, POSE, ("tracked",), "1: the viewer's eyes, in the client's reference frame",
        "binary messages received so far, on this connection", "s of the client's clock at which they were there",
    ),
    "ack": BinaryMessage(
        17, (), (), "0", "binary messages received so far, on this connection", "s of the client's clock"
    ),
    "stop": BinaryMessage(
        18, (), (), "0", "binary messages received so far, on this connection", "s of the client's clock"
    ),
}  # fmt: skip

_CODES = {"u8": "B", "u16": "H", "u32": "I", "f64": "d"}
_HEAD = struct.Struct("<" + "".join(_CODES[kind] for _, kind in HEAD))
HEAD_BYTES = _HEAD.size
INPUT_BYTES = HEAD_BYTES + 4 * len(HAND) * len(HANDS)
ROWS = {"input": len(HANDS), "view": 1}
BY_NUMBER = {kind.number: name for name, kind in FROM_CLIENT.items()}


@dataclass(frozen=True)
class Received:
    """A client's binary message: `kind` of FROM_CLIENT, its `flags` that are set, `received` by the client so far,
    `stamp` s of its clock, and `hands` (2, 14), float64, of an input, else (0, 14), or the `view` (7,) of one."""

    kind: str
    flags: frozenset[str]
    received: int
    stamp: float
    hands: np.ndarray
    view: np.ndarray | None = None


def frame(kind: str, flags: set[str], count: int, sequence: int, time: float, rows: np.ndarray) -> bytes:
    """A message of the server.

    Args:
        rows: numbers, of any shape whose size is a multiple of what a row of `kind` has.
    """
    entry = FROM_SERVER[kind]
    bits = sum(1 << bit for bit, name in enumerate(entry.flags) if name in flags)
    return _HEAD.pack(entry.number, bits, count, sequence, time) + np.ascontiguousarray(rows, dtype="<f4").tobytes()


def read(message: bytes) -> Received:
    """A client's message.

    Raises:
        InputError: it is none; what is in the rows may still be no numbers.
    """
    if len(message) < HEAD_BYTES:
        raise InputError(f"message: found {len(message)} bytes, expected a head of {HEAD_BYTES}")
    number, bits, count, received, stamp = _HEAD.unpack_from(message)
    if number not in BY_NUMBER:
        raise InputError(f"message: found type {number}, expected one of {', '.join(map(str, BY_NUMBER))}")
    name = BY_NUMBER[number]
    kind, rows = FROM_CLIENT[name], ROWS.get(name, 0)
    size = HEAD_BYTES + 4 * rows * len(kind.row)
    if count != rows or len(message) != size:
        raise InputError(f"{name}: found {count} rows in {len(message)} bytes, expected {rows} in {size}")
    if bits >> len(kind.flags):
        raise InputError(f"{name}: found flags {bits:#x}, expected {len(kind.flags)} bits")
    flags = frozenset(flag for bit, flag in enumerate(kind.flags) if bits >> bit & 1)
    numbers = np.frombuffer(message, "<f4", offset=HEAD_BYTES).astype(float)
    if name == "view":
        return Received(name, flags, received, stamp, np.empty((0, len(HAND))), numbers)
    return Received(name, flags, received, stamp, numbers.reshape(-1, len(HAND)))
