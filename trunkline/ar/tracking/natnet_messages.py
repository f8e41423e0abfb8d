"""NatNet's messages as bytes: what a client asks, and what it has to read of the answers of OptiTrack's Motive.

Motive 2 streams NatNet 3.x, Motive 3 NatNet 4.x. All is little-endian. A message is its kind (u16), the size of what
follows (u16), and that. Text ends with a zero byte, quaternions are xyzw, positions in m.

The layout is that of the types in NatNetTypes.h and of the data that a direct client unpacks, as OptiTrack documents
them (docs.optitrack.com, developer tools, NatNet SDK: data types), and as three public clients read them that do not
stem from this code: natnet 0.3.0 (PyPI; run with Motive 3.1.4), libmotioncapture (IMRCLab) and the crate natnet 0.1.0
(its server info confirmed with Motive 3.1.2.1).

Server info: name (256 bytes), version of the program (4 × u8) and of NatNet (4 × u8), clock frequency (u64, ticks a
second), data port (u16), whether frames are multicast (u8), and the group (4 × u8).

Model definition: how many data sets (u32); each its type (u32), from 4.1 on the size of what follows (u32), and that.

Of data sets and sections that are not sized, `DATA_SETS` and `SECTIONS` say what there is to skip.

Frame of data: its number (u32), then sections, each how many (u32), from 4.1 on the size in bytes (u32), and that:
marker sets, other markers, rigid bodies, skeletons, from 4.1 on assets, labeled markers, force plates, devices. Then
timecode (2 × u32), time (f64), and three stamps in ticks: exposed, received by the host, sent (u64 each).
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trunkline.ar.tracking.tracker import CameraFrame

CONNECT, SERVER_INFO, REQUEST_MODELS, MODELS, FRAME, DISCONNECT, KEEP_ALIVE = 0, 1, 4, 5, 7, 9, 10  # kinds
OLDEST, NAMED, SIZED, NEWEST = (3, 0), (4, 0), (4, 1), (4, 255)  # versions: read at all, with names of markers, sizes
NAME, BODY = 256, struct.Struct("<I7ffH")  # bytes; id, position, quaternion, mean error, flags of a rigid body
RIGID_BODY = 1  # type of a data set
TRACKED = 0x01  # flag of a rigid body
TEXT = "text"

Version = tuple[int, int]


@dataclass(frozen=True)
class Many:
    """A count (u32), then that many times the first block, then that many times the next."""

    blocks: tuple


# What there is to skip: so many bytes, a text, several things one after the other, or many.
Layout = int | str | tuple | Many
TEXTS, CHANNELS = Many((TEXT,)), Many((Many((4,)),))
MARKERS = {False: Many((12 + 4,)), True: Many((12 + 4, TEXT))}  # of a body's model: position, label; NAMED: name
# By type: marker set, rigid body from its parent on, skeleton, force plate, device, camera. Later types are sized.
DATA_SETS: dict[bool, list[Layout]] = {
    named: [
        (TEXT, TEXTS),
        (4 + 12, markers),
        (TEXT, 4, Many(((TEXT, 4, 4 + 12, markers),))),
        (4, TEXT, 8 + 12 + 4 * 144 + 4 * 12 + 8, TEXTS),  # id; width, length, origin, calibration, corners, types
        (4, TEXT, TEXT, 8, TEXTS),
        (TEXT, 12 + 16),
    ]
    for named, markers in MARKERS.items()
}
# Marker sets, other markers; rigid bodies stand between; skeletons, labeled markers, force plates, devices.
BEFORE: tuple[Layout, ...] = (Many(((TEXT, Many((12,))),)), Many((12,)))
AFTER: tuple[Layout, ...] = (
    Many(((4, Many((BODY.size,))),)),
    Many((26,)),
    Many(((4, CHANNELS),)),
    Many(((4, CHANNELS),)),
)


class NatNetError(ValueError):
    """A message that does not have this layout."""


@dataclass(frozen=True)
class ServerInfo:
    """version: of NatNet. ticks: of its clock a second. group: multicast address, None where frames are unicast."""

    version: Version
    ticks: int
    data_port: int
    group: str | None


def request(kind: int) -> bytes:
    """A client's message; CONNECT says "Ping", others say nothing."""
    text = b"Ping\0" if kind == CONNECT else b""
    return struct.pack("<HH", kind, len(text)) + text


def kind_of(message: bytes) -> int:
    """Which kind of message it is.

    Raises:
        NatNetError: it is not as long as it says.
    """
    kind, size = struct.unpack_from("<HH", message) if len(message) >= 4 else (-1, 0)
    if kind < 0 or len(message) - 4 < size:
        raise NatNetError(f"found a message of {len(message)} bytes, expected {4 + size} at least")
    return kind


def read_server_info(message: bytes) -> ServerInfo:
    """Raises:
    NatNetError: it is cut off, or of a version that is not read here.
    """
    reader = Reader(message)
    reader.skip(NAME + 4)
    major, minor, *_ = reader.unpack("<4B")
    if not OLDEST <= (major, minor) <= NEWEST:
        raise NatNetError(f"found NatNet {major}.{minor}, expected 3.0 or later, and below 5")
    ticks, port, multicast, *group = reader.unpack("<QHB4B")
    if not ticks:
        raise NatNetError("found a clock of 0 ticks a second, expected more")
    return ServerInfo((major, minor), ticks, port, ".".join(map(str, group)) if multicast else None)


def read_models(message: bytes, version: Version) -> dict[str, int]:
    """Rigid bodies: name to id.

    Raises:
        NatNetError: it is cut off, or two have one name.
    """
    reader, layouts = Reader(message), DATA_SETS[version >= NAMED]
    bodies: dict[str, int] = {}
    for _ in range(reader.count()):
        kind = reader.count()
        size = reader.count() if version >= SIZED else None
        begin = reader.at
        if size is None and kind >= len(layouts):
            raise NatNetError(f"found a data set of type {kind}, expected one of 0 to {len(layouts) - 1}")
        if kind == RIGID_BODY:
            name, number = reader.text(), reader.count()
            if name in bodies:
                raise NatNetError(f"found two rigid bodies {name!r}, expected each name once")
            bodies[name] = number
        reader.skip(layouts[kind] if size is None else size - (reader.at - begin))
    return bodies


def read_frame(message: bytes, info: ServerInfo, ids: Sequence[int]) -> CameraFrame:
    """Of the rigid bodies `ids`, NaN and not tracked where it has none of that id.

    Raises:
        NatNetError: it is cut off.
    """
    reader, sized = Reader(message), info.version >= SIZED
    number = reader.count()
    reader.skip_sections(BEFORE, sized)
    count = reader.count()
    reader.skip(4 if sized else 0)
    begin = reader.at
    reader.skip(BODY.size * count)
    bodies = {row[0]: row for row in BODY.iter_unpack(message[begin : reader.at])}
    reader.skip_sections((*AFTER, 0) if sized else AFTER, sized)  # with assets
    reader.skip(8 + 8)
    exposed, _, sent = reader.unpack("<QQQ")
    rows = np.array([bodies.get(body, (body, *7 * [np.nan], 0.0, 0)) for body in ids])
    tracked = rows[:, 9].astype(int) & TRACKED > 0
    return CameraFrame(number, exposed / info.ticks, sent / info.ticks, tracked, rows[:, 1:4], rows[:, [7, 4, 5, 6]])


class Reader:
    """Of a message, from behind its head on. NatNetError where it ends too soon."""

    def __init__(self, message: bytes) -> None:
        self._message, self.at = message, 4

    def skip(self, layout: Layout) -> None:
        if isinstance(layout, int):
            left = len(self._message) - self.at
            if not 0 <= layout <= left:
                raise NatNetError(f"found {left} bytes from byte {self.at} on, expected {layout} more")
            self.at += layout
        elif isinstance(layout, str):
            self.text()
        elif isinstance(layout, tuple):
            for part in layout:
                self.skip(part)
        else:
            count = self.count()
            for block in layout.blocks:
                for part in [count * block] if isinstance(block, int) else (block for _ in range(count)):
                    self.skip(part)

    def skip_sections(self, layouts: tuple[Layout, ...], sized: bool) -> None:
        """One of each layout; where sections are sized, by their sizes."""
        for layout in layouts:
            if sized:
                self.skip(4)
                self.skip(self.count())
            else:
                self.skip(layout)

    def unpack(self, layout: str) -> tuple:
        begin = self.at
        self.skip(struct.calcsize(layout))
        return struct.unpack_from(layout, self._message, begin)

    def count(self) -> int:
        return self.unpack("<I")[0]

    def text(self) -> str:
        begin, end = self.at, self._message.find(b"\0", self.at)
        if end < 0:
            raise NatNetError(f"found a text without an end from byte {begin} on, expected a zero byte")
        self.at = end + 1
        return self._message[begin:end].decode(errors="replace")
