"""A real-time server of QTM written from the protocol's description, apart from the library that reads it.

A packet is its size (u32, of all), its type (u32), and that, little-endian: 0 an error, 1 a command, 2 XML, 3 data,
4 none. Text ends with a zero byte. Data: µs (u64), number (u32), how many components (u32); each its size and type
(u32), of 6D bodies (type 5): how many (u32), two rates (u16), and of each x, y, z, mm, and a matrix column by column
(12 floats), NaN where it is not tracked.
"""

import socket
import struct
import threading
from contextlib import contextmanager

LOOPBACK = "127.0.0.1"
ERROR, COMMAND, XML, DATA, COMPONENT = 0, 1, 2, 3, 5


def packet(kind, content):
    return struct.pack("<II", 8 + len(content), kind) + content


def text(kind, words):
    return packet(kind, words.encode() + b"\0")


def frame(number, stamp, bodies):
    """stamp: s. bodies: (position m, matrix (3, 3)) or None where one is not tracked."""
    rows = b""
    for body in bodies:
        place, turn = ((float("nan"),) * 3, [[float("nan")] * 3] * 3) if body is None else body
        columns = [turn[i][j] for j in range(3) for i in range(3)]
        rows += struct.pack("<12f", *(1e3 * x for x in place), *columns)
    component = struct.pack("<IHH", len(bodies), 0, 0) + rows
    part = struct.pack("<II", 8 + len(component), COMPONENT) + component
    return packet(DATA, struct.pack("<QII", round(1e6 * stamp), number, 1) + part)


class QtmStandIn:
    """Answers commands of one client at a time, and sends what `send` has once frames were asked for."""

    def __init__(self, names):
        self.names, self.heard, self.answers, self.streams = names, [], True, threading.Event()
        self.listener = socket.create_server((LOOPBACK, 0))
        self.port, self.client = self.listener.getsockname()[1], None
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self):
        while True:
            try:
                self.client, _ = self.listener.accept()
            except OSError:
                return
            self.streams.clear()
            if self.answers:
                self.client.sendall(text(COMMAND, "QTM RT Interface connected"))
            waiting = b""
            while True:
                try:
                    data = self.client.recv(4096)
                except OSError:
                    break
                if not data:
                    break
                waiting += data
                while len(waiting) >= 8 and len(waiting) >= struct.unpack_from("<I", waiting)[0]:
                    size = struct.unpack_from("<I", waiting)[0]
                    self._answer(waiting[8:size].rstrip(b"\0").decode())
                    waiting = waiting[size:]

    def _answer(self, command):
        self.heard.append(command)
        if not self.answers:
            return
        kind, _, rest = command.lower().partition(" ")
        if kind == "version":
            self.client.sendall(text(COMMAND, f"Version set to {rest}"))
        elif (kind, rest) == ("getparameters", "6d"):
            rows = "".join(f"<Body><Name>{name}</Name><Color R='1'/></Body>" for name in self.names)
            bodies = f"<The_6D><Bodies>{len(self.names)}</Bodies>{rows}</The_6D>"
            self.client.sendall(text(XML, f"<QTM_Parameters_Ver_1.25>{bodies}</QTM_Parameters_Ver_1.25>"))
        elif (kind, rest) == ("streamframes", "allframes 6d"):
            self.streams.set()
        else:
            self.client.sendall(text(ERROR, "Parse error"))

    def send(self, content):
        self.client.sendall(content)

    def close(self):
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        if self.client is not None:
            self.client.close()
        self.thread.join(1.0)


@contextmanager
def qtm(names):
    server = QtmStandIn(names)
    try:
        yield server
    finally:
        server.close()
