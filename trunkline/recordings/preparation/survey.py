"""What a log holds, before anybody says what it is: topics, rates, bodies, gaps."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.logs.bag2 import read_recording
from trunkline.recordings.logs.cdr import short_name
from trunkline.recordings.logs.joint_stream import JointStream
from trunkline.recordings.logs.mcap_log import Log, Topic
from trunkline.recordings.logs.messages import JOINTS, POSES
from trunkline.recordings.logs.pose_stream import PoseStream, pose_stream
from trunkline.recordings.session.source import (
    COMMAND_WORDS,
    POSITION_WORDS,
    TWIN,
    motor_stream,
    pose_topics,
    several_frames,
    static_topics,
    topics_in_frames,
    without_unset,
)
from trunkline.recordings.signals.even_times import is_uneven

LIVE = "/core/input"  # a topic of a live session alone
OTHERS = re.compile(r"/headset/|/joint_states$|/joints/command$")  # of people and of the rigid robot
GAP = 1.5  # median intervals between frames that make a gap


@dataclass
class LogSurvey:
    """A log and what could be read in it. notes: why something could not. pose_topics: as in `source`.

    Of a table: tables, the lines of session.yaml that say how it was read; unit, of its positions, where it says so;
    label, of the trial.
    """

    log: Log
    notes: list[str] = field(default_factory=list)
    pose_topics: dict[str | None, Topic] = field(default_factory=dict)
    poses: PoseStream | None = None
    command_topic: str | None = None
    commands: JointStream | None = None
    position_topic: str | None = None
    tendon_positions: JointStream | None = None
    tables: list[str] = field(default_factory=list)
    unit: str | None = None
    label: str | None = None


def survey(path: Path) -> LogSurvey:
    """Look through a log.

    Raises:
        InputError: it cannot be read at all.
    """
    result = LogSurvey(read_recording(path, POSES.keys() | JOINTS.keys()))
    arms = _of_the_arm(result.log)
    try:
        result.pose_topics = pose_topics(arms, None)
        if result.pose_topics:
            result.poses = without_unset(pose_stream(result.pose_topics, statics=static_topics(result.log)))
            result.notes += result.poses.notes
            if clash := several_frames(topics_in_frames(result.poses, result.pose_topics)):
                result.notes.append(f"poses: {clash}")
    except (InputError, ValueError) as error:
        result.notes.append(f"poses: {error}")
    names = None
    for role, words in (("command", COMMAND_WORDS), ("position", POSITION_WORDS)):
        try:
            stream, notes = motor_stream(arms, None, role, words, names)
            result.notes += notes
            if stream is not None:
                result.notes += stream.notes
                setattr(result, f"{role}_topic", stream.topic)
                setattr(result, "commands" if role == "command" else "tendon_positions", stream)
                names = set(stream.names) if stream.unnamed is None else None
        except (InputError, ValueError) as error:
            result.notes.append(f"{role}: {error}")
    return result


def _of_the_arm(log: Log) -> Log:
    """A live session's log (docs/live-sessions.md) without the topics that are not the arm's; any other as it is."""
    if LIVE not in log.topics:
        return log
    return replace(log, topics={name: topic for name, topic in log.topics.items() if not OTHERS.match(name)})


def describe(result: LogSurvey) -> list[str]:
    """Lines for people to read."""
    log = result.log
    lines = [f"{log.path}", *filter(None, [log.kind and f"  {log.kind}"])]
    lines += [f"  damaged: {damage}" for damage in log.damage]
    if log.unchecked:
        lines.append(f"  {log.unchecked} of {log.count} messages without a checksum: bits that flipped there go unseen")
    width = max((len(name) for name in log.topics), default=0)
    for topic in sorted(log.topics.values(), key=lambda topic: topic.name):
        schema = short_name(topic.schema)
        use = "poses" if schema in POSES else "joints" if schema in JOINTS else "not read"
        use = "drawn by a twin, not read" if topic.name.endswith(TWIN) else use
        lines.append(
            f"  {topic.name:{width}}  {topic.schema or 'no schema'} ({topic.encoding}), {use}: "
            f"{len(topic.log_times)} messages{_pace(topic.log_times)}"
        )
    lines += [f"  {note}" for note in result.notes]
    if result.poses is not None and len(result.poses.stamps):
        lines += _bodies(result.poses)
    return lines


def _pace(times: np.ndarray) -> str:
    """How long and how often; not by the median step, which late deliveries shorten."""
    seconds = (times[-1] - times[0]) * 1e-9
    return f" in {seconds:.2f} s, {(len(times) - 1) / seconds:.1f} Hz" if seconds > 0 else ""


def _bodies(poses: PoseStream) -> list[str]:
    """One line a body: how often it is seen, and its gaps."""
    clock = poses.stamps if poses.stamps.any() else poses.log_times
    order = np.argsort(clock, kind="stable")
    time = (clock[order] - clock[order[0]]) * 1e-9
    interval = np.median(np.diff(time)) if len(time) > 1 else np.inf
    steps = np.diff(time) / interval if interval > 0 else np.ones(0)
    numbers = np.diff(poses.frames[order]) if poses.frames is not None else np.zeros(len(time) - 1)
    if len(numbers) and np.all(numbers > 0):
        steps = numbers / np.median(numbers)
    missing = f"{int(np.sum(np.maximum(np.round(steps) - 1, 0)))} frames missing in between"
    if not np.all(numbers > 0):
        missing = "they come at uneven times" if is_uneven(time) else missing
    oriented = "with" if poses.quaternions is not None else "without"
    numbers = "" if poses.frames is None else ", with frame numbers"
    lines = [
        f"  {len(time)} frames of {len(poses.names)} bodies, {oriented} orientations{numbers}; "
        f"{missing}; {poses.undecodable} messages unreadable"
    ]
    width = max(map(len, poses.names), default=0)
    for index, name in enumerate(poses.names):
        visible = time[poses.present[order, index]]
        gaps = np.diff(visible)
        gaps = gaps[gaps > GAP * interval]
        longest = f", {len(gaps)} gaps, the longest {1e3 * gaps.max():.0f} ms" if len(gaps) else ""
        lines.append(f"    {name:{width}}  seen in {100 * len(visible) / len(time):.1f} %{longest}")
    return lines
