"""A live session's edge: frames that come and their age, from a press to what shows it, the server's processor, a
client that does not read, and from a stop until the robot is commanded to hold.

    python -m benchmarks.live [PACKAGE] [--watchers 20] [--stops 200]

Clients are in a process of their own, so that the server's processor is its own, and draw nothing. A frame's age is
from the time at which the robot was so until the frame has come. Where others watch, one client controls and asks for
plans all the time, so that previews and their batches run. One of `watchers` stops the robot, again and again: a stop
is timed from before it is sent until the robot's own process has obeyed it. All is on one clock.
"""

import asyncio
import contextlib
import sys
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.watching import Door, Span, alone, attended, crowd, pressed, stopping
from qualification.command import qualify
from qualification.guests import ADDRESS
from trunkline.ar.session import binary
from trunkline.ar.session.composition import SessionParts
from trunkline.ar.session.server import Server
from trunkline.ar.session.serving import Address, opened
from trunkline.ar.session.tls import make_certificate, tls_context

CROWD = 10  # watchers, of whom one does not read in the end
LOOKED, CLOSELY = 0.05, 0.002  # s between two looks at the server's processor, and at the robot

Row = tuple[str, str, str]  # what, found, goal


@dataclass
class Looks:
    """At a server, from within: of each when, its processor's time, s, and how many frames are on their way to whom."""

    server: Server
    rows: list[tuple[float, float, dict[str, int]]] = field(default_factory=list)

    def look(self) -> None:
        boxes = {client.id: client.outbox for client in self.server.clients.values()}
        held = {id: box.sent - box.received for id, box in boxes.items()}
        self.rows.append((time.monotonic(), time.process_time(), held))

    def share(self, span: Span) -> float:
        """Of one core, in `span`."""
        when, cpu = np.array([row[:2] for row in self.rows]).T
        return float(np.diff(np.interp([span.began, span.ended], when, cpu))[0] / (span.ended - span.began))

    def most(self, span: Span, client: str) -> int:
        """Frames that were held for `client` in `span`."""
        at = [held for when, _, held in self.rows if span.began <= when <= span.ended]
        return max(held[client] for held in at if client in held)


@dataclass
class Holds:
    """When the robot was commanded to hold, s."""

    made: SessionParts
    times: list[float]

    def look(self) -> None:
        now = self.made.robot.robot_state().hold_time
        if now != self.times[-1]:
            self.times.append(now)

    def after(self, sent: np.ndarray) -> np.ndarray:
        """s from each that was `sent` to the hold after it; who saw none is left out."""
        held = np.array(self.times)
        first = np.searchsorted(held, sent)
        kept = first < len(held)
        return held[first[kept]] - sent[kept]


@contextlib.asynccontextmanager
async def held_open(package: Path, address: Address, pem: bytes | None = None) -> AsyncIterator[tuple]:
    """A session and its door."""
    async with opened(package, address, lambda line: None) as (server, made):
        yield server, made, Door(address.url, server.composition.token, pem)


def halves(found: np.ndarray) -> str:
    """ms, the median and the 95th percentile."""
    middle, late = 1e3 * np.quantile(found, (0.5, 0.95))
    return f"{middle:.1f} / {late:.1f}"


def received(span: Span, how: str) -> list[Row]:
    return [
        (f"frames a second that one client receives{how}", f"{span.rate:.1f}", "≥ 71.5"),
        (f"age of a frame that comes{how}, ms, median / 95th percentile", halves(span.ages), "2 / 5"),
    ]


def nothing() -> None:
    pass


async def by_tls(package: Path) -> list[Row]:
    """Of a session with a certificate."""
    pem, key = make_certificate(list(ADDRESS.names))
    async with held_open(package, replace(ADDRESS, context=tls_context(pem, key)), pem) as (_, _, door):
        return received(await attended(nothing, LOOKED, door, alone), " by TLS")


async def plainly(package: Path, watchers: int, stops: int) -> tuple[list[Row], str]:
    """Of a session without; and a line on stops."""
    async with held_open(package, ADDRESS) as (server, made, door):
        rows = received(await attended(nothing, LOOKED, door, alone), "")
        took, lost = await attended(nothing, LOOKED, door, pressed, stops)
        others = f" ({lost} more showed nothing)" if lost else ""
        what = f"{len(took)} presses to the state that shows them{others}, ms, median / 95th"
        rows.append((what, halves(took), "3 / 10"))
        looks = Looks(server)
        reading, rest, deaf = await attended(looks.look, LOOKED, door, crowd, CROWD)
        rows += [
            (f"the server's processor, 1 controls, {CROWD} watch", f"{looks.share(reading):.1%} of a core", "10 %"),
            (f"frames a second that each of {CROWD} receives", f"{reading.rate:.1f}", ""),
            ("age of their frames, ms, median / 95th", halves(reading.ages), ""),
            ("the same while one more reads nothing", halves(rest.ages), "95th: 5"),
            ("frames that are held for it", str(looks.most(rest, deaf)), "3"),
        ]
        holds, looks = Holds(made, [made.robot.robot_state().hold_time]), Looks(server)
        first_serial = made.controller.state.serial

        def look() -> None:
            holds.look()
            if not looks.rows or time.monotonic() - looks.rows[-1][0] > LOOKED:
                looks.look()

        span, sent = await attended(look, CLOSELY, door, stopping, watchers, stops)
        plans, took = made.controller.state.serial - first_serial, holds.after(sent)
        size = binary.HEAD_BYTES + 28 * (len(made.scene["bodies"]) + len(binary.MARKERS))
    told = 1e3 * np.quantile(took, (0.5, 0.95, 0.99, 1.0))
    rows += [
        (f"frames a second that each of {watchers} receives", f"{span.rate:.1f}", ""),
        ("bytes a frame", str(size), ""),
    ]
    return rows, (
        f"stop sent to robot commanded to hold, {len(took)} stops while {plans} plans were previewed: "
        f"{told[0]:.1f} ms median, {told[1]:.1f} ms 95th percentile, {told[2]:.1f} ms 99th, {told[3]:.1f} ms most"
    )


async def measured(package: Path, watchers: int, stops: int) -> None:
    rows, line = await plainly(package, watchers, stops)
    rows[2:2] = await by_tls(package)
    for cells in (("what", "found", "goal"), ("---", "---:", "---:"), *rows):
        print(f"| {' | '.join(cells)} |")
    print(line)


def main(package: Path, watchers: int, stops: int) -> None:
    asyncio.run(measured(package, watchers, stops))


if __name__ == "__main__":
    sys.exit(qualify("live", __doc__, main, watchers=20, stops=200))
