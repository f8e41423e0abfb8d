"""A client that controls, in a process of its own."""

import asyncio
import math
import multiprocessing
import os
import signal
import time
from multiprocessing.connection import Connection

import numpy as np
from aiohttp import ClientSession

from qualification.guests import ADDRESS, HZ, RIGID, SEEN, TIP, UNDRAWN, Hands, Place, hands_at, knock
from trunkline.errors import InputError

ASIDE = 0.15  # m to both sides, of the targets in turns
PATIENCE = 90.0  # s for a client to come and for a cycle
LOST, JUMP = 12, 5.0  # an input's flags without tracking; s
LATE = 0.4  # s
DRIFTS = {"drift": 0.1, "slew": 5e-4}  # s a second: a clock that is broken, and one that NTP brings back
SWING = 4.0  # s in which targets that the robot follows go to and fro
GRIPPED = 1.0  # s for which it holds its grips, and confirms nothing
AGAIN = 1.0  # s between two wishes to control


class OperatorProcess:
    """Told "lose", "jump", "nan", "release", "late", "blind" or of DRIFTS, its inputs are wrong so; told "close", its
    socket is. Told "grip", it holds both grips and no more: it confirms nothing. Told "follow", it lets the robot
    follow its targets. Told "", it goes through cycles."""

    def __init__(self, token: str, told: str = "") -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self.process = context.Process(target=operate, args=(theirs, token, told), daemon=True)
        self.process.start()

    def tell(self, word: str) -> None:
        self._pipe.send(word)

    def gripped(self) -> None:
        """Wait until it has controlled for GRIPPED s with no more than its grips.

        Raises:
            InputError: it never does.
        """
        if not self._pipe.poll(PATIENCE):
            raise InputError(f"client: does not control within {PATIENCE:g} s of its coming back")
        self._pipe.recv()

    def signal(self, number: int) -> None:
        assert self.process.pid is not None
        os.kill(self.process.pid, number)

    def close(self) -> None:
        self.process.kill()
        self.process.join()


def operate(pipe: Connection, token: str, told: str) -> None:
    """The process of an `OperatorProcess`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asyncio.run(_operate(pipe, token, told))


async def _operate(pipe: Connection, token: str, told: str) -> None:
    hands, gripped, request_time, since = Hands(), None, 0.0, time.monotonic()

    def clock() -> float:
        now = time.monotonic()
        return now + JUMP * (told == "jump") + DRIFTS.get(told, 0.0) * (now - since)

    async with ClientSession() as session:
        guest = await knock(session, ADDRESS.url, clock)
        await guest.greet(token)
        while not guest.socket.closed:
            if pipe.poll():
                since, told, gripped = time.monotonic(), pipe.recv(), None
            if told == "close":
                await guest.leave()
                break
            now = time.monotonic()
            if not guest.controls and now - request_time > AGAIN:
                request_time = now
                await guest.say(type="lease", action="ask")
            held, side = await hands.move(guest, now), ASIDE * (-1) ** hands.cycles
            words = {"grip": held | {"grip": 1.0, "trigger": 0.0}, "release": {}, "follow": _following(hands, now)}
            held = words.get(told, held)
            side = ASIDE * math.sin(2 * math.pi * now / SWING) if told == "follow" else side
            rows = hands_at(_beside(RIGID, side), _beside(TIP, side), held)
            rows = np.full(len(rows) // 4, np.nan, dtype="<f4").tobytes() if told == "nan" else rows
            flags = {"lose": LOST, "blind": UNDRAWN}.get(told, SEEN)
            await guest.send("input", rows, flags, 2, LATE * (told == "late"))
            if told == "grip" and guest.controls and now - (gripped := gripped or now) > GRIPPED:
                pipe.send("")
                gripped = np.inf
            await asyncio.sleep(1 / HZ)


def _following(hands: Hands, now: float) -> dict[str, float]:
    """Grips, and the stick pressed now and then until the robot follows."""
    pressed = hands.mode == "aim" and (now - hands.since) % AGAIN > AGAIN / 2
    return {"grip": float(hands.mode in ("aim", "follow")), "stick_pressed": float(pressed)}


def _beside(place: Place, side: float) -> Place:
    x, y, z = place
    return x, y + side, z
