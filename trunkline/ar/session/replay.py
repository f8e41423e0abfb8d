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
from trunkline.errors import InputError, in_one_line
from trunkline.unity import unpacked

MISSING = "nothing"


class Difference(NamedTuple):
    """The first: of step `number`, from 1, at `time`, s; `field` of the intent, what the core gave and the log has."""

    number: int
    time: float
    field: str
    found: object
    expected: object

    def __str__(self) -> str:
        where = f"step {self.number} at {self.time:.3f} s: {self.field}"
        return f"{where}: found {self.found}, expected {self.expected} of the log"


def replay(steps: Iterable[LogStep], core: Teleoperation) -> Difference | None:
    """The first difference; None where every intent is the same."""
    state = core.start()
    for number, step in enumerate(steps, 1):
        state, intent = core.step(state, from_json(Input, step.given), step.dt)
        found = to_json(intent)
        if found != step.intent:
            return Difference(number, step.time, *_first(json.loads(found), json.loads(step.intent)))
    return None


def core_of(logbook: LogReader, package: str, reach: Reach) -> Teleoperation:
    """The core as the session had it.

    Raises:
        InputError: the log is of another package, or its settings are none.
    """
    begin = logbook.begin
    if begin["package"] != package:
        found = f"found digest {package[:12]}, expected {begin['package'][:12]}"
        raise InputError(f"{logbook.path}: package: {found}, with which the session was begun")
    try:
        settings = TypeAdapter(Teleop).validate_python(begin["settings"])
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise InputError(f"{logbook.path}: settings: {where}: {first['msg']}, of version {begin['version']}") from error
    return Teleoperation(settings, reach, package, begin["mount_offset"])


def _first(found: object, expected: object, field: str = "") -> tuple[str, object, object]:
    """Where two values of JSON differ first, by name, and what is there."""
    if isinstance(found, list) and isinstance(expected, list):
        found, expected = (dict(enumerate(values)) for values in (found, expected))
    if isinstance(found, dict) and isinstance(expected, dict):
        for key in {**expected, **found}:
            a, b = found.get(key, MISSING), expected.get(key, MISSING)
            if repr(a) != repr(b):
                return _first(a, b, f"{field}.{key}".strip("."))
    return field or "the whole", found, expected


@in_one_line
def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m trunkline.ar.session.replay", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("log", type=Path)
    parser.add_argument("package", type=Path)
    told = parser.parse_args(arguments)
    logbook, files = read_session_log(told.log), unpacked.read_package(told.package)
    core = core_of(logbook, unpacked.package_digest(files), MapReach.from_arrays(unpacked.maps_of(files)))
    for damage in logbook.damage:
        print(f"{told.log}: {damage}")
    difference = replay(logbook.steps, core)
    count, seconds = len(logbook.steps), logbook.steps[-1].time
    print(difference or f"{count} steps in {seconds:.1f} s: the same intents, byte for byte")
    return 1 if difference else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
