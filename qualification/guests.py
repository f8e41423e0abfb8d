"""Clients of a live session, for what is measured of it, and what their hands do."""

import asyncio
import contextlib
import json
import struct
import time
from collections.abc import Callable

import numpy as np
from aiohttp import ClientSession, WSMessage, WSMsgType

from trunkline.ar.session import binary
from trunkline.ar.session.serving import Address
from trunkline.errors import InputError

ADDRESS = Address(18446)  # of every session that is measured: one at a time
HZ = 72.0  # of inputs
Place = tuple[float, float, float]  # m, in the base frame

RIGID, TIP, LENGTH = (0.5, 0.0, 0.55), (0.62, 0.0, 0.2), 0.6  # m, of the targets and of rays at first
SEEN, UNDRAWN = 15, 7  # an input's flags: both hands tracked, the page visible, the robot drawn; all but that
WATCHED = 0.2  # s after a preview's end, at which it is said to have been shown


class Guest:
    """A client that acknowledges everything and keeps what it was told last. `now`: its clock, s. sees: is called with
    each message before it is answered."""

    def __init__(self, socket, now: Callable[[], float] = time.monotonic) -> None:
        self.socket, self.now, self.told, self.received = socket, now, {}, 0
        self.knows = asyncio.Event()  # its clock
        self.sees: Callable[[WSMessage], None] = lambda message: None
        self.task = asyncio.create_task(self._read())

    async def _read(self) -> None:
        with contextlib.suppress(ConnectionError):  # it may leave as something comes
            await self._listen()

    async def _listen(self) -> None:
        async for message in self.socket:
            self.sees(message)
            if message.type is WSMsgType.BINARY:
                self.received += 1
                await self.send("ack")
            elif message.type is WSMsgType.TEXT:
                told = json.loads(message.data)
                self.told[told["type"]] = told
                if told["type"] == "ping":
                    await self.say(type="pong", number=told["number"], stamp=self.now())
                if told["type"] == "clock":
                    self.knows.set()

    async def greet(self, token: str) -> None:
        """Come in, and learn the clock."""
        await self.say(type="hello", version=binary.VERSION, token=token)
        await self.knows.wait()

    @property
    def controls(self) -> bool:
        """Whether it was told that the lease is its own."""
        client, lease = self.told.get("welcome"), self.told.get("lease")
        return client is not None and lease is not None and lease["holder"] == client["id"]

    async def say(self, **message) -> None:
        await self.socket.send_json(message)

    async def send(self, kind: str, rows: bytes = b"", flags: int = 0, count: int = 0, late: float = 0.0) -> None:
        """late: s by which its stamp is older than now."""
        head = struct.pack("<BBHId", binary.FROM_CLIENT[kind].number, flags, count, self.received, self.now() - late)
        await self.socket.send_bytes(head + rows)

    async def leave(self) -> None:
        await self.socket.close()
        await self.task


async def knock(
    session: ClientSession, url: str, now: Callable[[], float] = time.monotonic, headers: dict[str, str] | None = None
) -> Guest:
    """A client that has said nothing yet, and comes from the page of `url` unless its `headers` say another."""
    socket = await session.ws_connect(f"{url}/ws", headers={"Origin": url} | (headers or {}), max_msg_size=0)
    return Guest(socket, now)


async def until(happens: Callable[[], object], seconds: float, what: str = "", pause: float = 0.005) -> None:
    """Look every `pause` s whether it happens.

    Raises:
        InputError: it does not.
    """
    end = time.monotonic() + seconds
    while not happens():
        if time.monotonic() > end:
            raise InputError(f"{what or 'session'}: found nothing within {seconds:g} s")
        await asyncio.sleep(pause)


class Hands:
    """What the hands of whom controls do: a cycle by the core's own mode. watched: s after its end, at which a preview
    is said to have been shown."""

    def __init__(self, watched: float = WATCHED) -> None:
        self.mode, self.since, self.cycles, self._watched, self._said = "", 0.0, 0, watched, 0.0

    async def move(self, guest: Guest, now: float) -> dict[str, float]:
        """Say that a preview was shown, once it was; what the hands hold."""
        held, preview = self.held(guest, now), guest.told.get("preview")
        watched = self._watched + preview["duration"] if preview else np.inf
        if preview and self.mode == "preview" and now - max(self.since, self._said) > watched:
            self._said = now
            await guest.say(type="shown", digest=preview["digest"])
        return held

    def held(self, guest: Guest, now: float) -> dict[str, float]:
        mode = (guest.told.get("state") or {}).get("mode", "")
        if mode != self.mode:
            self.cycles += self.mode == "execute" and mode == "aim"
            self.mode, self.since = mode, now
        spent = now - self.since
        if mode == "aim":
            return {"grip": 1.0, "trigger": float(spent % 1.2 > 0.8)}
        if mode == "ready":
            return {"grip": 1.0, "trigger": float(0.2 < spent % 1.2 < 1.0)}  # one that falls into a silence is no press
        if mode in ("delay", "execute"):
            return {"grip": 1.0}
        return {"primary": float(spent % 0.5 < 0.2)} if mode == "stopped" else {}


def hands_at(rigid: Place, tip: Place, held: dict[str, float]) -> bytes:
    """Of an input: both hands above their targets, their rays straight down, in the base frame."""
    rows = [
        [(dict.fromkeys(binary.HAND, 0.0) | {"x": x, "y": y, "z": z + LENGTH, "qw": 1.0} | held)[name]
         for name in binary.HAND]
        for x, y, z in (rigid, tip)
    ]  # fmt: skip
    return np.array(rows, dtype="<f4").tobytes()
