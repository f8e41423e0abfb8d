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
from aiohttp import ClientSession, WSMsgType, web

from trunkline.live import wire
from trunkline.live.access import Origins, make_token
from trunkline.live.foreseer import Answer
from trunkline.live.house import Made, make
from trunkline.live.server import House, Server
from trunkline.live.settings import Config
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.pipeline.results import recorded
from trunkline.teleop.config import Config as Teleop

PORT, HZ = 18444, 72.0
RIGID, TIP = (0.5, 0.0, 0.55), (0.62, 0.0, 0.2)  # m, of the targets that plans are asked for
LENGTH = 0.6  # m, of rays at first: hands are above what they point at
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
    loop, servers = asyncio.get_running_loop(), []

    def heard(answer: Answer | None) -> None:
        loop.call_soon_threadsafe(lambda: [server.foreseen(answer) for server in servers])

    teleop, config = load_folder(Teleop, PROJECT / "conf/teleop"), load_folder(Config, PROJECT / "conf/live")
    made = await asyncio.to_thread(make, package, teleop, config, heard)
    while not (made.robot.ready and made.planning.ready.is_set()):
        await asyncio.sleep(0.1)
    token = make_token()
    house = House(
        made.desk, token, Origins.of(["127.0.0.1"], PORT, False), made.package, made.scene, made.shells, config.rate,
        Path("nowhere"), lambda line: None,
    )  # fmt: skip
    server = Server(house)
    servers.append(server)
    runner = web.AppRunner(server.app(), access_log=None)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", PORT).start()
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    clients = context.Process(target=attend, args=(theirs, token, watchers, stops), daemon=True)
    clients.start()
    try:
        return await watched(server, made, ours)
    finally:
        clients.terminate()
        await runner.cleanup()
        made.close()


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
                    rows = np.array([hand(RIGID, held), hand(TIP, held)], dtype="<f4").tobytes()
                    head = struct.pack("<BBHId", wire.FROM_CLIENT["input"].number, 7, 2, 0, time.monotonic())
                    await socket.send_bytes(head + rows)
                    await asyncio.sleep(1 / HZ)


def hand(target: tuple[float, float, float], held: dict[str, float]) -> list[float]:
    """Above its target, its ray straight down, in the base frame."""
    x, y, z = target
    row = dict.fromkeys(wire.HAND, 0.0) | {"x": x, "y": y, "z": z + LENGTH, "qw": 1.0} | held
    return [row[name] for name in wire.HAND]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--watchers", type=int, default=20)
    parser.add_argument("--stops", type=int, default=200)
    options = parser.parse_args()
    found = options.package or next(iter(sorted(Path("artifacts/package_unity").glob("*.tgz"))))
    main(found, options.watchers, options.stops)
