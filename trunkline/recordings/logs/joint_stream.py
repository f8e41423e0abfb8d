"""A topic's messages as arrays: all joint positions of a log."""

from dataclasses import dataclass

import numpy as np

from trunkline.recordings.logs.cdr import short_name
from trunkline.recordings.logs.encodings import decode
from trunkline.recordings.logs.mcap_log import Topic
from trunkline.recordings.logs.messages import JOINTS, READING
from trunkline.recordings.logs.samples import union


@dataclass
class JointStream:
    """T messages, K joints. stamps, log_times: (T,) ns. positions: (T, K) m, NaN where absent.

    timed: whether the messages have stamps; without, stamps are the log times. unnamed: as for poses.
    """

    topic: str
    stamps: np.ndarray
    log_times: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    undecodable: int
    timed: bool = True
    unnamed: int | None = None


def joint_stream(topic: Topic) -> JointStream:
    """All messages of a topic whose schema is in `JOINTS`; numbers without names go by their place, from 1.

    Raises:
        ValueError: the messages cannot be read at all.
    """
    reader, batches, unnamed, timed = JOINTS[short_name(topic.schema)], [], None, True
    for rows, message in decode(topic):
        try:
            joints = reader(message)
            positions = joints.positions.reshape(rows.size, joints.positions.shape[-1])
        except READING:
            continue
        names = joints.names
        if names is None:
            unnamed = max(unnamed or 0, positions.shape[1])
            names = [str(number + 1) for number in range(positions.shape[1])]
        timed &= joints.time is not None
        if len(names) == positions.shape[1]:
            batches.append((np.atleast_1d(rows), list(names), positions, joints.time))
    names = union([(rows, names) for rows, names, *_ in batches])
    positions = np.full((len(topic.messages), len(names)), np.nan)
    stamps, readable = topic.log_times.copy(), np.zeros(len(topic.messages), bool)
    for rows, some, values, time in batches:
        readable[rows] = True
        positions[np.ix_(rows, [names.index(name) for name in some])] = values
        if timed:
            stamps[rows] = time
    return JointStream(
        topic=topic.name,
        stamps=stamps[readable],
        log_times=topic.log_times[readable],
        names=names,
        positions=positions[readable],
        undecodable=len(topic.messages) - int(readable.sum()),
        timed=timed,
        unnamed=unnamed,
    )
