"""A live session's edge: from a stop until the robot is commanded to hold, bytes of a frame, the server's processor.

    python -m benchmarks.live [PACKAGE] [--watchers 20] [--stops 200]

A client that controls asks for plans all the time, so that previews and their batches run; `watchers` look on and
acknowledge; one of them stops the robot, again and again. A stop is timed from before it is sent until the robot's own
process has obeyed it, on one clock. Clients are in a process of their own, so that the server's processor is its own.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import struct
import time
from pathlib import Path

import numpy as np
from aiohttp import ClientSession, WSMsgType

from benchmarks.guests import RIGID, SEEN, TIP, hands_at, opened
from trunkline.live import wire
from trunkline.live.house import Made
from trunkline.live.server import Server
from trunkline.pipeline.results import recorded

PORT, HZ = 18444, 72.0
BETWEEN = (1.5, 3.0)  # s between stops: in aim, planning, preview or its batch
QUIET = 5.0  # s in which frames and processor are counted


@recorded("live")
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
    async with opened(package, PORT) as (server, made):
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
    url = f"http://127.0.0.1:{PORT}"
    async with ClientSession() as session:
        sockets = [
            await session.ws_connect(f"{url}/ws", headers={"Origin": url}, max_msg_size=0) for _ in range(watchers + 1)
        ]
        known = asyncio.Event()
        tasks = [asyncio.create_task(watch(socket, token, known if n == 0 else None))
                 for n, socket in enumerate(sockets)]  # fmt: skip
        await known.wait()
        await sockets[0].send_json({"type": "lease", "action": "ask"})
        tasks.append(asyncio.create_task(point(sockets[0])))
        pipe.send("here")
        while not pipe.poll():
            await asyncio.sleep(0.01)
        sent, rng = [], np.random.default_rng(0)
        for _ in range(stops):
            await asyncio.sleep(rng.uniform(*BETWEEN))
            sent.append(time.monotonic())
            await sockets[1].send_bytes(struct.pack("<BBHId", wire.FROM_CLIENT["stop"].number, 0, 0, 0, 0.0))
        await asyncio.sleep(0.5)
        pipe.send(sent)
        await asyncio.sleep(5.0)
        for task in tasks:
            task.cancel()


async def watch(socket, token: str, known: asyncio.Event | None) -> None:
    """Acknowledge everything."""
    await socket.send_json({"type": "hello", "version": wire.VERSION, "token": token})
    received = 0
    async for message in socket:
        if message.type is WSMsgType.BINARY:
            received += 1
            await socket.send_bytes(struct.pack("<BBHId", wire.FROM_CLIENT["ack"].number, 0, 0, received, 0.0))
        elif message.type is WSMsgType.TEXT:
            told = json.loads(message.data)
            if told["type"] == "ping":
                await socket.send_json({"type": "pong", "number": told["number"], "stamp": time.monotonic()})
            if told["type"] == "clock" and known is not None:
                known.set()


async def point(socket) -> None:
    """Both grips held at two targets, the trigger pulled, all let go, primary pressed: over and over, as fast as a
    stop and a plan allow."""
    with contextlib.suppress(ConnectionError):
        while True:
            for seconds, held in ((0.4, {"primary": 1.0}), (0.4, {}), (0.3, {"grip": 1.0}),
                                  (0.5, {"grip": 1.0, "trigger": 1.0})):  # fmt: skip
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    head = struct.pack("<BBHId", wire.FROM_CLIENT["input"].number, SEEN, 2, 0, time.monotonic())
                    await socket.send_bytes(head + hands_at(RIGID, TIP, held))
                    await asyncio.sleep(1 / HZ)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--watchers", type=int, default=20)
    parser.add_argument("--stops", type=int, default=200)
    options = parser.parse_args()
    found = options.package or next(iter(sorted(Path("artifacts/package_unity").glob("*.tgz"))))
    main(found, options.watchers, options.stops)
