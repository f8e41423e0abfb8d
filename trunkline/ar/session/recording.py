"""A live session's log as the page replays it: a frame `robot` of docs/live-sessions.md for each pose, its length
before it.

    python -m trunkline.ar.session.recording LOG RECORDING

The page, opened at a session of the same package, plays RECORDING: *Replay a recording*.
"""

import argparse
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from trunkline.ar.session import binary
from trunkline.ar.session.log_format import POSES, TWIN
from trunkline.ar.session.log_reader import LogReader, read_session_log
from trunkline.errors import InputError, in_one_line

LENGTH = struct.Struct("<I")  # bytes of the message that follows


def recorded(log: LogReader) -> Iterator[bytes]:
    """The messages, each with its length before it; no marker is there, and no flag is set.

    Raises:
        InputError: the log has no poses.
    """
    poses = log.drawn
    if poses is None or poses.quaternions is None or not len(poses.stamps):
        raise InputError(f"{log.path}: {POSES}: found no poses, expected those of the robot's bodies")
    frames, bodies, _ = poses.positions.shape
    rows = np.full((frames, bodies + len(binary.MARKERS), len(binary.POSE)), np.nan)
    rows[:, :bodies] = np.concatenate([poses.positions, poses.quaternions], axis=2)
    times = 1e-9 * (poses.stamps - log.zero)
    for number, (time, row) in enumerate(zip(times, rows, strict=True), 1):
        message = binary.frame("robot", set(), len(row), number, float(time), row)
        yield LENGTH.pack(len(message)) + message


@in_one_line
def main(arguments: list[str]) -> int:
    summary = (__doc__ or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m trunkline.ar.session.recording", description=summary)
    parser.add_argument("log", type=Path)
    parser.add_argument("recording", type=Path)
    args = parser.parse_args(arguments)
    log = read_session_log(args.log)
    for damage in log.damage:
        print(f"{args.log}: {damage}")
    messages = list(recorded(log))
    if log.twin is not None:
        print(f"{args.log}: {TWIN}: its bodies are as a twin drew them: nobody saw the arm")
    try:
        args.recording.write_bytes(b"".join(messages))
    except OSError as error:
        raise InputError(f"{args.recording}: {(error.strerror or str(error)).lower()}, expected a file") from error
    print(f"{args.recording}: {len(messages)} frames")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
