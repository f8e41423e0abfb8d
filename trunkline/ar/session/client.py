"""Who is connected: its socket, its clock, its rate, and what is on its way to it."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from aiohttp import WSCloseCode, web

from trunkline.ar.session import messages
from trunkline.ar.session.alignment_procedure import AlignmentProcedure
from trunkline.ar.session.clock import EVERY, PINGS, ClientClock
from trunkline.ar.session.controller import HERE
from trunkline.ar.session.outbox import Outbox
from trunkline.ar.teleop.messages import Pose

PER_SECOND, BURST = 400.0, 400.0  # messages
REPEAT_AFTER = 1.0  # s until the same refusal is said again
PING_GAP = 0.03  # s


@dataclass
class Client:
    """`id`: by which all know it; `key`: by which it comes again. `left`: of its rate, below 0 beyond it. `stopping`:
    its stop button is held. `buttons`: those that it holds. `reserve`: it came where no place was left but for a
    stop."""

    id: str
    key: str
    name: str
    space: str
    socket: web.WebSocketResponse
    procedure: AlignmentProcedure | None  # None for who is in the base frame
    outbox: Outbox = field(default_factory=Outbox)
    clock: ClientClock = field(default_factory=ClientClock)
    left: float = BURST
    counted: float = 0.0
    refused: dict[str, float] = field(default_factory=dict)
    stopping: bool = False
    buttons: bytes = b""
    reserve: bool = False

    @property
    def alignment(self) -> Pose | None:
        """Of its reference frame in the base, None where that is not known."""
        return HERE if self.procedure is None else self.procedure.alignment

    @property
    def unfit(self) -> str:
        """Why its alignment is not good enough to execute anything."""
        return "" if self.procedure is None else self.procedure.unfit

    def count(self, now: float) -> None:
        """One more message."""
        self.left = min(self.left + PER_SECOND * (now - self.counted), BURST) - 1
        self.counted = now

    def refuse(self, reason: str, now: float) -> bool:
        """Say it in one line; whether it was said, which is the same no oftener than every SAID_AGAIN."""
        kind = reason.partition(":")[0]
        if kind in self.refused and now - self.refused[kind] < REPEAT_AFTER:
            return False
        self.refused[kind] = now
        self.outbox.say(messages.tell(messages.Refusal(reason)))
        return True

    async def send(self) -> None:
        """What is in its outbox, until it leaves."""
        with suppress(ConnectionError):  # it has left meanwhile
            while not self.socket.closed:
                item = self.outbox.take()
                if item is None:
                    await self.outbox.ready.wait()
                elif isinstance(item, str):
                    await self.socket.send_str(item)
                else:
                    await self.socket.send_bytes(item)

    async def ping(self, now: Callable[[], float]) -> None:
        """Its clock against the server's, until it leaves."""
        while not self.socket.closed:
            for _ in range(PINGS):
                self.outbox.say(messages.tell(messages.Ping(self.clock.ping(now()))))
                await asyncio.sleep(PING_GAP)
            await asyncio.sleep(EVERY)


async def end(socket: web.WebSocketResponse, reason: str) -> None:
    """Say why, and close."""
    if not socket.closed:
        try:
            await socket.send_str(messages.tell(messages.Refusal(reason, closing=True)))
        except ConnectionError:
            return
        await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=reason.encode()[:120])
