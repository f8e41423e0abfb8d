"""The log of a live session read back: the core's steps, byte for byte, events, and the arm's bodies."""

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trunkline.ar.session.log_format import EVENTS, INPUT, INTENT, JOINTS, POSES, SIMULATED, TWIN
from trunkline.errors import InputError
from trunkline.recordings.logs.cdr import HEADER
from trunkline.recordings.logs.joint_stream import JointStream, joint_stream
from trunkline.recordings.logs.mcap_log import Log, read_log
from trunkline.recordings.logs.pose_stream import PoseStream, pose_stream

INPUT_KEY = b',"given":'


class LogStep(NamedTuple):
    """Of the core: `time`, s since the log's first step, `dt`, s, and the bytes of its `Input` and `Intent`."""

    time: float
    dt: float
    input: bytes
    intent: bytes


@dataclass(frozen=True)
class LogReader:
    """`damage`: what is lost, in sentences. zero: ns since 1970 at 0 s of the events' `time`. events: in their order,
    each with its kind as `event`. poses: of the robot's bodies; None of a real robot, where they are not measured.
    twin: poses of the twin of a real robot. joints: the rigid robot's, as measured."""

    path: Path
    damage: list[str]
    zero: int
    events: list[dict]
    steps: list[LogStep]
    poses: PoseStream | None
    twin: PoseStream | None
    joints: JointStream | None

    @property
    def begin(self) -> dict:
        """The event with which a session begins.

        Raises:
            InputError: there is none.
        """
        event = next((event for event in self.events if event["event"] == "begin"), None)
        if event is None:
            raise InputError(f"{self.path}: {EVENTS}: found no event 'begin', expected the log of a live session")
        return event

    @property
    def drawn(self) -> PoseStream | None:
        """The bodies as a page draws them: as measured, or else those of the twin."""
        return self.poses if self.twin is None else self.twin

    @property
    def hardware(self) -> str:
        """What was real, in words; older logs do not say, and are of simulated robots."""
        return self.begin.get("hardware", SIMULATED)


def read_session_log(path: Path) -> LogReader:
    """All of it that can be trusted.

    Raises:
        InputError: it is no log of a live session.
    """
    return session_log(read_log(path))


def session_log(log: Log) -> LogReader:
    """As `read_session_log`, of a log that was read."""
    try:
        events = [json.loads(text) for text, _ in _texts(log, EVENTS)]
        zero = next((logged - round(1e9 * json.loads(text)["time"]) for text, logged in _texts(log, EVENTS)), 0)
        steps = _steps(log)
    except ValueError as error:
        raise InputError(f"{log.path}: {error}, expected the log of a live session") from error
    if not steps:
        raise InputError(f"{log.path}: {INPUT}: found no step of the core, expected the log of a live session")
    poses, twin = (pose_stream({None: log.topics[name]}) if name in log.topics else None for name in (POSES, TWIN))
    joints = joint_stream(log.topics[JOINTS]) if JOINTS in log.topics else None
    return LogReader(log.path, log.damage, zero, events, steps, poses if twin is None else None, twin, joints)


def _steps(log: Log) -> list[LogStep]:
    """A last input whose intent was lost is left out."""
    steps, since = [], None
    for (text, logged), (intent, _) in zip(_texts(log, INPUT), _texts(log, INTENT), strict=False):
        before, there, input = text.partition(INPUT_KEY)
        if not there:
            raise ValueError(f"{INPUT}: found no input in {text[:40]!r}")
        since = logged if since is None else since
        steps.append(LogStep(1e-9 * (logged - since), float(before.removeprefix(b'{"dt":')), input[:-1], intent))
    return steps


def _texts(log: Log, topic: str) -> list[tuple[bytes, int]]:
    """Each message's text, and its log time, ns.

    Raises:
        ValueError: one is no std_msgs/String.
    """
    messages = log.topics.get(topic)
    if messages is None:
        return []
    return [(_text(m, topic), int(t)) for m, t in zip(messages.messages, messages.log_times, strict=True)]


def _text(message: bytes, topic: str) -> bytes:
    try:
        (size,) = struct.unpack_from("<I", message, HEADER)
    except struct.error as error:
        raise ValueError(f"{topic}: found a message of {len(message)} bytes") from error
    return message[HEADER + 4 : HEADER + 4 + size].rstrip(b"\0")


def tip_path(poses: np.ndarray, place: tuple[float, float, float]) -> np.ndarray:
    """Of the point at `place` (m) of a body with `poses` (T, 7), w first. Shape (T, 3)."""
    w, u = poses[:, 3:4], poses[:, 4:]
    t = 2 * np.cross(u, np.array(place))
    return poses[:, :3] + np.array(place) + w * t + np.cross(u, t)
