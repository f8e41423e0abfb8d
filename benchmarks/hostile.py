"""Who should not be in a live session, or sends what it should not: what each is told, and that nothing moves.

    python -m benchmarks.hostile [PACKAGE]

The session is the real one on the simulated robot. Each attempt comes over its own connection to the port; what it is
told is quoted. A row counts what the robot's process began since: nothing, if all is well.
tests/ar/session/test_hostile.py has the same and more, without physics.
"""

import argparse
import asyncio
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from aiohttp import ClientSession, WSServerHandshakeError

from benchmarks.guests import HZ, RIGID, SEEN, TIP, Guest, Hands, hands_at, knock
from trunkline.ar.preview.package import only_package
from trunkline.ar.session.composition import SessionParts
from trunkline.ar.session.server import Server
from trunkline.ar.session.session import Address, opened
from trunkline.errors import InputError, in_one_line
from upkeep.results import recorded

ADDRESS = Address(18447)
PATIENCE = 60.0  # s for a plan and its preview
SOON = 3.0  # s for an answer
PAUSE = 1.5  # s after a preview, and after a refusal: the same is said once a second
PROMISED = "a" * 64  # a digest of no plan


@dataclass
class Scene:
    """A session, and connections to it."""

    server: Server
    made: SessionParts
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
        await until(lambda: self.server.control.holder == guest.told["welcome"]["id"], SOON)
        return guest


async def until(happens: Callable[[], object], seconds: float) -> None:
    """
    Raises:
        InputError: it does not happen.
    """
    end = time.monotonic() + seconds
    while not happens():
        if time.monotonic() > end:
            raise InputError(f"found nothing within {seconds:g} s")
        await asyncio.sleep(0.005)


async def refused(guest: Guest) -> str:
    """What it is told, or how it is shown out."""
    with suppress(InputError):
        await until(lambda: "error" in guest.told or guest.socket.closed, SOON)
    if "error" in guest.told:
        return guest.told["error"]["reason"]
    return f"the connection ends, code {guest.socket.close_code}" if guest.socket.closed else "NOTHING"


async def at_door(scene: Scene, **headers: str) -> str:
    try:
        await knock(scene.session, ADDRESS.url, headers=headers)
    except WSServerHandshakeError as error:
        answer = await scene.session.get(f"{ADDRESS.url}/ws", headers={"Origin": ADDRESS.url} | headers)
        return f"{error.status} {(await answer.text()).strip()}"
    return "NOTHING"


async def hello(scene: Scene, **message: object) -> str:
    guest = await knock(scene.session, ADDRESS.url)
    await guest.say(type="hello", **message)
    return await refused(guest)


async def sent(scene: Scene, message: bytes) -> str:
    guest = await scene.come()
    with suppress(ConnectionError):
        await guest.socket.send_bytes(message)
    return await refused(guest)


async def uncontrolled(scene: Scene) -> str:
    guest = await scene.come()
    await guest.send("input", hands_at(RIGID, TIP, {"grip": 1.0, "trigger": 1.0}), SEEN, 2)
    return await refused(guest)


async def numberless(scene: Scene) -> str:
    """Poses that are no numbers, of whom controls."""
    guest = await scene.control()
    nothing = np.full(len(hands_at(RIGID, TIP, {})) // 4, np.nan, dtype="<f4").tobytes()
    for _ in range(30):
        await guest.send("input", nothing, SEEN, 2)
        await asyncio.sleep(1 / HZ)
    notice = guest.told["state"]["notice"]
    await guest.leave()
    return notice


async def flood(scene: Scene) -> str:
    guest = await scene.come()
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


async def replayed(scene: Scene) -> str:
    """All that was sent, triggers among it, again while a confirmation would start the robot."""
    guest = await scene.control()
    before = await previewed(guest)
    guest.told.pop("error", None)
    for message in before:
        if "error" not in guest.told:
            await guest.socket.send_bytes(message)
            await asyncio.sleep(1 / 300)
    said = await refused(guest)
    await guest.leave()
    return said


async def another(scene: Scene) -> str:
    """A plan that was never previewed is said to have been shown."""
    guest = await scene.control()
    await previewed(guest)
    guest.told.pop("error", None)
    await guest.say(type="shown", digest=PROMISED)
    said = await refused(guest)
    await guest.leave()
    return said


Attempt = Callable[[Scene], Awaitable[str]]
ATTEMPTS: dict[str, Attempt] = {
    "page of another origin": lambda s: at_door(s, Origin="http://evil.example"),
    "another name of this machine": lambda s: at_door(s, Host="rebound.example:80"),
    "no token": lambda s: hello(s, version=1),
    "wrong token": lambda s: hello(s, version=1, token="x" * 22),
    "guessed pairing code": lambda s: hello(s, version=1, code="123456"),
    "another version": lambda s: hello(s, version=99, token=s.token),
    "message of 10 MB": lambda s: sent(s, bytes(10_000_000)),
    "message of no kind": lambda s: sent(s, b"\x63" + bytes(15)),
    "6000 messages at once": flood,
    "input without the lease": uncontrolled,
    "poses that are no numbers": numberless,
    "a confirmation that was heard before": replayed,
    "another plan's digest": another,
}


async def session(package: Path) -> None:
    """All of them, one after the other."""
    async with opened(package, ADDRESS, lambda line: None) as (server, made), ClientSession() as session:
        scene = Scene(server, made, session, server.composition.token)
        began: list[str] = []
        start = made.robot.start

        def counted(plan, digest: str) -> str:
            began.append(digest)
            return start(plan, digest)

        made.robot.start = counted  # type: ignore[method-assign]
        rests = made.robot.robot_state().joints
        print("| attempt | it is told | plans begun | joints moved, rad |")
        print("|---|---|---:|---:|")
        for title, attempt in ATTEMPTS.items():
            said = await attempt(scene)
            moved = float(np.abs(made.robot.robot_state().joints - rests).max())
            print(f"| {title} | {said} | {len(began)} | {moved:.1g} |", flush=True)


@in_one_line
def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", type=Path)
    given = parser.parse_args(arguments)
    package = given.package or only_package()
    with recorded("hostile"):
        asyncio.run(session(package))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
