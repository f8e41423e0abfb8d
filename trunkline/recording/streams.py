"""A topic's messages as arrays: all poses, or all joint positions, of a log."""

from dataclasses import dataclass

import numpy as np

from trunkline.recording.cdr import decode, parse_definition, short_name
from trunkline.recording.log import Topic
from trunkline.recording.messages import JOINTS, POSES


@dataclass
class PoseStream:
    """T messages, B bodies. stamps, log_times: (T,) ns, of the header and the recorder. frames: (T,) or None.

    present: (T, B) whether a body is in a message. positions: (T, B, 3) in the log's unit, quaternions:
    (T, B, 4) wxyz or None; NaN where absent. undecodable: messages that do not fit their schema.
    """

    stamps: np.ndarray
    log_times: np.ndarray
    frames: np.ndarray | None
    names: tuple[str, ...]
    present: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray | None
    undecodable: int


@dataclass
class JointStream:
    """T messages, K joints. stamps, log_times: (T,) ns. positions: (T, K) m, NaN where absent."""

    topic: str
    stamps: np.ndarray
    log_times: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    undecodable: int


def pose_stream(topic: Topic) -> PoseStream:
    """All messages of a topic whose schema is in `POSES`."""
    batches, kept = _read(topic, POSES[short_name(topic.schema)])
    names = _union(batches)
    positions = np.full((len(topic.messages), len(names), 3), np.nan)
    quaternions = np.full((len(topic.messages), len(names), 4), np.nan)
    present = np.zeros(positions.shape[:2], bool)
    stamps = np.zeros(len(topic.messages), np.int64)
    frames = np.zeros(len(topic.messages), np.int64)
    oriented, numbered = False, True
    for rows, poses in batches:
        columns = [names.index(name) for name in poses.names]
        stamps[rows] = poses.time
        present[np.ix_(rows, columns)] = True
        positions[np.ix_(rows, columns)] = poses.positions
        if poses.orientations is not None:
            quaternions[np.ix_(rows, columns)] = poses.orientations
            oriented = True
        if poses.frame is not None:
            frames[rows] = poses.frame
        numbered &= poses.frame is not None
    return PoseStream(
        stamps[kept],
        topic.log_times[kept],
        frames[kept] if numbered else None,
        names,
        present[kept],
        positions[kept],
        quaternions[kept] if oriented else None,
        len(topic.messages) - int(kept.sum()),
    )


def joint_stream(topic: Topic) -> JointStream:
    """All messages of a topic whose schema is in `JOINTS`."""
    batches, kept = _read(topic, JOINTS[short_name(topic.schema)])
    names = _union(batches)
    positions = np.full((len(topic.messages), len(names)), np.nan)
    stamps = np.zeros(len(topic.messages), np.int64)
    for rows, joints in batches:
        stamps[rows] = joints.time
        positions[np.ix_(rows, [names.index(name) for name in joints.names])] = joints.positions
    undecodable = len(topic.messages) - int(kept.sum())
    return JointStream(topic.name, stamps[kept], topic.log_times[kept], names, positions[kept], undecodable)


def _read(topic: Topic, reader) -> tuple[list, np.ndarray]:
    """(rows, what `reader` makes of them) for each batch, and which messages (N,) could be read."""
    definitions = parse_definition(topic.schema, topic.definition)
    batches = [(rows, reader(message)) for rows, message in decode(topic.messages, topic.schema, definitions)]
    kept = np.zeros(len(topic.messages), bool)
    for rows, _ in batches:
        kept[rows] = True
    return batches, kept


def _union(batches: list) -> tuple[str, ...]:
    """All names, in the order of their first appearance."""
    first = {}
    for rows, sample in batches:
        for place, name in enumerate(sample.names):
            first[name] = min(first.get(name, (len(rows) + rows[0], place)), (int(rows[0]), place))
    return tuple(sorted(first, key=first.get))
