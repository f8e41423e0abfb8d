"""Messages of topics as arrays: all joint positions of a log."""

from dataclasses import dataclass, field, replace

import numpy as np

from trunkline.recordings.logs.cdr import short_name
from trunkline.recordings.logs.encodings import decode, readable_topic
from trunkline.recordings.logs.mcap_log import Topic
from trunkline.recordings.logs.messages import JOINTS, READING, misfit
from trunkline.recordings.logs.samples import union


@dataclass
class JointStream:
    """T messages, K joints. stamps, log_times: (T,) ns. positions: (T, K) m, or efforts, NaN where absent.

    sent: (T, K), which of them a message holds, as a finite number. topic: for people to read, of several.
    timed: whether the messages have stamps; without, stamps are the log times. undecodable, misfit, unnamed, notes: as
    for poses.
    """

    topic: str
    stamps: np.ndarray
    log_times: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    sent: np.ndarray
    undecodable: int
    misfit: str = ""
    timed: bool = True
    unnamed: int | None = None
    notes: list[str] = field(default_factory=list)

    def take(self, rows: np.ndarray) -> "JointStream":
        """Some of its messages, (T,) flags or indices."""
        return replace(
            self, stamps=self.stamps[rows], log_times=self.log_times[rows], positions=self.positions[rows],
            sent=self.sent[rows],
        )  # fmt: skip


def joint_stream(topic: Topic, name: str | None = None, forces: bool = False) -> JointStream:
    """All messages of a topic whose schema is in `JOINTS`; numbers without names go by their place, from 1.

    Args: name: of the one number that each message holds, where the topic names it. forces: whether the numbers are
    efforts where a message has any, and not positions.

    Raises:
        ValueError: the messages cannot be read at all.
    """
    topic, notes = readable_topic(topic)
    reader, batches, unnamed, timed, reason = JOINTS[short_name(topic.schema)], [], None, True, ""
    for rows, message in decode(topic):
        try:
            joints = reader(message)
            numbers = joints.efforts if forces and joints.efforts is not None else joints.positions
            positions = numbers.reshape(rows.size, numbers.shape[-1])
        except READING as error:
            reason = reason or misfit(error)
            continue
        names = joints.names
        if names is None and name is not None and positions.shape[1] == 1:
            names = [name]
        if names is None:
            unnamed = max(unnamed or 0, positions.shape[1])
            names = [str(number + 1) for number in range(positions.shape[1])]
        timed &= joints.time is not None
        if len(names) == positions.shape[1]:
            batches.append((np.atleast_1d(rows), list(names), positions, joints.time))
    names = union([(rows, names) for rows, names, *_ in batches])
    positions = np.full((len(topic.messages), len(names)), np.nan)
    sent = np.zeros(positions.shape, bool)
    stamps, readable, lacking = topic.log_times.copy(), np.zeros(len(topic.messages), bool), 0
    for rows, some, values, time in batches:
        readable[rows] = True
        columns = np.ix_(rows, [names.index(name) for name in some])
        positions[columns], sent[columns] = values, np.isfinite(values)
        lacking += int(np.sum(~np.isfinite(values).all(axis=1)))
        if timed:
            stamps[rows] = time
    if lacking:
        notes.append(f"{topic.name}: {lacking} messages hold numbers that are not finite: taken for motors not told")
    undecodable = len(topic.messages) - int(readable.sum())
    if undecodable:
        notes.append(f"{topic.name}: {undecodable} messages that do not fit their schema dropped")
    return JointStream(
        topic=topic.name,
        stamps=stamps[readable],
        log_times=topic.log_times[readable],
        names=names,
        positions=positions[readable],
        sent=sent[readable],
        undecodable=undecodable,
        misfit=reason,
        timed=timed,
        unnamed=unnamed,
        notes=notes,
    )


def joined(streams: list[JointStream]) -> JointStream:
    """Streams of different joints as one, in the order in which they were logged."""
    if len(streams) == 1:
        return streams[0]
    names = tuple(name for stream in streams for name in stream.names)
    order = np.argsort(np.concatenate([stream.log_times for stream in streams]), kind="stable")
    positions = np.full((len(order), len(names)), np.nan)
    sent = np.zeros(positions.shape, bool)
    row = column = 0
    for stream in streams:
        there = np.s_[row : row + len(stream.stamps), column : column + len(stream.names)]
        positions[there], sent[there] = stream.positions, stream.sent
        row, column = row + len(stream.stamps), column + len(stream.names)
    return JointStream(
        topic=", ".join(stream.topic for stream in streams),
        stamps=np.concatenate([stream.stamps for stream in streams])[order],
        log_times=np.concatenate([stream.log_times for stream in streams])[order],
        names=names,
        positions=positions[order],
        sent=sent[order],
        undecodable=sum(stream.undecodable for stream in streams),
        misfit=next((stream.misfit for stream in streams if stream.misfit), ""),
        timed=all(stream.timed for stream in streams),
        unnamed=max((stream.unnamed for stream in streams if stream.unnamed is not None), default=None),
        notes=list(dict.fromkeys(note for stream in streams for note in stream.notes)),
    )
