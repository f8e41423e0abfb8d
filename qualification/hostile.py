"""Who should not be in a live session, or sends what it should not: what each is told, and that nothing moves.

    python -m qualification.hostile [PACKAGE]

The session is the real one on the simulated robot. Each attempt comes over its own connection to the port; what it is
told is quoted. A row counts what the robot's process began since: nothing, if all is well; and by how much a joint was
off its first place at most. tests/ar/session/test_hostile.py has the same and more, without physics.
"""

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from aiohttp import ClientSession, WSServerHandshakeError

from qualification.command import qualify
from qualification.guests import ADDRESS, HZ, RIGID, SEEN, TIP, Guest, Hands, hands_at, knock, until
from qualification.scene import running
from trunkline.ar.session.binary import VERSION
from trunkline.ar.session.server import MOST_CLIENTS
from trunkline.errors import InputError

PATIENCE = 60.0  # s for a plan and its preview
SOON = 3.0  # s for an answer
PAUSE = 1.5  # s after a preview, and after a refusal: the same is said once a second
PROMISED = "a" * 64  # a digest of no plan
LONG = 30.0  # s for a connection that does nothing to be shown out
PING = b"\x89\x80\0\0\0\0"
UPGRADE = "\r\n".join(
    ["GET /ws HTTP/1.1", f"Host: {ADDRESS.url.removeprefix('http://')}", f"Origin: {ADDRESS.url}", "Upgrade: websocket",
     "Connection: Upgrade", "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Key: {'A' * 22}==", "", ""]
)  # fmt: skip


@dataclass
class Visitors:
    """Connections to a session."""

    session: ClientSession
    token: str

    async def come(self) -> Guest:
        """A client that is in."""
        guest = await knock(self.session, ADDRESS.url)
        await guest.greet(self.token)
        return guest

    async def control(self) -> Guest:
        """A client that controls."""
        guest = await self.come()
        await guest.say(type="lease", action="ask")
        await until(lambda: guest.controls, SOON)
        return guest


async def refused(guest: Guest) -> str:
    """What it is told, or how it is shown out."""
    with suppress(InputError):
        await until(lambda: "error" in guest.told or guest.socket.closed or guest.task.done(), SOON)
    if "error" in guest.told:
        return guest.told["error"]["reason"]
    if guest.socket.closed:
        return f"the connection ends, code {guest.socket.close_code}"
    return "the connection is cut off" if guest.task.done() else "NOTHING"


async def at_door(visitors: Visitors, **headers: str) -> str:
    try:
        await knock(visitors.session, ADDRESS.url, headers=headers)
    except WSServerHandshakeError as error:
        answer = await visitors.session.get(f"{ADDRESS.url}/ws", headers={"Origin": ADDRESS.url} | headers)
        return f"{error.status} {(await answer.text()).strip()}"
    return "NOTHING"


async def hello(visitors: Visitors, **message: object) -> str:
    guest = await knock(visitors.session, ADDRESS.url)
    await guest.say(type="hello", **message)
    return await refused(guest)


async def dialled(limit: int = 2**16) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, str]:
    """A connection below HTTP, and the server's name and port; `limit`: bytes that its reader takes in unread."""
    where = ADDRESS.url.removeprefix("http://")
    host, port = where.split(":")
    return *await asyncio.open_connection(host, int(port), limit=limit), where


async def speechless(line: str, pings: bool = False) -> str:
    """A connection that sends this, then nothing but pings, and closes nothing."""
    reader, writer, _ = await dialled()
    writer.write(line.encode())
    begun = time.monotonic()
    answer = b"none yet"
    with suppress(ConnectionError):
        while answer and time.monotonic() < begun + LONG:
            with suppress(TimeoutError):
                answer = await asyncio.wait_for(reader.read(4096), 0.2)
            writer.write(PING * pings)
        if answer:
            return "NOTHING"
    return f"gone after {time.monotonic() - begun:.1f} s"


async def unread() -> str:
    """A connection that asks for the page's code again and again, and reads none of it."""
    _, writer, where = await dialled(limit=1024)
    writer.write(8 * f"GET /app.js HTTP/1.1\r\nHost: {where}\r\n\r\n".encode())
    begun = time.monotonic()
    with suppress(ConnectionError):
        while time.monotonic() < begun + LONG:
            await asyncio.sleep(0.2)
            writer.write(b"\r\n")
            await writer.drain()
        return "NOTHING"
    return f"gone after {time.monotonic() - begun:.1f} s"


async def worded(token: bytes) -> str:
    """A request with this as its token."""
    reader, writer, where = await dialled()
    lines = f"GET /scene.json HTTP/1.1\r\nHost: {where}\r\nAuthorization: Bearer ".encode()
    writer.write(lines + token + b"\r\n\r\n")
    answer = await asyncio.wait_for(reader.readline(), SOON)
    writer.close()
    return answer.decode().partition(" ")[2].strip()


async def sent(visitors: Visitors, message: bytes) -> str:
    guest = await visitors.come()
    with suppress(ConnectionError):
        await guest.socket.send_bytes(message)
    return await refused(guest)


async def uncontrolled(visitors: Visitors) -> str:
    guest = await visitors.come()
    await guest.send("input", hands_at(RIGID, TIP, {"grip": 1.0, "trigger": 1.0}), SEEN, 2)
    return await refused(guest)


async def numberless(visitors: Visitors) -> str:
    """Poses that are no numbers, of whom controls."""
    guest = await visitors.control()
    nothing = np.full(len(hands_at(RIGID, TIP, {})) // 4, np.nan, dtype="<f4").tobytes()
    for _ in range(30):
        await guest.send("input", nothing, SEEN, 2)
        await asyncio.sleep(1 / HZ)
    notice = guest.told["state"]["notice"]
    await guest.leave()
    return notice


async def flood(visitors: Visitors) -> str:
    guest = await visitors.come()
    with suppress(ConnectionError):
        for _ in range(6000):
            await guest.send("ack")
    return await refused(guest)


async def previewed(guest: Guest) -> list[bytes]:
    """Go on until a confirmation would start the robot; the inputs that were sent, in whole messages."""
    hands, kept, end = Hands(PAUSE), [], time.monotonic() + PATIENCE
    send = guest.socket.send_bytes

    async def keep(message: bytes) -> None:
        kept.append(message)
        await send(message)

    guest.socket.send_bytes = keep  # type: ignore[method-assign]
    while hands.mode != "ready":
        if time.monotonic() > end:
            raise InputError(f"found no preview within {PATIENCE:g} s")
        held = await hands.move(guest, time.monotonic())
        held = {"grip": 1.0} if hands.mode == "ready" else held
        await guest.send("input", hands_at(RIGID, TIP, held), SEEN, 2)
        await asyncio.sleep(1 / HZ)
    guest.socket.send_bytes = send  # type: ignore[method-assign]
    return [message for message in kept if len(message) > 100]


async def replayed(visitors: Visitors) -> str:
    """All that was sent, triggers among it, again while a confirmation would start the robot."""
    guest = await visitors.control()
    before = await previewed(guest)
    guest.told.pop("error", None)
    for message in before:
        if "error" not in guest.told:
            await guest.socket.send_bytes(message)
            await asyncio.sleep(1 / 300)
    said = await refused(guest)
    await guest.leave()
    return said


async def impersonated(visitors: Visitors) -> str:
    """The id of whom controls, which all see, as the key of another."""
    holder = await visitors.control()
    guest = await knock(visitors.session, ADDRESS.url)
    await guest.say(type="hello", version=VERSION, token=visitors.token, key=holder.told["welcome"]["id"])
    await until(lambda: "welcome" in guest.told, SOON)
    for _ in range(int(PAUSE * HZ)):
        await holder.send("input", hands_at(RIGID, TIP, {}), SEEN, 2)
        await asyncio.sleep(1 / HZ)
    is_safe = holder.controls and not holder.socket.closed and not guest.controls
    await asyncio.gather(guest.leave(), holder.leave())
    return "is another client; who controls still does" if is_safe else "CONTROL WAS TAKEN"


async def crowded(visitors: Visitors) -> str:
    """Clients in every place, and a stop from whom comes after them."""
    guests = [await visitors.come() for _ in range(MOST_CLIENTS)]
    last = await visitors.come()
    reason = await refused(last)
    await last.send("stop")
    await until(lambda: last.told["state"]["mode"] == "stopped", SOON)
    await asyncio.gather(*(guest.leave() for guest in (*guests, last)))
    return f"{reason}; its stop is heard"


async def another(visitors: Visitors) -> str:
    """A plan that was never previewed is said to have been shown."""
    guest = await visitors.control()
    await previewed(guest)
    guest.told.pop("error", None)
    await guest.say(type="shown", digest=PROMISED)
    said = await refused(guest)
    await guest.leave()
    return said


Attempt = Callable[[Visitors], Awaitable[str]]
ATTEMPTS: dict[str, Attempt] = {
    "page of another origin": lambda s: at_door(s, Origin="http://evil.example"),
    "another name of this machine": lambda s: at_door(s, Host="rebound.example:80"),
    "no token": lambda s: hello(s, version=1),
    "wrong token": lambda s: hello(s, version=1, token="x" * 22),
    "guessed pairing code": lambda s: hello(s, version=1, code="123456"),
    "another version": lambda s: hello(s, version=99, token=s.token),
    "half a request": lambda s: speechless(UPGRADE[:30]),
    "a connection that says nothing": lambda s: speechless(UPGRADE),
    "… but pings": lambda s: speechless(UPGRADE, True),
    "answers that are not read": lambda s: unread(),
    "a token that is no ASCII": lambda s: worded("é".encode()),
    "message of 10 MB": lambda s: sent(s, bytes(10_000_000)),
    "message of no kind": lambda s: sent(s, b"\x63" + bytes(15)),
    "6000 messages at once": flood,
    "input without the lease": uncontrolled,
    "poses that are no numbers": numberless,
    "a confirmation that was heard before": replayed,
    "another plan's digest": another,
    "another's id": impersonated,
    "every place taken": crowded,  # the last: the robot is stopped
}


async def attempts(package: Path) -> None:
    """All of them, one after the other."""
    with running(package) as session:
        async with ClientSession() as sockets:
            visitors = Visitors(sockets, session.told.token)
            print("| attempt | it is told | plans begun | joints moved, rad |")
            print("|---|---|---:|---:|")
            for title, attempt in ATTEMPTS.items():
                said = await attempt(visitors)
                print(f"| {title} | {said} | {session.witness.begun} | {session.witness.far:.1g} |", flush=True)


def main(package: Path) -> None:
    asyncio.run(attempts(package))


if __name__ == "__main__":
    sys.exit(qualify("hostile", __doc__, main))
