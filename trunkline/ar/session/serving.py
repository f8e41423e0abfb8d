"""Serving a live session: its processes, its port, its address."""

import argparse
import asyncio
import contextlib
import functools
import gc
import logging
import signal
import socket
import ssl
import sys
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, replace
from pathlib import Path

from aiohttp import web, web_response

from trunkline.ar.drivers.settings import read_execution_config
from trunkline.ar.session.anchors import Anchors
from trunkline.ar.session.auth import CODE_SECONDS, HEADERS, Origins, make_token
from trunkline.ar.session.composition import SessionParts, make
from trunkline.ar.session.connections import HANDSHAKE
from trunkline.ar.session.hardware import Hardware, hardware_of
from trunkline.ar.session.measured_session import write_session
from trunkline.ar.session.server import PARTING, Composition, Server
from trunkline.ar.session.settings import AlignmentSettings, SessionConfig, read_session_config
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

PAGE = Path(__file__).parents[1] / "page"
web_response.SERVER_SOFTWARE = HEADERS["Server"]  # pyright: ignore[reportPrivateImportUsage] # of answers that no handler gives, for which aiohttp has no setting


def alignment_for(hardware: Hardware | None, settings: AlignmentSettings) -> AlignmentSettings:
    """As set; where anything real moves, never by eye."""
    return replace(settings, by_eye=False) if hardware is not None and hardware.real else settings


@dataclass(frozen=True)
class Address:
    """Where a session is found. names: of this machine, as others may call it. context: of its TLS, None without."""

    port: int
    host: str = "127.0.0.1"
    names: tuple[str, ...] = ("127.0.0.1",)
    context: ssl.SSLContext | None = None

    @property
    def origins(self) -> Origins:
        return Origins.of(list(self.names), self.port, self.context is not None)

    @property
    def url(self) -> str:
        return f"{self.origins.scheme}://{self.names[0]}:{self.port}"


@contextlib.asynccontextmanager
async def listening(server: Server, address: Address) -> AsyncIterator[None]:
    """
    Raises:
        InputError: the address cannot be had.
    """
    runner = web.AppRunner(
        server.app(), access_log=None, logger=_one_line(server.composition.log), handle_signals=False,
        shutdown_timeout=PARTING,
    )  # fmt: skip
    await runner.setup()
    handlers = runner.server
    assert handlers is not None, "it is set up"
    watch = asyncio.create_task(server.idle.watch(lambda: [handler.transport for handler in handlers.connections]))
    handshake = HANDSHAKE if address.context is not None else None
    listener = None
    try:
        try:
            listener = await asyncio.get_running_loop().create_server(
                handlers, address.host, address.port, ssl=address.context, ssl_handshake_timeout=handshake
            )
        except OSError as error:
            raise refused(address, error) from error
        yield
    finally:
        watch.cancel()
        if listener is not None:
            listener.close()
        await runner.cleanup()


def _one_line(log: Callable[[str], None]) -> logging.Logger:
    """What aiohttp has to say of requests that no handler sees, a line each."""

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            error = record.exc_info[1] if record.exc_info else None
            log(" ".join(f"refused: {record.getMessage()}{f': {error}' if error else ''}".split()))

    logger = logging.Logger("trunkline.live", logging.WARNING)
    logger.addHandler(Lines())
    return logger


def refused(address: Address, error: OSError) -> InputError:
    return InputError(f"--host {address.host} --port {address.port}: {error.strerror}; does a session run there?")


def expect_free(address: Address) -> None:
    """
    Raises:
        InputError: the address cannot be had.
    """
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    with contextlib.closing(socket.socket(family)) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address.host, address.port))
        except OSError as error:
            raise refused(address, error) from error


@contextlib.asynccontextmanager
async def opened(
    package: Path,
    address: Address,
    log: Callable[[str], None],
    hardware: Hardware | None = None,
    config: SessionConfig | None = None,
    teleop: Teleop | None = None,
    cameras: str = "",
) -> AsyncIterator[tuple[Server, SessionParts]]:
    """A session that is ready, on the simulated robot where there is no hardware, by conf/live and conf/teleop where
    there is no `config` and `teleop`; its processes end with it. cameras: as of `make`.

    Raises:
        InputError: no package, a process that ends, a log that cannot be written, an address that cannot be had.
    """
    config = config or read_session_config()
    teleop = teleop or load_folder(Teleop, PROJECT / "conf/teleop")
    if hardware is not None:
        teleop = hardware.slow_enough(teleop)
    alignment = alignment_for(hardware, config.alignment)
    anchors = Anchors(Path(alignment.anchors))
    made = await asyncio.to_thread(make, package, teleop, config, hardware, cameras)
    try:
        composition = Composition(
            made.controller, make_token(), address.origins, made.package, made.scene, made.shells, config.rate, PAGE,
            log, alignment, anchors, made.certificate,
        )  # fmt: skip
        while not (made.robot.ready and made.previewer.ready.is_set()):
            if not (made.robot.alive and made.previewer.alive):
                raise InputError("a process of the session has ended before it began")
            if made.log_writer.fault:
                raise InputError(made.log_writer.fault)
            await asyncio.sleep(0.05)
        server = Server(composition)
        gc.collect()
        gc.freeze()  # a collection of all that is loaded takes longer than a robot goes on without a permit
        async with listening(server, address):
            yield server, made
    finally:
        gc.unfreeze()
        await asyncio.to_thread(made.close)


async def serve(options: argparse.Namespace, names: list[str], context: ssl.SSLContext | None) -> None:
    """Until it is interrupted or told to end: either way robot and log are closed in order."""
    task = asyncio.current_task()
    assert task is not None, "asyncio runs it"
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # `nohup` has it ignored
            asyncio.get_running_loop().add_signal_handler(number, task.cancel)
    log = functools.partial(print, flush=True)
    execution = read_execution_config()
    hardware = hardware_of(options.robot, options.motors, options.bus, options.interface, execution)
    if hardware is not None and hardware.real:
        log(f"REAL: {hardware.words()}. Nobody has tried this on real ones yet (docs/hardware.md).")
        if hardware.real_motors:
            log("The motors wind up their cables now, before the page is there: stand clear. Ctrl-C lets them go.")
    address = Address(options.port, options.host, tuple(names), context)
    expect_free(address)  # what a session needs takes long to load
    path = None
    try:
        async with opened(options.package, address, log, hardware, cameras=options.cameras) as (server, made):
            path = made.log_writer.path
            log(f"log: {path}")
            log(f"{address.url}/#token={server.composition.token}")
            _pair(server, log, asyncio.get_running_loop())
            await asyncio.Event().wait()
    finally:
        if path is not None:  # all processes have ended, nothing moves
            for line in write_session(path):
                log(line)


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
