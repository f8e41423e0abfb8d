"""Clients of a live session in a process of their own, and what comes to them: frames, their age, what a press shows.

They draw nothing. Their clock is the server's: both processes are on one machine.
"""

import asyncio
import contextlib
import multiprocessing
import ssl
import struct
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from aiohttp import ClientSession, TCPConnector, WSMessage, WSMsgType

from qualification.guests import HZ, RIGID, SEEN, TIP, Guest, hands_at, knock
from trunkline.ar.session import binary
from trunkline.errors import InputError

QUIET = 5.0  # s in which frames and processor are counted
SETTLED = 1.0  # s before it: who has come is told much at first
BETWEEN = (1.5, 3.0)  # s between stops: in aim, planning, preview or its batch
MOVED = (TIP[0], TIP[1] + 0.1, TIP[2])  # a tip's target that drops a plan for TIP
AIMED = 0.4  # s in which both targets are held before a press
PATIENCE = 1.0  # s without an answer to a press, after which it is lost
MOST_LOST = 10


@dataclass(frozen=True)
class Door:
    """Where a server is found, and what opens it. certificate: PEM, where it has one."""

    url: str
    token: str
    certificate: bytes | None = None

    def session(self) -> ClientSession:
        if self.certificate is None:
            return ClientSession()
        return ClientSession(connector=TCPConnector(ssl=ssl.create_default_context(cadata=self.certificate.decode())))


@dataclass
class RobotFrames:
    """Of the robot, as they come to a client: of each the time that it tells and when it came, s."""

    rows: list[tuple[float, float]] = field(default_factory=list)

    def __call__(self, message: WSMessage) -> None:
        if message.type is WSMsgType.BINARY and message.data[0] == binary.FROM_SERVER["robot"].number:
            self.rows.append((struct.unpack_from("<d", message.data, binary.HEAD_BYTES - 8)[0], time.monotonic()))


@dataclass(frozen=True)
class Span:
    """From `began` to `ended`, s; frames (F, 2) of each client, as `RobotFrames` has them."""

    began: float
    ended: float
    frames: tuple[np.ndarray, ...]

    @property
    def rate(self) -> float:
        """Hz, of who received the fewest."""
        return min(len(rows) for rows in self.frames) / (self.ended - self.began)

    @property
    def ages(self) -> np.ndarray:
        """s, of all."""
        return np.concatenate([came - told for told, came in (rows.T for rows in self.frames)])


async def spent(guests: list[Guest], seconds: float = QUIET) -> Span:
    """What comes to `guests` from now on."""
    seen = [RobotFrames() for _ in guests]
    began = time.monotonic()
    for guest, frames in zip(guests, seen, strict=True):
        guest.sees = frames
    await asyncio.sleep(seconds)
    ended = time.monotonic()
    for guest in guests:
        guest.sees = lambda message: None
    return Span(began, ended, tuple(np.array(frames.rows).reshape(-1, 2) for frames in seen))


# --- what clients do: each is run by `attended`

Work = Callable[..., Awaitable[Any]]


async def came(session: ClientSession, door: Door, count: int) -> list[Guest]:
    guests = [await knock(session, door.url) for _ in range(count)]
    await asyncio.gather(*(guest.greet(door.token) for guest in guests))
    return guests


async def alone(session: ClientSession, door: Door) -> Span:
    """One that looks on."""
    guests = await came(session, door, 1)
    await asyncio.sleep(SETTLED)
    return await spent(guests)


async def pressed(session: ClientSession, door: Door, presses: int) -> tuple[np.ndarray, int]:
    """One that controls, and asks for plans by its trigger: s from each press until the state says so, shape (P,), and
    how many more were made anew as no state did within PATIENCE."""
    (guest,) = await came(session, door, 1)
    await guest.say(type="lease", action="ask")
    asker = Asker(guest, np.random.default_rng(0))
    while len(asker.took) < presses:
        await asker.go_on()
    return np.array(asker.took), asker.lost


class Asker:
    """Whose hands ask for a plan, and drop it by another target as soon as it is asked for. took: s of each press;
    lost: presses after which nothing was asked for, which are made anew."""

    def __init__(self, guest: Guest, rng: np.random.Generator) -> None:
        self.guest, self.took, self.lost, self._rng = guest, [], 0, rng
        self._mode, self._since, self._pressed = "", time.monotonic(), 0.0
        guest.sees = self._see

    def _see(self, message: WSMessage) -> None:
        if message.type is WSMsgType.TEXT and (told := message.json())["type"] == "state":
            now = time.monotonic()
            if self._pressed and told["mode"] == "plan":
                self.took.append(now - self._pressed)
            if told["mode"] != self._mode:
                self._mode, self._since, self._pressed = told["mode"], now, 0.0

    async def go_on(self) -> None:
        """One input.

        Raises:
            InputError: presses show nothing.
        """
        since, held, tip = time.monotonic() - self._since, {}, TIP
        if self._mode == "aim":
            held = {"grip": 1.0, "trigger": float(since > AIMED)}
            if since > AIMED and not self._pressed:
                await asyncio.sleep(self._rng.uniform(0, 1 / HZ))  # at any time of the server's tick
                self._pressed = time.monotonic()
            elif self._pressed and time.monotonic() - self._pressed > PATIENCE:
                self._lose()
        elif self._mode in ("plan", "preview", "ready") and since % 1 > 0.1:
            held, tip = {"grip": 1.0}, TIP if since % 1 < 0.2 else MOVED
        elif self._mode == "stopped":
            held = {"primary": float(since % 0.5 < 0.2)}
        await self.guest.send("input", hands_at(RIGID, tip, held), SEEN, 2)
        await asyncio.sleep(1 / HZ)

    def _lose(self) -> None:
        self.lost += 1
        if self.lost > max(len(self.took), MOST_LOST):
            state = self.guest.told["state"]
            raise InputError(f"trigger: found {self.lost} presses for which no plan is asked: {state}")
        self._pressed, self._since = 0.0, time.monotonic()


async def crowd(session: ClientSession, door: Door, watchers: int) -> tuple[Span, Span, str]:
    """One that controls, and `watchers`: what comes to them, then to all but one that reads nothing, and its id."""
    async with watched(session, door, watchers) as others:
        reading = await spent(others)
        deaf = others.pop()
        deaf.task.cancel()
        await asyncio.sleep(SETTLED)
        return reading, await spent(others), deaf.told["welcome"]["id"]


async def stopping(session: ClientSession, door: Door, watchers: int, stops: int) -> tuple[Span, np.ndarray]:
    """One that controls, and `watchers`, of whom one stops the robot: what comes to them before, and when each stop
    was sent, s."""
    async with watched(session, door, watchers) as others:
        span, sent, rng = await spent(others), [], np.random.default_rng(0)
        for _ in range(stops):
            await asyncio.sleep(rng.uniform(*BETWEEN))
            sent.append(time.monotonic())
            await others[0].send("stop")
        await asyncio.sleep(0.5)
    return span, np.array(sent)


@contextlib.asynccontextmanager
async def watched(session: ClientSession, door: Door, watchers: int) -> AsyncIterator[list[Guest]]:
    """The `watchers` of one that controls and points."""
    controls, *others = await came(session, door, watchers + 1)
    await controls.say(type="lease", action="ask")
    pointing = asyncio.create_task(point(controls))
    await asyncio.sleep(SETTLED)
    yield others
    pointing.cancel()


async def point(guest: Guest) -> None:
    """Both grips held at two targets, the trigger pulled, all let go, primary pressed: over and over, as fast as a
    stop and a plan allow."""
    with contextlib.suppress(ConnectionError):
        while True:
            for seconds, held in ((0.4, {"primary": 1.0}), (0.4, {}), (0.3, {"grip": 1.0}),
                                  (0.5, {"grip": 1.0, "trigger": 1.0})):  # fmt: skip
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    await guest.send("input", hands_at(RIGID, TIP, held), SEEN, 2)
                    await asyncio.sleep(1 / HZ)


# --- their process


async def attended(look: Callable[[], None], gap: float, door: Door, work: Work, *given: object) -> Any:
    """What clients that do `work` find, who are told what is `given`. Meanwhile `look` is called every `gap` s.

    Raises:
        EOFError: their process has ended before.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    clients = context.Process(target=attend, args=(theirs, door, work, *given), daemon=True)
    clients.start()
    theirs.close()
    try:
        while not ours.poll():
            look()
            await asyncio.sleep(gap)
        return ours.recv()
    finally:
        clients.terminate()
        await asyncio.to_thread(clients.join)


def attend(pipe, door: Door, work: Work, *given: object) -> None:
    """The process of the clients."""

    async def done() -> Any:
        async with door.session() as session:
            return await work(session, door, *given)

    pipe.send(asyncio.run(done()))
