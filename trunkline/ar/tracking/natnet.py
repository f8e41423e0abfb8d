"""OptiTrack's Motive as a source of poses, over NatNet: its frames are unicast or multicast, as the server says.

In Motive's streaming pane: rigid bodies on, their names those of session.yaml, and the same up axis as when the session
was recorded. A unicast server sends frames to where the commands come from, as long as these come.

Tested with a server written from the same description, in both versions; never with Motive, nor across a network. Two
libraries do the same: natnet 0.3.0 reads no clock frequency, so that stamps have no unit, answers each message of a
unicast stream with a message of its own, and reads force plates too short; motioncapture 1.1 stops its process where a
message does not fit.
"""

import math
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from ipaddress import AddressValueError, IPv4Address
from typing import Annotated

from pydantic import Field

from trunkline.ar.tracking import natnet_messages as natnet
from trunkline.ar.tracking.natnet_messages import NatNetError, ServerInfo
from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import CameraFrame, ExpectedBodies
from trunkline.ar.tracking.tracking_process import TrackingProcess
from trunkline.errors import InputError, nearest

ANSWERS, ASKS = 2.0, 0.25  # s in which the server has to answer, and after which it is asked anew
ALIVE = 0.5  # s from one sign of life to a unicast server to the next
LARGEST = 65_536  # bytes of a message
WAITING = 1 << 20  # bytes that may wait in a socket


@dataclass(frozen=True)
class NatNetSettings:
    """server: IPv4 address of the machine that runs Motive. local: of this machine's interface to it; "0.0.0.0" for
    any. command_port: of the server."""

    server: str
    local: str = "0.0.0.0"
    command_port: Annotated[int, Field(ge=1, le=65_535)] = 1510

    def __post_init__(self) -> None:
        for key in ("server", "local"):
            try:
                IPv4Address(getattr(self, key))
            except AddressValueError:
                raise ValueError(f"{key}: found {getattr(self, key)!r}, expected an IPv4 address") from None


class NatNetSource:
    """A `PoseSource`.

    Raises:
        InputError: there is no answer, it cannot be read, or it names no such bodies.
    """

    def __init__(self, settings: NatNetSettings, names: Sequence[str]) -> None:
        self._server, self._where = (settings.server, settings.command_port), f"NatNet at {settings.server}"
        self._commands = self._data = None
        try:
            self._commands = self._data = _socket()
            self._commands.bind((settings.local, 0))
            self.info: ServerInfo = natnet.read_server_info(self._ask(natnet.CONNECT, natnet.SERVER_INFO))
            models = natnet.read_models(self._ask(natnet.REQUEST_MODELS, natnet.MODELS), self.info.version)
            self._ids = self._ids_of(names, models)
            if self.info.group is not None:
                self._data = _socket()
                self._data.bind((self.info.group, self.info.data_port))
                joined = socket.inet_aton(self.info.group) + socket.inet_aton(settings.local)
                self._data.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, joined)
        except (InputError, NatNetError, OSError) as error:
            self.close()
            reason = f"{error}, expected a network that reaches it" if isinstance(error, OSError) else str(error)
            raise InputError(f"{self._where}: {reason}") from error
        self._alive = time.monotonic()

    def receive(self, seconds: float) -> CameraFrame | None:
        until = time.monotonic() + seconds
        while True:
            if self.info.group is None and time.monotonic() - self._alive > ALIVE:
                self._alive = time.monotonic()
                self._send(natnet.KEEP_ALIVE)
            message = self._hear(self._data, until - time.monotonic())
            if message is None:
                return None
            if natnet.kind_of(message) == natnet.FRAME:
                return natnet.read_frame(message, self.info, self._ids)

    def close(self) -> None:
        if self._commands is None:
            return
        if getattr(self, "info", None) is not None and self.info.group is None:
            self._send(natnet.DISCONNECT)
        for opened in {self._commands, self._data} - {None}:
            opened.close()
        self._commands = self._data = None

    def _ids_of(self, names: Sequence[str], bodies: dict[str, int]) -> list[int]:
        for name in names:
            if name not in bodies:
                streamed = ", ".join(bodies) or "none"
                raise InputError(f"found the rigid bodies {streamed}, expected {name!r}{nearest(name, list(bodies))}")
        return [bodies[name] for name in names]

    def _ask(self, kind: int, answer: int) -> bytes:
        """The server's message of the kind `answer`."""
        until, asked = time.monotonic() + ANSWERS, -math.inf
        while (now := time.monotonic()) < until:
            if now - asked > ASKS:
                asked = now
                self._send(kind)
            message = self._hear(self._commands, ASKS)
            if message is not None and natnet.kind_of(message) == answer:
                return message
        silent = f"found no answer at port {self._server[1]} within {ANSWERS:g} s"
        raise InputError(f"{silent}, expected Motive's streaming engine")

    def _send(self, kind: int) -> None:
        assert self._commands is not None
        try:
            self._commands.sendto(natnet.request(kind), self._server)
        except OSError:  # a network that is gone for a while: the silence is noticed
            return

    def _hear(self, opened: socket.socket | None, seconds: float) -> bytes | None:
        """The next message of the server; of others none is heard."""
        assert opened is not None
        until = time.monotonic() + seconds
        while True:
            opened.settimeout(max(until - time.monotonic(), 1e-4))
            try:
                message, sender = opened.recvfrom(LARGEST)
            except (TimeoutError, ConnectionError):
                message, sender = b"", None
            if sender is not None and sender[0] == self._server[0]:
                return message
            if time.monotonic() >= until:
                return None


def _socket() -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WAITING)
    return opened


class NatNetTracker(TrackingProcess):
    """A `Tracker` of what Motive streams."""

    def __init__(self, settings: NatNetSettings, expected: ExpectedBodies, limits: StreamLimits | None = None) -> None:
        super().__init__(partial(NatNetSource, settings), expected, limits)
