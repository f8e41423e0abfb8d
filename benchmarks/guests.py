"""Clients of a live session, and the session itself on a port of this machine, for what is measured of it."""

import asyncio
import contextlib
import json
import struct
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import numpy as np
from aiohttp import WSMsgType, web

from trunkline.live import wire
from trunkline.live.access import Origins, make_token
from trunkline.live.foreseer import Answer
from trunkline.live.house import Made, make
from trunkline.live.server import House, Server
from trunkline.live.settings import Config
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.teleop.config import Config as Teleop

Place = tuple[float, float, float]  # m, in the base frame

RIGID, TIP, LENGTH = (0.5, 0.0, 0.55), (0.62, 0.0, 0.2), 0.6  # m, of the targets and of rays at first
SEEN = 7  # an input's flags: both hands tracked, the page visible


class Guest:
    """A client that acknowledges everything and keeps what it was told last. `now`: its clock, s."""

    def __init__(self, socket, now) -> None:
        self.socket, self.now, self.told, self.received = socket, now, {}, 0
        self.knows = asyncio.Event()  # its clock
        self.task = asyncio.create_task(self._read())

    async def _read(self) -> None:
        with contextlib.suppress(ConnectionError):  # it may leave as something comes
            await self._listen()

    async def _listen(self) -> None:
        async for message in self.socket:
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
        await self.say(type="hello", version=wire.VERSION, token=token)
        await self.knows.wait()

    async def say(self, **message) -> None:
        await self.socket.send_json(message)

    async def send(self, kind: str, rows: bytes = b"", flags: int = 0, count: int = 0) -> None:
        head = struct.pack("<BBHId", wire.FROM_CLIENT[kind].number, flags, count, self.received, self.now())
        await self.socket.send_bytes(head + rows)

    async def leave(self) -> None:
        await self.socket.close()
        await self.task


class Hands:
    """What the hands of whom controls do: a cycle by the core's own mode."""

    def __init__(self) -> None:
        self.mode, self.since, self.cycles = "", 0.0, 0

    def held(self, guest: Guest, now: float) -> dict[str, float]:
        mode = (guest.told.get("state") or {}).get("mode", "")
        if mode != self.mode:
            self.cycles += self.mode == "execute" and mode == "aim"
            self.mode, self.since = mode, now
        spent = now - self.since
        if mode == "aim":
            return {"grip": 1.0, "trigger": float(spent % 1.2 > 0.8)}
        if mode == "ready":
            return {"grip": 1.0, "trigger": float(spent > 0.2)}
        if mode in ("delay", "execute"):
            return {"grip": 1.0}
        return {"primary": float(spent % 0.5 < 0.2)} if mode == "stopped" else {}


def hands_at(rigid: Place, tip: Place, held: dict[str, float]) -> bytes:
    """Of an input: both hands above their targets, their rays straight down, in the base frame."""
    rows = [
        [(dict.fromkeys(wire.HAND, 0.0) | {"x": x, "y": y, "z": z + LENGTH, "qw": 1.0} | held)[name]
         for name in wire.HAND]
        for x, y, z in (rigid, tip)
    ]  # fmt: skip
    return np.array(rows, dtype="<f4").tobytes()


@contextlib.asynccontextmanager
async def opened(
    package: Path, port: int, log: Callable[[str], None] = lambda line: None
) -> AsyncIterator[tuple[Server, Made]]:
    """A session as `make live` has it, its robot simulated, without a page: ready, and ended at last."""
    loop, servers = asyncio.get_running_loop(), []

    def heard(answer: Answer | None) -> None:
        loop.call_soon_threadsafe(lambda: [server.foreseen(answer) for server in servers])

    teleop, config = load_folder(Teleop, PROJECT / "conf/teleop"), load_folder(Config, PROJECT / "conf/live")
    made = await asyncio.to_thread(make, package, teleop, config, heard)
    try:
        while not (made.robot.ready and made.planning.ready.is_set()):
            await asyncio.sleep(0.1)
        server = Server(House(
            made.desk, make_token(), Origins.of(["127.0.0.1"], port, False), made.package, made.scene, made.shells,
            config.rate, Path("nowhere"), log,
        ))  # fmt: skip
        servers.append(server)
        runner = web.AppRunner(server.app(), access_log=None)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", port).start()
        try:
            yield server, made
        finally:
            await runner.cleanup()
    finally:
        await asyncio.to_thread(made.close)
