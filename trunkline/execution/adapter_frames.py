"""Frames between the machine's process and the Panda's adapter: of one size each way, little-endian.

This and `adapter` run in an environment of the robot's own library: they import the standard library, numpy and
`trunkline.panda` alone.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

JOINTS = 7
TEXT = 120  # bytes of a fault, UTF-8
SENT = struct.Struct(f"<d{JOINTS}d")
TOLD = struct.Struct(f"<d{JOINTS}d{JOINTS}d{TEXT}s")


@dataclass(frozen=True)
class Setpoint:
    """Where the joints shall be, rad, at `due`, s of the clock that both processes have (time.monotonic)."""

    due: float
    joints: tuple[float, ...]

    def pack(self) -> bytes:
        return SENT.pack(self.due, *self.joints)

    @classmethod
    def unpack(cls, data: bytes) -> "Setpoint":
        due, *joints = SENT.unpack(data)
        return cls(due, tuple(joints))


@dataclass(frozen=True)
class Told:
    """At `time`, s: the joints as `measured` and as `commanded`, rad; `fault` in words, "" for none."""

    time: float
    measured: tuple[float, ...]
    commanded: tuple[float, ...]
    fault: str = ""

    def pack(self) -> bytes:
        text = self.fault.encode()[:TEXT].decode(errors="ignore").encode()
        return TOLD.pack(self.time, *self.measured, *self.commanded, text)

    @classmethod
    def unpack(cls, data: bytes) -> "Told":
        time, *joints, text = TOLD.unpack(data)
        return cls(time, tuple(joints[:JOINTS]), tuple(joints[JOINTS:]), text.rstrip(b"\0").decode(errors="replace"))


class Frames:
    """Cuts a stream of bytes into frames of `size`."""

    def __init__(self, size: int) -> None:
        self._size, self._rest = size, b""

    def cut(self, data: bytes) -> Sequence[bytes]:
        """The whole frames that `data` completes."""
        data = self._rest + data
        whole = len(data) // self._size * self._size
        self._rest = data[whole:]
        return [data[n : n + self._size] for n in range(0, whole, self._size)]
