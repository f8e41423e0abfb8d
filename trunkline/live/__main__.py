"""A live session in a browser or a headset, on the simulated robot unless a real one is named.

    python -m trunkline.live PACKAGE [--host ADDRESS --tls | --cert FILE --key FILE] [--port N]
                             [--dry-run | [--robot panda|fr3] [--motors gm6020 --bus can0]]

PACKAGE: the folder or .tgz that the stage package_unity writes. It listens on this machine alone; a headset comes over
USB: `adb reverse tcp:8443 tcp:8443`. Another address needs TLS. The address that is printed opens the session: whoever
has it may control the robot. What happens is logged: docs/live_log.md.
"""

import argparse
import asyncio
import functools
import ssl
import sys
from dataclasses import replace
from pathlib import Path

from aiohttp import web

from trunkline.errors import InputError, in_one_line
from trunkline.execution.settings import Config as Execution
from trunkline.live.access import CODE_SECONDS, Origins, is_local, make_token, names_of
from trunkline.live.anchors import Anchors
from trunkline.live.certificate import fingerprint, make_certificate, tls_context
from trunkline.live.foreseer import Answer
from trunkline.live.hardware import MOTORS, ROBOTS, SIMULATED, Hardware, hardware_of
from trunkline.live.house import make
from trunkline.live.server import House, Server
from trunkline.live.settings import Alignment, Config
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.teleop.config import Config as Teleop

PAGE = Path(__file__).parent / "page"
PORT = 8443  # kept: anchors of a headset belong to scheme, host and port
ANY = ("0.0.0.0", "::", "")


def parsed(arguments: list[str]) -> argparse.Namespace:
    """
    Raises:
        InputError: an address that others reach, without TLS.
    """
    parser = argparse.ArgumentParser(prog="python -m trunkline.live", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("package", type=Path)
    parser.add_argument("--host", default="127.0.0.1", help="an address of this machine")
    parser.add_argument("--port", type=int, default=PORT)
    parser.add_argument("--tls", action="store_true", help="with a certificate made now")
    parser.add_argument("--cert", type=Path, help="a certificate of your own, PEM")
    parser.add_argument("--key", type=Path, help="its key, PEM")
    parser.add_argument("--dry-run", action="store_true", help="on the simulated robot, as without --robot, --motors")
    parser.add_argument("--robot", choices=ROBOTS, default=ROBOTS[0], help="docs/execution.md says what was tried")
    parser.add_argument("--motors", choices=MOTORS, default=MOTORS[0], help="of the tendons")
    parser.add_argument("--bus", default="", help=f"the motors', such as can0; {SIMULATED}: simulated motors behind it")
    parser.add_argument("--interface", default="", help="python-can's, for the bus; socketcan unless it is named")
    found = parser.parse_args(arguments)
    if (found.cert is None) != (found.key is None):
        raise InputError("--cert, --key: found one of them, expected both")
    if not is_local(found.host) and not (found.tls or found.cert):
        raise InputError(f"--host {found.host}: found no TLS, expected --tls, or --cert and --key: others reach it")
    if found.host in ANY:
        raise InputError(f"--host {found.host}: found every address, expected one: the page is served under it alone")
    if found.dry_run and (found.robot != ROBOTS[0] or found.motors != MOTORS[0]):
        raise InputError("--dry-run: found --robot or --motors besides, expected it alone: nothing real moves")
    if not 0 < found.port < 65536:
        raise InputError(f"--port: found {found.port}, expected 1 to 65535")
    return found


def context_of(options: argparse.Namespace, names: list[str]) -> ssl.SSLContext | None:
    """None without TLS; with it, the certificate's fingerprint is printed.

    Raises:
        InputError: there is no such file, or no certificate in it.
    """
    if options.cert is not None:
        for path in (options.cert, options.key):
            if not path.is_file():
                raise InputError(f"{path}: no such file, expected one in PEM")
        certificate, key = options.cert.read_bytes(), options.key.read_bytes()
    elif options.tls:
        certificate, key = make_certificate(names)
    else:
        return None
    print(f"certificate, SHA-256: {fingerprint(certificate)}")
    return tls_context(certificate, key)


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


@in_one_line
def main(arguments: list[str]) -> int:
    options = parsed(arguments)
    names = names_of(options.host)
    context = context_of(options, names)
    try:
        asyncio.run(serve(options, names, context))
    except KeyboardInterrupt:
        print("ended")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
