"""One log, decoded: which topic holds the poses and which the tendons."""

from dataclasses import dataclass
from pathlib import Path

from trunkline.errors import InputError
from trunkline.recording.cdr import short_name
from trunkline.recording.log import Log, Topic, read_log
from trunkline.recording.messages import JOINTS, POSES
from trunkline.recording.session import Topics
from trunkline.recording.streams import JointStream, PoseStream, joint_stream, pose_stream


@dataclass
class Source:
    """One log, decoded. log: without its messages, which are decoded. joint_topics: all whose schema is in `JOINTS`."""

    log: Log
    pose_topic: str
    poses: PoseStream
    commands: JointStream | None
    tendon_positions: JointStream | None
    joint_topics: tuple[str, ...]


def open_log(path: Path, topics: Topics) -> Source:
    """Read and decode a log.

    Raises:
        InputError: naming the file and the topic, where the poses are missing or the topics are not clear.
    """
    log = read_log(path)
    poses = _choose(log, topics.poses, POSES, "pose")
    if poses is None:
        found = ", ".join(f"{t.name} ({t.schema})" for t in log.topics.values()) or "no readable message"
        named = "" if topics.poses is None else f"{topics.poses!r} of session.yaml with "
        damage = f"; the log is damaged: {'; '.join(log.damage)}" if log.damage else ""
        raise InputError(f"{path}: no pose topic, found {found}{damage}, expected {named}one of {', '.join(POSES)}")
    joints = [
        None if topic is None else joint_stream(topic)
        for topic in (
            _choose(log, topics.commands, JOINTS, "command", wanted=("command", "cmd", "target")),
            _choose(log, topics.tendon_positions, JOINTS, "tendon position", wanted=("state", "position")),
        )
    ]
    stream = pose_stream(poses)
    if not len(stream.stamps):
        raise InputError(f"{path}: {poses.name}: no message fits its schema {poses.schema}")
    joint_topics = tuple(name for name, t in log.topics.items() if short_name(t.schema) in JOINTS)
    log.topics = {}  # decoded: the raw messages can go
    return Source(log, poses.name, stream, *joints, joint_topics)


def _choose(log: Log, name: str | None, registry: dict, role: str, wanted: tuple[str, ...] = ("",)) -> Topic | None:
    """The topic that the session names, or the only one whose schema fits and whose name tells its role."""
    fitting = [topic for topic in log.topics.values() if short_name(topic.schema) in registry]
    if name is not None:
        topic = log.topics.get(name)
        if topic is not None and topic not in fitting:
            expected = ", ".join(registry)
            raise InputError(f"{log.path}: {name}: found {topic.schema}, expected a {role} schema: {expected}")
        return topic
    told = [topic for topic in fitting if any(word in topic.name for word in wanted)]
    if len(told) > 1:
        found = ", ".join(topic.name for topic in told)
        raise InputError(f"{log.path}: {role} topic: found {found}, expected one, or its name in session.yaml: topics")
    return told[0] if told else None
