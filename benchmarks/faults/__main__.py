"""What goes wrong in a live session as its robot moves: until the robot is told to hold, until it rests, and why.

    python -m benchmarks.faults [PACKAGE] [--times 5]

The session is the real one on the simulated robot: server, log, planning and robot are processes of their own, and so
is the client that controls. It goes through aim, preview, confirmation and execution; as the robot moves, something is
done to one of them. Times are those of the robot's own process, on one clock. The reason is read from the session's log
at its end. `python -m benchmarks.motors` has what motors do that are silent, or told nothing.
"""

import argparse
import asyncio
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from aiohttp import ClientSession

from benchmarks.guests import HZ, RIGID, SEEN, TIP, Hands, Place, hands_at, knock
from trunkline.errors import InputError, in_one_line
from trunkline.foresight.package import only_package
from trunkline.live.house import Made
from trunkline.live.logbook import read_logbook
from trunkline.live.robot import DEAD_MAN
from trunkline.live.server import Server
from trunkline.live.session import Address, opened
from trunkline.pipeline.results import recorded

ADDRESS = Address(18446)
ASIDE = 0.15  # m to both sides, of the targets in turns
MOVING = 0.4  # s for which the robot has moved before anything is done
PATIENCE = 90.0  # s for a client to come and for a cycle
HANG = 0.5  # s
LOST, JUMP = 4, 5.0  # an input's flags without tracking; s
GOAL = 0.15  # s
WHY = ("mode", "robot", "refused")  # events that say it


class Operator:
    """A client that controls, in a process of its own. Told "lose", "jump" or "nan", its inputs are wrong so until it
    is told ""."""

    def __init__(self, token: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self.process = context.Process(target=operate, args=(theirs, token), daemon=True)
        self.process.start()

    def tell(self, wrong: str) -> None:
        self._pipe.send(wrong)

    def signal(self, number: int) -> None:
        assert self.process.pid is not None
        os.kill(self.process.pid, number)

    def close(self) -> None:
        self.process.kill()
        self.process.join()


def operate(pipe: Connection, token: str) -> None:
    """The process of an `Operator`."""
    asyncio.run(_operate(pipe, token))


async def _operate(pipe: Connection, token: str) -> None:
    wrong, hands = "", Hands()
    async with ClientSession() as session:
        guest = await knock(session, ADDRESS.url, lambda: time.monotonic() + JUMP * (wrong == "jump"))
        await guest.greet(token)
        await guest.say(type="lease", action="ask")
        while not guest.socket.closed:
            wrong = pipe.recv() if pipe.poll() else wrong
            held, side = await hands.move(guest, time.monotonic()), ASIDE * (-1) ** hands.cycles
            rows = hands_at(_beside(RIGID, side), _beside(TIP, side), held)
            rows = np.full(len(rows) // 4, np.nan, dtype="<f4").tobytes() if wrong == "nan" else rows
            await guest.send("input", rows, LOST if wrong == "lose" else SEEN, 2)
            await asyncio.sleep(1 / HZ)


def _beside(place: Place, side: float) -> Place:
    x, y, z = place
    return x, y + side, z


@dataclass
class Scene:
    """A session in which something is done."""

    server: Server
    made: Made
    operator: Operator


@dataclass(frozen=True)
class Fault:
    """`do` it, and `mend` it. last: it cannot be mended, and ends its session."""

    title: str
    do: Callable[[Scene], None]
    mend: Callable[[Scene], None] = lambda scene: None
    last: bool = False


def _renew(scene: Scene) -> None:
    scene.operator.close()
    scene.operator = Operator(scene.server.house.token)


def _killed(pid: int | None) -> None:
    assert pid is not None
    os.kill(pid, signal.SIGKILL)


FAULTS = (
    Fault("client killed", lambda s: s.operator.signal(signal.SIGKILL), _renew),
    Fault("client silent", lambda s: s.operator.signal(signal.SIGSTOP), _renew),
    Fault("both controllers lost", lambda s: s.operator.tell("lose"), lambda s: s.operator.tell("")),
    Fault(f"client's clock jumps by {JUMP:g} s", lambda s: s.operator.tell("jump"), _renew),
    Fault("poses are no numbers", lambda s: s.operator.tell("nan"), lambda s: s.operator.tell("")),
    Fault(f"server hangs for {HANG:g} s", lambda s: time.sleep(HANG)),
    Fault("log's process killed", lambda s: _killed(s.made.journal.pid), last=True),
    Fault("robot's process killed", lambda s: _killed(s.made.robot.pid), last=True),
)


@dataclass
class Found:
    """Of one fault: s until the robot was told to hold and until it rested, and what was said."""

    held: list[float] = field(default_factory=list)
    rested: list[float] = field(default_factory=list)
    said: list[str] = field(default_factory=list)


async def suffered(fault: Fault, scene: Scene) -> tuple[float, float, float]:
    """When it was done, s, and until the robot was told to hold, and rested.

    Raises:
        InputError: the robot never came to move, or did not rest.
    """
    robot, began = scene.made.robot, time.monotonic()
    since = began
    while time.monotonic() - since < MOVING:
        since = since if robot.state().mode == "running" else time.monotonic()
        if time.monotonic() - began > PATIENCE:
            raise InputError(f"{fault.title}: found no motion within {PATIENCE:g} s")
        await asyncio.sleep(0.002)
    done = time.monotonic()
    fault.do(scene)
    held, rested = np.inf, np.inf
    while not np.isfinite(rested):
        state, told = robot.state(), robot.standing().held
        now = time.monotonic()
        if not np.isfinite(held) and (told > done or state.mode != "running"):
            held = (told if told > done else now) - done
        rested = now - done if state.mode != "running" else rested
        if now - done > PATIENCE:
            raise InputError(f"{fault.title}: found a robot that still moves after {PATIENCE:g} s")
        await asyncio.sleep(0.002)
    await asyncio.sleep(0.6)
    fault.mend(scene)
    return done, held, rested


@asynccontextmanager
async def staged(package: Path, lines: list[tuple[float, str]]) -> AsyncIterator[Scene]:
    """A session, and who controls it; what the server says goes to `lines`, with the time."""
    async with opened(package, ADDRESS, lambda line: lines.append((time.monotonic(), line))) as (server, made):
        scene = Scene(server, made, Operator(server.house.token))
        try:
            yield scene
        finally:
            scene.operator.close()


async def session(package: Path, faults: list[Fault]) -> list[tuple[Fault, float, float, str]]:
    """Of each fault in turn: s until the robot was told to hold, until it rested, and what was said."""
    lines, times, spans = [], [], []
    async with staged(package, lines) as scene:
        path = scene.made.journal.path
        for fault in faults:
            done, held, rested = await suffered(fault, scene)
            times.append(done)
            spans.append((held, rested))
            print(f"{fault.title}: {1e3 * held:.0f} ms", file=sys.stderr, flush=True)
    events = [event for event in read_logbook(path).events if event["event"] in WHY]
    said = [_why(done, events) or _line(done, lines) for done in times]
    return [(fault, *span, why) for fault, span, why in zip(faults, spans, said, strict=True)]


def _why(done: float, events: list[dict]) -> str:
    """The first reason that the log gives after `done`."""
    for event in events:
        if done < event["time"] < done + 1.0:
            words = {"mode": "notice", "refused": "reason"}.get(event["event"])
            found = event[words] if words else event["robot"]["fault"]
            if found:
                return f"{found} (log)"
    return ""


def _line(done: float, lines: list[tuple[float, str]]) -> str:
    return next((f"{line} (server)" for at, line in lines if at > done), "")


def main(package: Path, times: int) -> None:
    found: dict[str, Found] = {}
    ends = [fault for fault in FAULTS if fault.last]
    before = [fault for fault in FAULTS if not fault.last] * times
    for faults in ([*before, ends[0]], *([end] for end in ends[1:])):
        for fault, held, rested, said in asyncio.run(session(package, faults)):
            row = found.setdefault(fault.title, Found())
            row.held.append(held)
            row.rested.append(rested)
            row.said.append(said)
    print("| as the robot moves | times | told to hold after, ms: median | most | rests after, ms: most | said |")
    print("|---|---:|---:|---:|---:|---|")
    for title, row in found.items():
        held, rested = 1e3 * np.array(row.held), 1e3 * np.array(row.rested)
        told = f"{np.median(held):.0f} | {held.max():.0f} | {rested.max():.0f}"
        print(f"| {title} | {len(held)} | {told} | {row.said[0]} |")
    most = max(max(row.held) for row in found.values())
    print(f"\nGoal: {1e3 * GOAL:.0f} ms; found at most {1e3 * most:.0f} ms. The robot itself brakes after"
          f" {1e3 * DEAD_MAN:.0f} ms without a permit.")  # fmt: skip


@in_one_line
def run(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--times", type=int, default=5)
    given = parser.parse_args(arguments)
    package = given.package or only_package()
    with recorded("faults", given.times >= 5):
        main(package, given.times)
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
