"""A live session's log through the core again: are the intents the same, byte for byte?

    python -m trunkline.ar.session.replay LOG PACKAGE

PACKAGE: what the session was begun with, a folder or .tgz. Ends with 1 at a difference, and names the first: when,
which field, what was found and what the log has.
"""

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from pydantic import TypeAdapter, ValidationError

from trunkline.ar.session.log_reader import LogReader, LogStep, read_session_log
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Input, from_json, to_json
from trunkline.ar.teleop.reach import MapReach, Reach
from trunkline.ar.teleop.settings import Teleop
from trunkline.errors import InputError, first_problem, in_one_line
from trunkline.twin import package
from trunkline.unity import unpacked

MISSING = "nothing"


class Difference(NamedTuple):
    """The first: of step `number`, from 1, at `time`, s; `field` of the intent, what the core gave and the log has."""

    number: int
    time: float
    field: str
    replayed: object
    expected: object

    def __str__(self) -> str:
        where = f"step {self.number} at {self.time:.3f} s: {self.field}"
        return f"{where}: found {self.replayed}, expected {self.expected} of the log"


def replay(steps: Iterable[LogStep], core: Teleoperation) -> Difference | None:
    """The first difference; None where every intent is the same."""
    state = core.start()
    for number, step in enumerate(steps, 1):
        state, intent = core.step(state, from_json(Input, step.input), step.dt)
        replayed = to_json(intent)
        if replayed != step.intent:
            return Difference(number, step.time, *_first(json.loads(replayed), json.loads(step.intent)))
    return None


def core_of(log: LogReader, package: str, reach: Reach) -> Teleoperation:
    """The core as the session had it.

    Raises:
        InputError: the log is of another package, or its settings are none.
    """
    begin = log.begin
    if begin["package"] != package:
        reason = f"found digest {package[:12]}, expected {begin['package'][:12]}"
        raise InputError(f"{log.path}: package: {reason}, with which the session was begun")
    try:
        settings = TypeAdapter(Teleop).validate_python(begin["settings"])
    except ValidationError as error:
        raise InputError(f"{log.path}: settings: {first_problem(error)}, of version {begin['version']}") from error
    return Teleoperation(settings, reach, package, begin["mount_offset"])


def _first(replayed: object, expected: object, field: str = "") -> tuple[str, object, object]:
    """Where two values of JSON differ first, by name, and what is there."""
    if isinstance(replayed, list) and isinstance(expected, list):
        replayed, expected = (dict(enumerate(values)) for values in (replayed, expected))
    if isinstance(replayed, dict) and isinstance(expected, dict):
        for key in {**expected, **replayed}:
            a, b = replayed.get(key, MISSING), expected.get(key, MISSING)
            if repr(a) != repr(b):
                return _first(a, b, f"{field}.{key}".strip("."))
    return field or "the whole", replayed, expected


@in_one_line
def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m trunkline.ar.session.replay", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("log", type=Path)
    parser.add_argument("package", type=Path)
    args = parser.parse_args(arguments)
    log, files = read_session_log(args.log), package.read_package(args.package)
    core = core_of(log, package.package_digest(files), MapReach.from_arrays(unpacked.maps_of(files)))
    for damage in log.damage:
        print(f"{args.log}: {damage}")
    difference = replay(log.steps, core)
    count, seconds = len(log.steps), log.steps[-1].time
    print(difference or f"{count} steps in {seconds:.1f} s: the same intents, byte for byte")
    return 1 if difference else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
