"""Frames between the robot's process and a driver process, over a socket: of one size each way, little-endian.

This, `panda_process`, `driver`, `setpoint_filter` and `realtime_priority` run in an environment of the robot's own
library: they import the standard library, numpy, each other and `trunkline.kinematics.panda` alone.
"""

import contextlib
import socket
import struct
from dataclasses import dataclass

TEXT = 240  # bytes of a fault, UTF-8
LAST = 1.0  # s that the last frame may take


@dataclass(frozen=True)
class Setpoint:
    """Where the driver's `axes` shall be, rad or m, at `due`, s of the clock of all processes (time.monotonic)."""

    due: float
    axes: tuple[float, ...]

    @staticmethod
    def size(axes: int) -> int:
        """Bytes of a frame of so many axes."""
        return 8 * (1 + axes)

    def pack(self) -> bytes:
        return struct.pack(f"<{1 + len(self.axes)}d", self.due, *self.axes)

    @classmethod
    def unpack(cls, data: bytes) -> "Setpoint":
        due, *axes = struct.unpack(f"<{len(data) // 8}d", data)
        return cls(due, tuple(axes))


@dataclass(frozen=True)
class DriverState:
    """At `time`, s: the axes as `measured` and as `sent`, rad or m; `fault` in words, "" for none."""

    time: float
    measured: tuple[float, ...]
    sent: tuple[float, ...]
    fault: str = ""

    @staticmethod
    def size(axes: int) -> int:
        """Bytes of a frame of so many axes."""
        return 8 * (1 + 2 * axes) + TEXT

    def pack(self) -> bytes:
        text = self.fault.encode()[:TEXT].decode(errors="ignore").encode()
        numbers = (self.time, *self.measured, *self.sent)
        return struct.pack(f"<{len(numbers)}d{TEXT}s", *numbers, text)

    @classmethod
    def unpack(cls, data: bytes) -> "DriverState":
        count = (len(data) - TEXT) // 8
        time, *axes, text = struct.unpack(f"<{count}d{TEXT}s", data)
        half = count // 2
        return cls(time, tuple(axes[:half]), tuple(axes[half:]), text.rstrip(b"\0").decode(errors="replace"))


class FrameSocket:
    """One end of a socket that hears frames of `size` bytes; nothing waits. `open`: whether the other end is there."""

    def __init__(self, channel: socket.socket, size: int) -> None:
        self._socket, self._size, self.open = channel, size, True
        self._buffer = self._unsent = b""
        channel.setblocking(False)

    def received(self) -> list[bytes]:
        """The whole frames that came."""
        try:
            while self.open:
                data = self._socket.recv(1 << 16)
                self._buffer, self.open = self._buffer + data, bool(data)
        except BlockingIOError:
            pass
        except OSError:
            self.open = False
        whole, size = len(self._buffer) // self._size * self._size, self._size
        data, self._buffer = self._buffer[:whole], self._buffer[whole:]
        return [data[n : n + size] for n in range(0, whole, size)]

    def send(self, frame: bytes) -> None:
        """A frame, unless one that did not go whole is on its way still.

        Raises:
            OSError: the other end is gone, or takes no more.
        """
        self._unsent = self._unsent or frame
        self._unsent = self._unsent[self._socket.send(self._unsent) :]

    def tell(self, state: DriverState) -> None:
        """The same, unless nobody listens; whoever is slow misses a frame."""
        with contextlib.suppress(OSError):
            self.send(state.pack())

    def end(self, state: DriverState) -> None:
        """The last frame, for which it waits."""
        self._socket.settimeout(LAST)
        with contextlib.suppress(OSError):
            self._socket.sendall(self._unsent + state.pack())

    def close(self) -> None:
        """This end."""
        self._socket.close()
