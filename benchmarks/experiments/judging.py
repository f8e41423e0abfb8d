"""What the machines did, from the session's log, done again by the rehearsal's stand-in among true objects.

franka-sim and the motors know no arm and no object. So joints and cables as they were measured move the stand-in, whose
servos and motors lag once more behind them.
"""

from pathlib import Path

import numpy as np

from rehearsal.experiments.bench import Seen
from rehearsal.session import RATE, TICKS, Session
from trunkline.ar.session.log_format import JOINTS, TENDONS, TYPES
from trunkline.ar.session.log_reader import read_session_log
from trunkline.errors import InputError
from trunkline.recordings.logs.joint_stream import joint_stream
from trunkline.recordings.logs.log import read_log

BEFORE = 0.5  # s of rest before the first motion
MOVES = ("execute", "follow")


def done_again(session: Session, log: Path, begun: float) -> list[Seen]:
    """Frames of the run from where the machines first moved; none where they never did. begun: s of the server's clock
    at which the operator's began.

    Raises:
        InputError: the log lacks what was measured.
    """
    book = read_session_log(log)
    modes = [(event["time"] - begun, event["mode"]) for event in book.events if event["event"] == "mode"]
    first = next((time for time, mode in modes if mode in MOVES), None)
    if first is None:
        return []
    topics = read_log(log, [TYPES[JOINTS].replace("/msg/", "/")]).topics
    if JOINTS not in topics or TENDONS not in topics:
        raise InputError(f"{log}: found no {JOINTS} or {TENDONS}, expected what was measured of the machines")
    joints, pulls = (joint_stream(topics[name]) for name in (JOINTS, TENDONS))
    times = [1e-9 * (stream.stamps - book.zero) - begun for stream in (joints, pulls)]
    robot, frames, now, last = session.robot, [], first - BEFORE, min(times[0][-1], times[1][-1])
    while now < last:
        for tick in range(TICKS):
            at = now + tick / RATE / TICKS
            sent, wound = (
                np.array([np.interp(at, time, column) for column in stream.positions.T])
                for time, stream in zip(times, (joints, pulls), strict=True)
            )
            robot.send(sent, wound)
            robot.advance(1 / RATE / TICKS)
        now += 1 / RATE
        if now >= first:
            mode = next((mode for time, mode in reversed(modes) if time <= now), "hold")
            commands, (units, _) = session.package.straight - wound, robot.links()
            frames.append(Seen(now, mode, robot.truth(), session.place(now), sent, commands, units))
    return frames
