"""A live session: its processes, its port, its address. It goes on until it is interrupted."""

import argparse
import asyncio
import functools
import ssl
import sys
from dataclasses import replace
from pathlib import Path

from aiohttp import web

from trunkline.errors import InputError
from trunkline.execution.settings import Config as Execution
from trunkline.live.access import CODE_SECONDS, Origins, make_token
from trunkline.live.anchors import Anchors
from trunkline.live.foreseer import Answer
from trunkline.live.hardware import Hardware, hardware_of
from trunkline.live.house import make
from trunkline.live.server import House, Server
from trunkline.live.settings import Alignment, Config
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.teleop.config import Config as Teleop

PAGE = Path(__file__).parent / "page"


def alignment_for(hardware: Hardware | None, settings: Alignment) -> Alignment:
    """As set; where anything real moves, never by eye."""
    return replace(settings, by_eye=False) if hardware is not None and hardware.real else settings


async def serve(options: argparse.Namespace, names: list[str], context: ssl.SSLContext | None) -> None:
    """Until it is interrupted."""
    loop, servers = asyncio.get_running_loop(), []

    def heard(answer: Answer | None) -> None:
        loop.call_soon_threadsafe(lambda: [server.foreseen(answer) for server in servers])

    teleop, config = load_folder(Teleop, PROJECT / "conf/teleop"), load_folder(Config, PROJECT / "conf/live")
    hardware = hardware_of(
        options.robot, options.motors, options.bus, options.interface,
        load_folder(Execution, PROJECT / "conf/execution"),
    )  # fmt: skip
    if hardware is not None and hardware.real:
        print(f"REAL: {hardware.words()}. Nobody has tried this on real ones yet (docs/execution.md).", flush=True)
    alignment = alignment_for(hardware, config.alignment)
    anchors = Anchors(Path(alignment.anchors))
    made = await asyncio.to_thread(make, options.package, teleop, config, heard, hardware)
    try:
        token, log = make_token(), functools.partial(print, flush=True)
        origins = Origins.of(names, options.port, context is not None)
        house = House(
            made.desk, token, origins, made.package, made.scene, made.shells, config.rate, PAGE, log,
            alignment, anchors,
        )  # fmt: skip
        while not (made.robot.ready and made.planning.ready.is_set()):
            if not (made.robot.alive and made.planning.alive):
                raise InputError("a process of the session has ended before it began")
            if made.journal.fault:
                raise InputError(made.journal.fault)
            await asyncio.sleep(0.05)
        server = Server(house)
        servers.append(server)
        runner = web.AppRunner(server.app(), access_log=None, handle_signals=False)
        await runner.setup()
        try:
            await web.TCPSite(runner, options.host, options.port, ssl_context=context).start()
        except OSError as error:
            raise InputError(f"--host {options.host} --port {options.port}: {error.strerror}") from error
        log(f"log: {made.journal.path}")
        log(f"{origins.scheme}://{names[0]}:{options.port}/#token={token}")
        _pair(server, log, loop)
        try:
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()
    finally:
        await asyncio.to_thread(made.close)


def _pair(server: Server, log, loop: asyncio.AbstractEventLoop) -> None:
    """A pairing code now, and another at every line that is typed."""

    def renew() -> None:
        log(f"pairing code, for {CODE_SECONDS:.0f} s: {server.code.renew(server.now())} (Enter for another)")

    def typed() -> None:
        if sys.stdin.readline():
            renew()
        else:
            loop.remove_reader(sys.stdin)

    renew()
    if sys.stdin is not None and sys.stdin.isatty():
        loop.add_reader(sys.stdin, typed)
