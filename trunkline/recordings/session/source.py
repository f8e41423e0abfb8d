"""One log, decoded: which topics hold the poses and which the tendons."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.logs.bag2 import read_recording
from trunkline.recordings.logs.cdr import short_name
from trunkline.recordings.logs.joint_stream import JointStream, joined, joint_stream
from trunkline.recordings.logs.mcap_log import Log, Topic
from trunkline.recordings.logs.messages import JOINTS, POSES, TOPIC_PER_BODY
from trunkline.recordings.logs.pose_stream import PoseStream, pose_stream
from trunkline.recordings.session.session import NONE, Session
from trunkline.recordings.trials.recording import FORCE

Stream = TypeVar("Stream")
Dated = TypeVar("Dated", PoseStream, JointStream)
UNSET = 86_400_000_000_000  # ns, a day from the others, by which a clock is another than theirs
STATIC = "tf_static"  # how the topic's name ends
TWIN = "tf_twin"  # the same, of poses that a model drew and nobody measured (docs/live-sessions.md)
COMMAND_WORDS, POSITION_WORDS = ("command", "cmd", "target"), ("state", "position")


@dataclass
class LogSource:
    """One log, decoded. log: without its messages, which are decoded. pose_topic: for people to read.

    joint_topics: all whose schema is in `JOINTS`. frames: that the poses are in, as messages name them.
    """

    log: Log
    pose_topic: str
    poses: PoseStream
    commands: JointStream | None
    tendon_positions: JointStream | None
    joint_topics: tuple[str, ...]
    frames: tuple[str, ...]


def open_log(path: Path, session: Session) -> LogSource:
    """Read and decode a log.

    Raises:
        InputError: naming the file and the topic, where the poses are missing or the topics are not clear.
    """
    log = read_recording(path, POSES.keys() | JOINTS.keys())
    topics = pose_topics(log, session.topics.poses)
    if not topics:
        problem = ", ".join(f"{t.name} ({t.schema})" for t in log.topics.values()) or "no readable message"
        wanted = session.topics.poses
        named = "" if wanted is None else f"{wanted!r} of session.yaml with "
        damage = f"; the log is damaged: {'; '.join(log.damage)}" if log.damage else ""
        raise InputError(f"{path}: no pose topic, found {problem}{damage}, expected {named}one of {', '.join(POSES)}")
    name = ", ".join(topic.name for topic in topics.values())
    where = f"{path}: {name}"
    poses = _understood(where, pose_stream, topics, session.bodies, session.frame.name, static_topics(log))
    if poses.unnamed is not None:
        problem = f"found {poses.unnamed} poses without names"
        raise InputError(f"{where}: {problem}, expected `bodies` in session.yaml to name them, in order")
    if not len(poses.stamps):
        schema = next(iter(topics.values())).schema
        names = f" with {len(session.bodies)} `bodies`, as in session.yaml" if session.bodies else ""
        problem = f"no message fits its schema {schema}{names}{poses.misfit and f': {poses.misfit}'}"
        if poses.twice is not None:
            problem = f"found {poses.twice!r} twice in a message, expected each body once"
        raise InputError(f"{where}: {problem}")
    if len(poses.parents) > 1 and session.frame.name is None:
        problem = f"found poses in the frames {', '.join(poses.parents)}, which nothing connects"
        raise InputError(f"{where}: {problem}, expected one, or its name in session.yaml: frame.name")
    in_frame = topics_in_frames(poses, topics, session)
    if clash := several_frames(in_frame):
        raise InputError(f"{path}: {clash}")
    declared = session.tendons or session.motors
    names = None if declared is None else {*declared, *(session.tendons or {}).values()}
    chosen = session.topics
    commands, _ = _joints(log, chosen.commands, "command", COMMAND_WORDS, names, session)
    if names is None and commands is not None and commands.unnamed is None:
        names = set(commands.names)
    wound = NONE if session.command_unit == FORCE else chosen.tendon_positions
    tendon_positions, notes = _joints(log, wound, "tendon position", POSITION_WORDS, names, session)
    poses.notes += notes
    if session.clock != "log":
        poses = without_unset(poses)
        commands, tendon_positions = (some and without_unset(some) for some in (commands, tendon_positions))
    joint_topics = tuple(name for name, t in log.topics.items() if short_name(t.schema) in JOINTS)
    log.topics = {}  # decoded: the raw messages can go
    return LogSource(log, name, poses, commands, tendon_positions, joint_topics, (*in_frame, *poses.parents))


def topics_in_frames(
    poses: PoseStream, topics: dict[str | None, Topic], session: Session | None = None
) -> dict[str, list[str]]:
    """The frames that poses of the session, or any, are in by their headers, each with its topics.

    A frame that is called as the topic's own body is none that it could be in: some drivers write that name.
    """
    used = None
    if session is not None and session.markers is not None:
        used = {*session.markers, session.base if isinstance(session.base, str) else ""}
    in_frame: dict[str, list[str]] = {}
    for body, topic in topics.items():
        if used is None or body is None or body in used:
            for frame in poses.header_frames.get(topic.name, ()):
                if frame != body:
                    in_frame.setdefault(frame, []).append(topic.name)
    return in_frame


def several_frames(in_frame: dict[str, list[str]]) -> str:
    """That topics are in several frames, where they are, with topics and frames; else empty."""
    if len(in_frame) < 2:
        return ""
    frames = ", ".join(f"{frame!r} ({', '.join(names)})" for frame, names in in_frame.items())
    return f"header.frame_id: found poses in the frames {frames}, expected all of them in one"


def _joints(
    log: Log, wanted: str | list[str] | dict[str, str] | None, role: str, words: tuple[str, ...],
    names: set[str] | None, session: Session,
) -> tuple[JointStream | None, list[str]]:  # fmt: skip
    """The stream of a role, and what is to be said of topics that were left out."""
    stream, notes = motor_stream(log, wanted, role, words, names, session.command_unit == FORCE)
    if stream is not None and stream.unnamed is not None and session.tendons is None and session.motors is None:
        problem = f"found {stream.unnamed} numbers without names"
        raise InputError(
            f"{log.path}: {stream.topic}: {problem}, expected `tendons` in session.yaml to name them, in order"
        )
    return stream, notes


def motor_stream(
    log: Log, wanted: str | list[str] | dict[str, str] | None, role: str, words: tuple[str, ...],
    names: set[str] | None, forces: bool = False,
) -> tuple[JointStream | None, list[str]]:  # fmt: skip
    """The topics of a role as one stream, and what is to be said of those that were left out. Several topics hold a
    motor each.

    Args: names: of the motors, where they are known; of topics that nobody named those that share none are left out.
        forces: as of `joint_stream`.
    """
    if wanted == NONE:
        return None, []
    if isinstance(wanted, dict):
        topics = {motor: choose(log, name, JOINTS, role) for motor, name in wanted.items()}
    elif isinstance(wanted, list):
        topics = {name: choose(log, name, JOINTS, role) for name in wanted}
    elif wanted is not None:
        topics = {wanted: choose(log, wanted, JOINTS, role)}
    else:
        several = _best(log, JOINTS, words)
        topics = dict(zip(_names_in(several), several, strict=True)) if several else {}
    streams, notes = [], []
    for motor, topic in topics.items():
        if topic is None:
            continue
        only = motor if len(topics) > 1 else None
        where, count = f"{log.path}: {topic.name}", len(topic.messages)
        stream = _understood(where, joint_stream, topic, only, forces)
        if count and stream.undecodable == count:
            reason = f": {stream.misfit}" if stream.misfit else ""
            raise InputError(f"{where}: none of its {count} messages fits their schema {topic.schema}{reason}")
        if wanted is None and names and stream.unnamed is None and stream.names and not names & set(stream.names):
            others = ", ".join(stream.names[:3]) + (", …" if len(stream.names) > 3 else "")
            notes.append(f"{topic.name} left out as {role} topic: found {others}, none of {', '.join(sorted(names))}")
            continue
        streams.append(stream)
    every = [name for stream in streams for name in stream.names]
    if len(set(every)) < len(every) and len(streams) > 1:
        listed = ", ".join(stream.topic for stream in streams)
        raise InputError(f"{log.path}: {role} topic: found {listed}, expected one, or its name in session.yaml: topics")
    return (joined(streams) if streams else None), notes


def without_unset(stream: Dated) -> Dated:
    """A stream of messages with stamps, without those whose sender's clock was not set yet."""
    if not stream.stamps.any():
        return stream
    good = np.abs(stream.stamps - np.median(stream.stamps)) < UNSET
    if good.all() or good.mean() < 0.5:
        return stream
    number, stamp = int(np.argmin(good)) + 1, 1e-9 * stream.stamps[np.argmin(good)]
    count = int(np.sum(~good))
    of = "the stamp of a message is" if count == 1 else f"stamps of {count} messages are"
    problem = f"{of} a day or more from the others, such as {stamp:.9g} s of number"
    stream = stream.take(good)
    stream.notes = [*stream.notes, f"{problem} {number}, as if a clock was not set yet: left out"]
    return stream


def pose_topics(log: Log, wanted: str | dict[str, str] | None) -> dict[str | None, Topic]:
    """The topic of all poses under None, or each body's topic under its name; empty where the log has none."""
    if isinstance(wanted, dict):
        chosen = {body: choose(log, name, POSES, "pose") for body, name in wanted.items()}
        return {body: topic for body, topic in chosen.items() if topic is not None}
    if wanted is None:
        single = [topic for topic in _best(log, POSES) if short_name(topic.schema) in TOPIC_PER_BODY]
        if single:
            return dict(zip(_names_in(single), single, strict=True))
    topic = choose(log, wanted, POSES, "pose")
    if topic is not None and short_name(topic.schema) in TOPIC_PER_BODY:
        return {topic.name.strip("/"): topic}
    return {} if topic is None else {None: topic}


def static_topics(log: Log) -> list[Topic]:
    """The topics of transforms that hold all the time."""
    return [topic for topic in log.topics.values() if topic.name.endswith(STATIC) and short_name(topic.schema) in POSES]


def choose(
    log: Log, name: str | None, registry: dict, role: str, wanted: tuple[str, ...] = ("",)
) -> Topic | None:
    """The topic that the session names, or the only one whose schema fits best and whose name tells its role."""
    if name is not None:
        topic = log.topics.get(name)
        if topic is not None and short_name(topic.schema) not in registry:
            expected = ", ".join(registry)
            raise InputError(f"{log.path}: {name}: found {topic.schema}, expected a {role} schema: {expected}")
        return topic
    candidates = _best(log, registry, wanted)
    if len(candidates) > 1:
        names = ", ".join(topic.name for topic in candidates)
        raise InputError(f"{log.path}: {role} topic: found {names}, expected one, or its name in session.yaml: topics")
    return candidates[0] if candidates else None


def _best(log: Log, registry: dict, words: tuple[str, ...] = ("",)) -> list[Topic]:
    """The topics with one of `words` in their names whose schema is registered first; not what never moves, nor what
    a model drew."""
    candidates = [
        topic
        for topic in log.topics.values()
        if short_name(topic.schema) in registry
        and any(word in topic.name for word in words)
        and not topic.name.endswith((STATIC, TWIN))
    ]
    rank = list(registry).index
    first = min((rank(short_name(topic.schema)) for topic in candidates), default=None)
    return [topic for topic in candidates if rank(short_name(topic.schema)) == first]


def _names_in(topics: list[Topic]) -> list[str]:
    """What tells topics apart: `/mocap/base/pose` and `/mocap/tip/pose` are base and tip."""
    paths = [topic.name.strip("/").split("/") for topic in topics]
    if len(paths) == 1:
        return ["/".join(paths[0])]
    shortest = min(map(len, paths))
    before = next((i for i in range(shortest) if len({p[i] for p in paths}) > 1), shortest)
    behind = next((i for i in range(shortest - before) if len({p[-1 - i] for p in paths}) > 1), 0)
    return ["/".join(path[before : len(path) - behind]) or "/".join(path) for path in paths]


def _understood(where: str, read: Callable[..., Stream], *arguments) -> Stream:
    """What `read` returns; that a topic cannot be read at all becomes the user's business."""
    try:
        return read(*arguments)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
