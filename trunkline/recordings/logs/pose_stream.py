"""A topic's messages as arrays: all poses of a log."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from trunkline.recordings.logs.cdr import short_name
from trunkline.recordings.logs.encodings import decode, readable_topic
from trunkline.recordings.logs.mcap_log import Topic
from trunkline.recordings.logs.messages import POSES, READING, DecodedPoses, misfit
from trunkline.recordings.logs.samples import PoseSamples, union
from trunkline.recordings.logs.transforms import in_one_frame

FEWEST = 10  # frames that differ, at least, before some are repeats
CLEAR = 10.0  # times the share that chance explains, by which they have to be more


class Batch(NamedTuple):
    """Messages of the same S bodies. rows: (n,) in the topic. time: ns, (n,), or (n, S) where each body has its own.

    positions: (n, S, 3). orientations: (n, S, 4). frame: (n,). The rest as in `Poses`.
    """

    rows: np.ndarray
    time: np.ndarray
    names: list[str]
    positions: np.ndarray
    orientations: np.ndarray | None
    frame: np.ndarray | None
    parents: list[str] | None


@dataclass
class PoseStream:
    """T frames, B bodies. stamps, log_times: (T,) ns, of the header and the recorder. frames: (T,) or None.

    present: (T, B) whether a body is in a frame. positions: (T, B, 3) in the log's unit, quaternions:
    (T, B, 4) wxyz or None; NaN where absent. undecodable: messages that do not fit their schema, or that hold
    another number of poses than there are names. misfit: why the first of them does not, "" where only its bytes are
    torn. unnamed: poses in a message that nobody names, else None.
    parents: names of the frames that the poses are in, where messages say it for each; several, where nothing
    connects them. header_frames: those that headers name, by topic, in which all poses of a message are. twice: a name
    that several poses of one message have, else None; such messages do not fit either. notes: what reading them took,
    a sentence each.
    """

    stamps: np.ndarray
    log_times: np.ndarray
    frames: np.ndarray | None
    names: tuple[str, ...]
    present: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray | None
    undecodable: int = 0
    misfit: str = ""
    unnamed: int | None = None
    parents: tuple[str, ...] = ()
    twice: str | None = None
    notes: list[str] = field(default_factory=list)
    header_frames: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def take(self, rows: np.ndarray) -> "PoseStream":
        """Some of its frames, (T,) flags or indices."""
        return replace(
            self,
            stamps=self.stamps[rows],
            log_times=self.log_times[rows],
            frames=None if self.frames is None else self.frames[rows],
            present=self.present[rows],
            positions=self.positions[rows],
            quaternions=None if self.quaternions is None else self.quaternions[rows],
        )


def pose_stream(
    topics: dict[str | None, Topic],
    bodies: Sequence[str] | None = None,
    frame: str | None = None,
    statics: Sequence[Topic] = (),
) -> PoseStream:
    """All messages of topics whose schema is in `POSES`.

    Args:
        topics: one under None, or by the name of the body that each holds.
        bodies: names of the poses in a message that names none.
        frame: where poses are in several frames, the one in which they are wanted, and only those below it count. By
            default the nearest that holds all; where nothing connects them, poses stay in their own frames.
        statics: topics of transforms that hold all the time; they connect frames, and are no bodies.

    Raises:
        ValueError: the messages cannot be read at all, or frames are no tree, or `frame` is none of them.
    """
    unnamed, twice, read, header_frames = None, None, [], {}
    notes: list[str] = []
    reasons: list[str] = []
    for name, topic in topics.items():
        topic, some = readable_topic(topic)
        notes += some
        header_frames[topic.name] = frames = {}
        batches = list(_read_poses(topic, frames, reasons))
        declared = bodies if name is None else [name]
        if declared is None and any(poses.names is None for _, poses in batches):
            unnamed = max(poses.positions.shape[-2] for _, poses in batches)
            declared = [str(number + 1) for number in range(unnamed)]
        twice = next((repeated for _, poses in batches if (repeated := _repeated(poses.names))), twice)
        read.append((topic, [part for batch in batches for part in _batches(*batch, topic, declared)]))
    parents = {frame: None for _, batches in read for batch in batches for frame in batch.parents or ()}
    readable = sum(len(batch.rows) for _, batches in read for batch in batches)
    own_times = any(batch.time.ndim == 2 for _, batches in read for batch in batches)
    if not own_times and len(read) == 1:
        stream = _by_message(*read[0])
    else:
        samples = _samples(read)
        if parents and list(parents) != [frame or next(iter(parents))]:
            readable_statics = [readable_topic(topic)[0] for topic in statics]
            fixed = [
                (t, [part for batch in _read_poses(t) for part in _batches(*batch, t, ())]) for t in readable_statics
            ]
            samples, parents = in_one_frame(samples, _samples(fixed), list(parents), frame)
        stream = _gather(samples)
    stream.undecodable = sum(len(topic.messages) for topic in topics.values()) - readable
    stream.misfit = reasons[0] if reasons else ""
    stream.unnamed, stream.parents, stream.twice, stream.notes = unnamed, tuple(parents), twice, notes
    stream.header_frames = {name: tuple(frames) for name, frames in header_frames.items() if frames}
    return without_repeats(stream)


def _repeated(names: list[str] | np.ndarray | None) -> str | None:
    """A name that a message, or one of a batch (..., S), has more than once."""
    for some in [] if names is None else np.atleast_2d(names).tolist():
        if len(set(some)) < len(some):
            return max(some, key=some.count)
    return None


def _read_poses(
    topic: Topic, frames: dict[str, None] | None = None, reasons: list[str] | None = None
) -> Iterator[tuple[np.ndarray, DecodedPoses]]:
    """Batches, or single messages, as `decode` gives them; the frames that their headers name are added to `frames`,
    and to `reasons` why a message does not fit."""
    reader = POSES[short_name(topic.schema)]
    for rows, message in decode(topic):
        try:
            poses = reader(message)
            names = poses.names
            named = names if names is None or isinstance(names, np.ndarray) else [str(name) for name in names]
        except READING as error:
            if reasons is not None:
                reasons.append(misfit(error))
            continue
        if frames is not None and poses.parents is None and (frame := _header_frame(message)):
            frames[frame] = None
        yield rows, poses._replace(names=named)


def _header_frame(message) -> str:
    """The frame that the header of a message names, or the message itself as Foxglove's do; empty where none does."""
    return str(getattr(getattr(message, "header", message), "frame_id", "")).strip("/")


def _batches(rows: np.ndarray, poses: DecodedPoses, topic: Topic, declared: Sequence[str] | None) -> Iterator[Batch]:
    """What a reader returned as batches, one a set of names; none if they do not fit."""
    count, size = rows.size, poses.positions.shape[-2]
    time = topic.log_times[rows] if poses.time is None else poses.time
    own_times = poses.parents is not None or np.ndim(time) > rows.ndim
    time = np.broadcast_to(time, (count, size) if own_times else (count,))
    positions = np.broadcast_to(poses.positions, (count, size, 3))
    orientations = None if poses.orientations is None else np.broadcast_to(poses.orientations, (count, size, 4))
    frame = None if poses.frame is None else np.broadcast_to(poses.frame, (count,))
    rows, names = np.atleast_1d(rows), poses.names if poses.names is not None else declared
    if isinstance(names, np.ndarray):
        sets, which = np.unique(names.reshape(count, size), axis=0, return_inverse=True)
        parts = [(list(map(str, some)), np.flatnonzero(which.ravel() == i)) for i, some in enumerate(sets)]
    else:
        parts = [(list(names or ()), slice(None))]
    for some, part in parts:
        if len(some) == size == len(set(some)):
            yield Batch(
                rows[part], time[part], some, positions[part],
                None if orientations is None else orientations[part],
                None if frame is None else frame[part], poses.parents,
            )  # fmt: skip


def _by_message(topic: Topic, batches: list[Batch]) -> PoseStream:
    """A frame a message."""
    names, count = union([(batch.rows, batch.names) for batch in batches]), len(topic.messages)
    positions = np.full((count, len(names), 3), np.nan)
    quaternions = np.full((count, len(names), 4), np.nan)
    present, readable = np.zeros((count, len(names)), bool), np.zeros(count, bool)
    stamps, frames = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for batch in batches:
        columns = np.ix_(batch.rows, np.array([names.index(name) for name in batch.names], int))
        stamps[batch.rows], readable[batch.rows] = batch.time, True
        present[columns], positions[columns] = True, batch.positions
        if batch.orientations is not None:
            quaternions[columns] = batch.orientations
        if batch.frame is not None:
            frames[batch.rows] = batch.frame
    oriented = any(batch.orientations is not None for batch in batches)
    return PoseStream(
        stamps=stamps[readable],
        log_times=topic.log_times[readable],
        frames=frames[readable] if all(batch.frame is not None for batch in batches) else None,
        names=names,
        present=present[readable],
        positions=positions[readable],
        quaternions=quaternions[readable] if oriented else None,
    )


def _gather(samples: PoseSamples) -> PoseStream:
    """Frames from bodies that have times of their own, in the order in which their first sample was logged, so that a
    clock that runs back shows."""
    names, body = samples.bodies()
    frame, first = samples.frames(body)
    present = np.zeros((len(first), len(names)), bool)
    positions = np.full((*present.shape, 3), np.nan)
    quaternions = np.full((*present.shape, 4), np.nan) if np.isfinite(samples.quaternions).any() else None
    present[frame, body], positions[frame, body] = True, samples.positions
    if quaternions is not None:
        quaternions[frame, body] = samples.quaternions
    return PoseStream(
        stamps=samples.stamps[first],
        log_times=samples.logged[first],
        frames=None,
        names=names,
        present=present,
        positions=positions,
        quaternions=quaternions,
    )


def _samples(read: list[tuple[Topic, list[Batch]]]) -> PoseSamples:
    """What batches hold, body by body."""
    parts = [PoseSamples.none()]
    for topic, batches in read:
        for batch in batches:
            shape = (len(batch.rows), len(batch.names))
            time = batch.time if batch.time.ndim == 2 else batch.time[:, None]
            turned = np.full((*shape, 4), np.nan) if batch.orientations is None else batch.orientations
            parts.append(PoseSamples(
                np.broadcast_to(time, shape).ravel(),
                np.repeat(topic.log_times[batch.rows], shape[1]),
                np.tile(np.array(batch.names, dtype=str), shape[0]),
                np.tile(np.array(batch.parents or [""] * shape[1], dtype=str), shape[0]),
                batch.positions.reshape(-1, 3),
                turned.reshape(-1, 4),
            ))  # fmt: skip
    samples = PoseSamples(*(np.concatenate(values) for values in zip(*parts, strict=True)))
    return samples.take(np.argsort(samples.logged, kind="stable"))


def without_repeats(stream: PoseStream) -> PoseStream:
    """The stream without the frames that only repeat the one before, to the last bit, under new stamps: a driver's loop
    that is faster than its cameras publishes each pose several times.

    Noise makes every frame another, so that of a log that a model made, or that was rounded, nothing is left out, nor
    of a long standstill, in which a driver sees nothing.
    """
    order = np.argsort(stream.stamps if stream.stamps.any() else stream.log_times, kind="stable")
    values = stream.positions[order]
    if stream.quaternions is not None:
        turns = stream.quaternions[order]
        values = np.concatenate([values, np.where(turns[..., :1] < 0, -turns, turns)], axis=2)  # q and -q are one
    equal = values[:-1] == values[1:]
    alike = equal | (np.isnan(values[:-1]) & np.isnan(values[1:]))
    moving = ~alike.all(axis=(0, 2))  # a body that stands for a constant tells nothing
    if not moving.any():
        return stream
    numbers = np.where(np.isnan(values), np.inf, values)[:, moving].reshape(len(order), -1) + 0.0  # no -0
    whole = np.ascontiguousarray(numbers).view(np.dtype((np.void, numbers.itemsize * numbers.shape[1]))).ravel()
    _, first, which, sizes = np.unique(whole, return_index=True, return_inverse=True, return_counts=True)
    last = len(order) - 1 - np.unique(which[::-1], return_index=True)[1]
    near = last - first <= 2 * sizes  # the next pose may come before the last repeat
    usual = sizes <= 2 * int(np.ceil(np.median(sizes))) + 1
    repeats = (near & usual & np.isfinite(numbers[first]).any(axis=1))[which]
    repeats[first] = False
    if not repeats.any() or len(sizes) < FEWEST:
        return stream
    by_chance = np.prod(alike[~repeats[1:]].mean(axis=0)[moving])  # that a frame's rounded numbers stay by themselves
    if CLEAR * by_chance > repeats.mean():
        return stream
    keep = np.ones(len(order), bool)
    keep[order[repeats]] = False
    fresh = stream.take(keep)
    time = np.sort(fresh.stamps if fresh.stamps.any() else fresh.log_times)
    seconds = 1e-9 * (time[-1] - time[0])
    rate = f", poses are new at {(len(time) - 1) / seconds:.4g} Hz" if seconds > 0 else ""
    count = f"{int(repeats.sum())} of {len(order)} frames"
    fresh.notes = [*fresh.notes, f"{count} repeat the one before to the last bit, under new stamps: dropped{rate}"]
    return fresh
