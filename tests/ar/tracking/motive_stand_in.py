"""A NatNet server written from the protocol's description, apart from the code that reads it: bytes, and two sockets.

Its messages hold something in each section, so that a reader has to skip it: a marker set, other markers, a skeleton,
from 4.1 on an asset, labeled markers, a force plate and a device.
"""

import socket
import struct
import threading
import time
from contextlib import contextmanager

TICKS = 10_000_000  # a second
GROUP, LOOPBACK = "239.255.42.99", "127.0.0.1"
U32, FLOATS = struct.Struct("<I"), {n: struct.Struct(f"<{n}f") for n in (1, 2, 3, 4, 9, 12, 144)}


def message(kind, payload):
    return struct.pack("<HH", kind, len(payload)) + payload


def text(content):
    return content.encode() + b"\0"


def server_info(version, port=1511, group=None, ticks=TICKS):
    name = b"Motive".ljust(256, b"\0")
    group_bytes = socket.inet_aton(group or "0.0.0.0")
    return message(
        1, name + bytes([3, 1, 0, 0, *version, 0, 0]) + struct.pack("<QHB", ticks, port, bool(group)) + group_bytes
    )


def body_model(version, name, number):
    markers, names = 3, b"".join(text(f"{name} {i}") for i in range(3))
    places = b"".join(FLOATS[3].pack(0.1, 0.2, i) for i in range(markers)) + b"".join(
        U32.pack(i) for i in range(markers)
    )
    turned = FLOATS[4].pack(0, 0, 0, 1) if version >= (4, 2) else b""
    own_names = names if version >= (4, 0) else b""
    return text(name) + struct.pack("<Ii3f", number, -1, 0, 0, 0) + turned + U32.pack(markers) + places + own_names


def models(version, bodies):
    """Of rigid bodies, name to id, among data sets of all other types."""
    plate = (
        U32.pack(1) + text("AMTI-1") + FLOATS[2].pack(0.5, 0.4) + FLOATS[3].pack(0, 0, 0) + FLOATS[144].pack(*[0] * 144)
    )
    plate += FLOATS[12].pack(*[0] * 12) + struct.pack("<II", 0, 1) + U32.pack(2) + text("Fx") + text("Fy")
    sets = [(0, text("all") + U32.pack(2) + text("first") + text("second"))]
    sets += [(1, body_model(version, name, number)) for name, number in bodies.items()]
    sets += [
        (2, text("person") + U32.pack(7) + U32.pack(1) + body_model(version, "hip", 1)),
        (3, plate),
        (4, U32.pack(2) + text("NIDAQ") + text("serial") + struct.pack("<II", 0, 1) + U32.pack(1) + text("ai0")),
        (5, text("Prime 13 #1") + FLOATS[3].pack(1, 2, 3) + FLOATS[4].pack(0, 0, 0, 1)),
    ]
    if version >= (4, 1):
        sets.append((6, text("asset") + struct.pack("<III", 1, 9, 0) + U32.pack(0)))
    sized = version >= (4, 1)
    parts = [U32.pack(kind) + (U32.pack(len(part)) if sized else b"") + part for kind, part in sets]
    return message(5, U32.pack(len(parts)) + b"".join(parts))


def rigid_body(number, position, quaternion, flags=1):
    """quaternion: wxyz; on the wire it is xyzw."""
    w, x, y, z = quaternion
    return struct.pack("<I3f4ffH", number, *position, x, y, z, w, 0.0004, flags)


def section(version, parts):
    content = b"".join(parts)
    return U32.pack(len(parts)) + (U32.pack(len(content)) if version >= (4, 1) else b"") + content


def frame(version, number, exposed, sent, bodies, busy=True):
    """exposed, sent: s. bodies: of `rigid_body`. busy: with something in all other sections."""
    marker, channels = FLOATS[3].pack(1, 2, 3), U32.pack(2) + 2 * (U32.pack(1) + FLOATS[1].pack(5))
    labeled = struct.pack("<I4fHf", 65_537, 0.1, 0.2, 0.3, 0.02, 10, 0.0001)
    fill = int(busy)
    payload = U32.pack(number) + section(version, fill * [text("all") + U32.pack(2) + 2 * marker])
    payload += section(version, 3 * fill * [marker]) + section(version, bodies)
    payload += section(version, fill * [U32.pack(7) + U32.pack(1) + rigid_body(1, (9, 9, 9), (1, 0, 0, 0))])
    if version >= (4, 1):
        asset = U32.pack(9) + U32.pack(1) + rigid_body(1, (8, 8, 8), (1, 0, 0, 0)) + U32.pack(0)
        payload += section(version, fill * [asset])
    payload += section(version, 4 * fill * [labeled])
    payload += section(version, fill * [U32.pack(1) + channels]) + section(version, fill * [U32.pack(2) + channels])
    payload += struct.pack("<IId", 0, 0, exposed)
    payload += struct.pack("<QQQ", *(round(TICKS * at) for at in (exposed, (exposed + sent) / 2, sent)))
    payload += struct.pack("<II", 0, 0) if version >= (4, 1) else b""
    return message(7, payload + struct.pack("<H", 0) + U32.pack(0))


class MotiveStandIn:
    """Answers commands, and sends what `send` is told: to the group, or to whoever has shown a sign of life of late."""

    def __init__(self, version, bodies, group=None):
        self.version, self.bodies, self.group, self.heard = version, bodies, group, []
        self.commands = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.commands.bind((LOOPBACK, 0))
        self.commands.settimeout(0.05)
        self.port = self.commands.getsockname()[1]
        self.data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.data.bind((LOOPBACK, 0))
        self.data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(LOOPBACK))
        self.data_port = self.data.getsockname()[1] if group is None else self.port
        self.clients, self.ends, self.answers = {}, False, True
        self.thread = threading.Thread(target=self._answer, daemon=True)
        self.thread.start()

    def _answer(self):
        while not self.ends:
            try:
                request, client = self.commands.recvfrom(2048)
            except TimeoutError:
                continue
            kind = struct.unpack_from("<H", request)[0]
            self.heard.append(kind)
            self.clients[client] = time.monotonic()
            if kind == 9:
                del self.clients[client]
            if kind == 0 and self.answers:
                self.commands.sendto(server_info(self.version, self.data_port, self.group), client)
            if kind == 4 and self.answers:
                self.commands.sendto(models(self.version, self.bodies), client)

    def send(self, content):
        if self.group is not None:
            self.data.sendto(content, (self.group, self.data_port))
            return
        for client, heard in list(self.clients.items()):
            if time.monotonic() - heard < 2.0:
                self.commands.sendto(content, client)

    def close(self):
        self.ends = True
        self.thread.join()
        self.commands.close()
        self.data.close()


@contextmanager
def motive(version, bodies, group=None):
    server = MotiveStandIn(version, bodies, group)
    try:
        yield server
    finally:
        server.close()
