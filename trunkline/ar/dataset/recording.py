"""The log of a live session as channels on one clock, that of its stamps, and as steps of what was wanted."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trunkline.ar.session.log_format import INPUT, JOINTS, JOINTS_SENT, TENDONS, TENDONS_SENT
from trunkline.ar.session.log_reader import LogReader, read_session_log, tip_path
from trunkline.ar.teleop.messages import Input, Intent, from_json
from trunkline.errors import InputError
from trunkline.recordings.logs.joint_stream import joint_stream
from trunkline.recordings.logs.mcap_log import Log, read_log


class AxisSeries(NamedTuple):
    """times: ns, in order. Shape (T,). values: (T, C), of the C `names`."""

    times: np.ndarray
    values: np.ndarray
    names: tuple[str, ...]

    def at(self, times: np.ndarray) -> np.ndarray:
        """The last values that were told by then; NaN before the first. Shape (n, C)."""
        rows = np.searchsorted(self.times, times, side="right") - 1
        return np.where(rows[:, None] < 0, np.nan, self.values[np.maximum(rows, 0)])


class RecordedStep(NamedTuple):
    """Of the core of teleoperation: what it was given at `time`, ns, and wanted."""

    time: int
    message: Input
    intent: Intent


@dataclass(frozen=True)
class SessionRecording:
    """sent: the robot's axes as commanded, the rigid joints', rad, and pulls of cables, m. measured: the same as
    measured; an axis that nobody measures is as it was sent, its name ends in `.sent`. tip: where the arm's tip was in
    the rigid base, m; of a real machine where its twin had it, as nobody sees the arm: its names end in `.twin`."""

    path: Path
    logbook: LogReader
    steps: list[RecordedStep]
    sent: AxisSeries
    measured: AxisSeries
    tip: AxisSeries


def read_recording(path: Path) -> SessionRecording:
    """
    Raises:
        InputError: it is no log of a live session, or of none in which a robot was seen.
    """
    logbook, log = read_session_log(path), read_log(path)
    zero = int(log.topics[INPUT].log_times[0])  # of the steps' times
    steps = [
        RecordedStep(zero + round(1e9 * step.time), from_json(Input, step.input), from_json(Intent, step.intent))
        for step in logbook.steps
    ]
    sent = [_axes(path, log, topic) for topic in (JOINTS_SENT, TENDONS_SENT)]
    measured = [
        _named(_axes(path, log, topic), ".pos") if topic in log.topics else _named(instead, ".sent")
        for topic, instead in zip((JOINTS, TENDONS), sent, strict=True)
    ]
    return SessionRecording(
        path,
        logbook,
        steps,
        _joined([_named(channel, ".pos") for channel in sent]),
        _joined(measured),
        _tip(path, logbook),
    )


def _axes(path: Path, log: Log, topic: str) -> AxisSeries:
    if topic not in log.topics:
        raise InputError(f"{path}: {topic}: found no such topic, expected the log of a session with a robot")
    stream = joint_stream(log.topics[topic])
    order = np.argsort(stream.stamps, kind="stable")
    return AxisSeries(stream.stamps[order], stream.positions[order], stream.names)


def _named(axes: AxisSeries, ending: str) -> AxisSeries:
    return axes._replace(names=tuple(f"{name}{ending}" for name in axes.names))


def _joined(parts: list[AxisSeries]) -> AxisSeries:
    """One channel of all, at all their times."""
    times = np.unique(np.concatenate([part.times for part in parts]))
    values = np.concatenate([part.at(times) for part in parts], axis=1)
    return AxisSeries(times, values, tuple(name for part in parts for name in part.names))


def _tip(path: Path, logbook: LogReader) -> AxisSeries:
    tip, poses, ending = logbook.begin["tip"], logbook.drawn, "" if logbook.twin is None else ".twin"
    if poses is None or poses.quaternions is None or tip["body"] not in poses.names:
        raise InputError(f"{path}: /tf: found no body {tip['body']!r}, which has the tip, expected its poses")
    row = poses.names.index(tip["body"])
    there = poses.present[:, row]
    path_of = np.concatenate([poses.positions[there, row], poses.quaternions[there, row]], axis=1)
    names = tuple(f"tip.{axis}{ending}" for axis in "xyz")
    return AxisSeries(poses.stamps[there], tip_path(path_of, tip["place"]), names)
