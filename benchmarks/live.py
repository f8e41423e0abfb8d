"""A live session's edge: from a stop until the robot is commanded to hold, bytes of a frame, the server's processor.

    python -m benchmarks.live [PACKAGE] [--watchers 20] [--stops 200]

A client that controls asks for plans all the time, so that previews and their batches run; `watchers` look on and
acknowledge; one of them stops the robot, again and again. A stop is timed from before it is sent until the robot's own
process has obeyed it, on one clock. Clients are in a process of their own, so that the server's processor is its own.
"""

import argparse
import asyncio
import contextlib
import multiprocessing
import time
from pathlib import Path

import numpy as np
from aiohttp import ClientSession

from benchmarks.guests import HZ, RIGID, SEEN, TIP, Guest, hands_at, knock
from trunkline.errors import in_one_line
from trunkline.foresight.package import only_package
from trunkline.live import wire
from trunkline.live.house import Made
from trunkline.live.server import Server
from trunkline.live.session import Address, opened
from trunkline.pipeline.results import recorded

ADDRESS = Address(18444)
BETWEEN = (1.5, 3.0)  # s between stops: in aim, planning, preview or its batch
QUIET = 5.0  # s in which frames and processor are counted


def main(package: Path, watchers: int, stops: int) -> None:
    found = asyncio.run(serve(package, watchers, stops))
    bytes_a_frame, cpu, rate, held, plans = found
    told = 1e3 * np.quantile(held, (0.5, 0.95, 0.99, 1.0))
    print(
        f"{watchers} watchers, {rate:.1f} frames a second to each: {bytes_a_frame} bytes a frame, "
        f"{1e3 * cpu:.2f} ms of the server's processor a frame"
    )
    print(
        f"stop sent to robot commanded to hold, {len(held)} stops while {plans} plans were previewed: "
        f"{told[0]:.1f} ms median, {told[1]:.1f} ms 95th percentile, {told[2]:.1f} ms 99th, {told[3]:.1f} ms most"
    )


async def serve(package: Path, watchers: int, stops: int) -> tuple[int, float, float, np.ndarray, int]:
    """Bytes and s of processor a frame, frames a second, s from each stop to its hold, and how many plans were made."""
    async with opened(package, ADDRESS, lambda line: None) as (server, made):
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        attending = theirs, server.house.token, watchers, stops
        clients = context.Process(target=attend, args=attending, daemon=True)
        clients.start()
        try:
            return await watched(server, made, ours)
        finally:
            clients.terminate()


async def watched(server: Server, made: Made, ours) -> tuple[int, float, float, np.ndarray, int]:
    """Of a server whose clients have come."""
    while not ours.poll():
        await asyncio.sleep(0.05)
    assert ours.recv() == "here"
    frames, cpu, began = server.showing.frames, time.process_time(), time.monotonic()
    await asyncio.sleep(QUIET)
    frames, cpu, lasted = server.showing.frames - frames, time.process_time() - cpu, time.monotonic() - began
    bytes_a_frame = wire.HEAD_BYTES + 28 * (len(made.scene["bodies"]) + len(wire.MARKERS))
    held, seen, asked = [], made.robot.standing().held, made.desk.state.serial
    ours.send("stop")
    while not ours.poll():
        await asyncio.sleep(0.002)
        now = made.robot.standing().held
        if now != seen:
            held, seen = [*held, now], now
    sent = np.array(ours.recv())
    after = np.searchsorted(held, sent)
    kept = after < len(held)
    plans = made.desk.state.serial - asked
    return bytes_a_frame, cpu / frames, frames / lasted, np.array(held)[after[kept]] - sent[kept], plans


def attend(pipe, token: str, watchers: int, stops: int) -> None:
    """The process of the clients."""
    asyncio.run(clients(pipe, token, watchers, stops))


async def clients(pipe, token: str, watchers: int, stops: int) -> None:
    async with ClientSession() as session:
        guests = [await knock(session, ADDRESS.url) for _ in range(watchers + 1)]
        await asyncio.gather(*(guest.greet(token) for guest in guests))
        await guests[0].say(type="lease", action="ask")
        pointing = asyncio.create_task(point(guests[0]))
        pipe.send("here")
        while not pipe.poll():
            await asyncio.sleep(0.01)
        sent, rng = [], np.random.default_rng(0)
        for _ in range(stops):
            await asyncio.sleep(rng.uniform(*BETWEEN))
            sent.append(time.monotonic())
            await guests[1].send("stop")
        await asyncio.sleep(0.5)
        pipe.send(sent)
        await asyncio.sleep(5.0)
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


@in_one_line
def run() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--watchers", type=int, default=20)
    parser.add_argument("--stops", type=int, default=200)
    options = parser.parse_args()
    package = options.package or only_package()
    with recorded("live", options.watchers >= 20 and options.stops >= 200):
        main(package, options.watchers, options.stops)
    return 0


if __name__ == "__main__":
    raise SystemExit(run())
