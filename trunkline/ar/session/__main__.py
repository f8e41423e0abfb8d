"""A live session in a browser or a headset, on the simulated robot unless a real one is named.

    trunkline live PACKAGE [--host ADDRESS --tls | --cert FILE --key FILE] [--port N]
                             [--dry-run | [--robot panda|fr3|ros2] [--motors gm6020 --bus can0 [--interface NAME]]]
                             [--cameras simulated|natnet|ros2|qualisys]

PACKAGE: the folder or .tgz that the stage package_unity writes. It listens on this machine alone; a headset comes over
USB: `adb reverse tcp:8443 tcp:8443`. Another address needs TLS. The address that is printed opens the session: whoever
has it may control the robot. What happens is logged: docs/live-sessions.md.
"""

import argparse
import asyncio
import ssl
import sys
from pathlib import Path

from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.session.auth import is_local, names_of
from trunkline.ar.session.hardware import CAMERAS, MOTORS, ROBOTS
from trunkline.ar.session.tls import fingerprint, make_certificate, tls_context
from trunkline.errors import InputError, in_one_line
from trunkline.program import program_name

PORT = 8443  # kept: anchors of a headset belong to scheme, host and port
ANY = ("0.0.0.0", "::", "")


def parsed(arguments: list[str]) -> argparse.Namespace:
    """
    Raises:
        InputError: an address that others reach, without TLS.
    """
    parser = argparse.ArgumentParser(
        prog=program_name("live"), description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("package", type=Path, metavar="PACKAGE", help="folder or .tgz that package_unity writes")
    parser.add_argument("--host", default="127.0.0.1", help="an address of this machine")
    parser.add_argument("--port", type=int, default=PORT)
    parser.add_argument("--tls", action="store_true", help="with a certificate made now")
    parser.add_argument("--cert", type=Path, help="a certificate of your own, PEM")
    parser.add_argument("--key", type=Path, help="its key, PEM")
    parser.add_argument("--dry-run", action="store_true", help="on the simulated robot, as without --robot, --motors")
    parser.add_argument("--cameras", choices=CAMERAS, default="", help="of the arm; conf/live says where they are")
    parser.add_argument("--robot", choices=ROBOTS, default=ROBOTS[0], help="docs/hardware.md says what was tried")
    parser.add_argument("--motors", choices=MOTORS, default=MOTORS[0], help="of the tendons")
    parser.add_argument("--bus", default="", help=f"the motors', such as can0; {SIMULATED}: simulated motors behind it")
    parser.add_argument("--interface", default="", help="python-can's, for the bus; socketcan unless it is named")
    args = parser.parse_args(arguments)
    if (args.cert is None) != (args.key is None):
        raise InputError("--cert, --key: found one of them, expected both")
    if not is_local(args.host) and not (args.tls or args.cert):
        raise InputError(f"--host {args.host}: found no TLS, expected --tls, or --cert and --key: others reach it")
    if args.host in ANY:
        raise InputError(f"--host {args.host}: found every address, expected one: the page is served under it alone")
    if args.dry_run and (args.robot != ROBOTS[0] or args.motors != MOTORS[0]):
        raise InputError("--dry-run: found --robot or --motors besides, expected it alone: nothing real moves")
    if args.cameras == "simulated" and (args.robot != ROBOTS[0] or args.bus):
        raise InputError("--cameras simulated: found --robot or --bus besides, expected it alone: it sees no real arm")
    if not 0 < args.port < 65536:
        raise InputError(f"--port: found {args.port}, expected 1 to 65535")
    return args


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


@in_one_line
def main(arguments: list[str]) -> int:
    options = parsed(arguments)
    names = names_of(options.host)
    context = context_of(options, names)
    from trunkline.ar.session.serving import serve  # not above: its processes import this file too, and want none of it

    try:
        asyncio.run(serve(options, names, context))
    except (KeyboardInterrupt, asyncio.CancelledError):
        print("ended")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
