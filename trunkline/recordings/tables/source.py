"""A table as what a log gives: poses, commands and measured positions, each with its times."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.recordings.logs.joint_stream import JointStream
from trunkline.recordings.logs.mcap_log import Log
from trunkline.recordings.logs.pose_stream import PoseStream, without_repeats
from trunkline.recordings.session.layout import (
    TO_SECONDS,
    Constant,
    Motors,
    MotorsFile,
    TableLayout,
    TableTime,
    TextForm,
)
from trunkline.recordings.session.session import FixedBase, Session, TrialEntry
from trunkline.recordings.session.source import LogSource, without_unset
from trunkline.recordings.signals.repeats import stale_samples
from trunkline.recordings.signals.units import METRES_PER
from trunkline.recordings.tables.columns import Key, Table, read_table

LATEST = 9e9  # s since 1970; NumPy's times go no further
ROLES = ("commands", "tendon_positions")


@dataclass
class TableReader:
    """Reads each table of a session once, the columns that its trials name alone."""

    folder: Path
    session: Session
    _read: dict[str, Table] = field(default_factory=dict)

    def open(self, trial: TrialEntry) -> LogSource:
        """What a trial's rows hold.

        Raises:
            InputError: with file, line and column, where something is not as declared.
        """
        layout = self.session.layout_of(trial)
        table = self._table(self.folder / trial.file, layout, layout)
        rows = _rows_of(table, layout, trial)
        stamps = _stamps(table, layout.time, rows)
        poses = _poses(table, layout, rows, stamps, self.session)
        if trial.chosen is not None:  # of the motors all rows stay: what went before brought the arm there
            poses = _without_stale(poses).take(_chosen(table, rows, trial))
        beside, times, notes = table, stamps, []
        if layout.motors_file is not None:
            beside = self._table(self.folder / layout.motors_file.file, layout.motors_file, layout)
            if layout.motors_file.time is not None:
                rows = np.arange(len(beside.rows))
                times = _stamps(beside, layout.motors_file.time, rows)
            elif len(beside.rows) != len(table.rows):
                counts = f"{len(beside.rows)} rows of {beside.path.name} and {len(table.rows)} of {trial.file}"
                notes.append(f"{counts} put side by side from the first on")
                rows, times = rows[rows < len(beside.rows)], stamps[rows < len(beside.rows)]
        streams = [_joints(beside, layout, role, rows, times) for role in ROLES]
        if beside is table:
            poses = _without_rows_of_motors(poses, streams, poses.stamps)
        poses = without_repeats(poses)
        poses.notes = notes + poses.notes
        if self.session.clock != "log":
            poses = without_unset(poses)
            streams = [stream and without_unset(stream) for stream in streams]
        log = Log(table.path, {}, list(dict.fromkeys(table.damage + beside.damage)), len(rows))
        topics = tuple(stream.topic for stream in streams if stream is not None)
        return LogSource(log, "columns of positions", poses, streams[0], streams[1], topics, ())

    def _table(self, path: Path, form: TableLayout | MotorsFile, layout: TableLayout) -> Table:
        """A file's columns, read where no trial before has done so."""
        numbers, texts = _wanted(layout, form)
        key = f"{path} {form.model_dump_json(include=set(TextForm.model_fields))} {numbers} {texts}"
        if key not in self._read:
            self._read[key] = read_table(path, form, numbers, texts)
        return self._read[key]


def _wanted(layout: TableLayout, form: TableLayout | MotorsFile) -> tuple[list[Key], list[Key]]:
    """Columns of numbers, and of text, that a file has to have."""
    numbers: list[Key] = []
    if form is layout:
        for body in layout.bodies.values():
            numbers += [*body.position, *(body.quaternion or body.euler or ())]
    if form is (layout.motors_file or layout):
        motors = [*(layout.commands or {}).values(), *(layout.tendon_positions or {}).values()]
        numbers += [column for column in motors if not isinstance(column, Constant)]
    texts: list[Key] = [layout.trial] if form is layout and layout.trial is not None else []
    if (time := form.time) is not None:
        numbers += [] if time.frames is None else [time.frames]
        if time.column is not None:
            (texts if time.unit == "date" else numbers).append(time.column)
    return list(dict.fromkeys(numbers)), texts


def _rows_of(table: Table, layout: TableLayout, trial: TrialEntry) -> np.ndarray:
    """Which rows are the trial's (T,)."""
    if layout.trial is None:
        return np.arange(len(table.rows))
    labels = np.array([_label(text) for text in table.texts[layout.trial]])
    rows = np.flatnonzero(labels == _label(str(trial.label)))
    if not len(rows):
        some = ", ".join(list(dict.fromkeys(labels.tolist()))[:12])
        raise InputError(f"{table.path}: trial {trial.name}: column {layout.trial!r}: found {some}, expected "
                         f"{_label(str(trial.label))!r}, the `label` of the trial")  # fmt: skip
    return rows


def _without_stale(poses: PoseStream) -> PoseStream:
    """Without what only repeats the frame before, which shows in a stretch of frames and not in some of them."""
    stale = stale_samples(poses.positions)
    if not stale.any():
        return poses
    names = ", ".join(poses.names[body] for body in np.flatnonzero(np.any(stale, axis=0)))
    note = f"of the table {stale.sum()} samples that only repeat the one before, to the last bit, dropped ({names})"
    positions = np.where(stale[..., None], np.nan, poses.positions)
    turns = None if poses.quaternions is None else np.where(stale[..., None], np.nan, poses.quaternions)
    present = poses.present & ~stale
    return replace(poses, positions=positions, quaternions=turns, present=present, notes=[*poses.notes, note])


def _chosen(table: Table, rows: np.ndarray, trial: TrialEntry) -> np.ndarray:
    """Which of the `rows` (T,) are those that the trial lists. Shape (T,)."""
    assert trial.chosen is not None, "as asked before"
    if trial.chosen[-1] > len(table.rows):
        raise InputError(f"{table.path}: trial {trial.name}: rows.last: found row {trial.chosen[-1]}, expected one of "
                         f"the {len(table.rows)} below the header")  # fmt: skip
    return np.isin(rows + 1, trial.chosen)


def _label(text: str) -> str:
    """A label that compares: 3 is 3.0."""
    try:
        return f"{float(text):.15g}"
    except ValueError:
        return text


def _stamps(table: Table, time: TableTime, rows: np.ndarray) -> np.ndarray:
    """When each of the rows was taken, ns. Shape (T,)."""
    column = time.frames if time.column is None else time.column
    if column is None:
        seconds = np.arange(len(rows)) / (time.rate or 1.0)
    elif time.unit == "date":
        texts = pd.Series(table.texts[column]).iloc[rows]
        dates = pd.to_datetime(texts, utc=True, format="ISO8601", errors="coerce")
        expected = "expected a date and time such as 2026-03-14 14:15:33.120"
        _refuse(table, column, rows, dates.isna().to_numpy(), expected)
        return dates.dt.tz_localize(None).to_numpy().astype("datetime64[ns]").astype(np.int64) + _ns(time.start)
    else:
        values = table.columns[column][rows]
        _refuse(table, column, rows, ~np.isfinite(values), "expected a time in every row")
        seconds = values * TO_SECONDS[time.unit] if time.unit is not None else values / (time.rate or 1.0)
        too_late = np.abs(seconds + time.start) > LATEST
        _refuse(table, column, rows, too_late, "expected a time before the year 2255: is its `unit` right?")
    return np.round(seconds * 1e9).astype(np.int64) + _ns(time.start)


def _refuse(table: Table, column: Key, rows: np.ndarray, bad: np.ndarray, expected: str) -> None:
    """Raise InputError with the first of the `rows` (T,) that is `bad` (T,), if any is."""
    if bad.any():
        row = int(rows[np.argmax(bad)])
        cell = table.texts[column][row] if column in table.texts else f"{table.columns[column][row]:g}"
        raise InputError(f"{table.place(row, column)}: found {cell!r:.40}, {expected}")


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)


def _poses(table: Table, layout: TableLayout, rows: np.ndarray, stamps: np.ndarray, session: Session) -> PoseStream:
    """The bodies of the rows (T,), in the frame of the cameras."""
    names = tuple(layout.bodies)
    positions = np.stack([_columns(table, body.position, rows) for body in layout.bodies.values()], axis=1)
    oriented = any(body.quaternion or body.euler for body in layout.bodies.values())
    quaternions = np.full((*positions.shape[:2], 4), np.nan)
    nowhere = np.asarray(np.isnan(positions).any(axis=2))
    for value in layout.gaps:
        same = positions == value
        nowhere |= same.all(axis=2) if value == 0 else same.any(axis=2)
    for place, body in enumerate(layout.bodies.values()):
        if body.quaternion is not None:
            turns = _columns(table, body.quaternion, rows)
            quaternions[:, place] = turns[:, [3, 0, 1, 2]] if layout.quaternion == "xyzw" else turns
        elif body.euler is not None and layout.euler is not None:
            angles = _columns(table, body.euler, rows)
            good = np.isfinite(angles).all(axis=1) & ~nowhere[:, place]
            turns = Rotation.from_euler(layout.euler.convention, angles[good], degrees=layout.euler.unit == "deg")
            quaternions[good, place] = wxyz_from_rotation(turns)
    positions[nowhere], quaternions[nowhere] = np.nan, np.nan
    if layout.frame == "base":
        _to_world(positions, quaternions, names, session)
    frames = None if layout.time.frames is None else table.columns[layout.time.frames][rows]
    if layout.time.frames is not None and frames is not None:
        _refuse(table, layout.time.frames, rows, ~np.isfinite(frames), "expected a frame number in every row")
    return PoseStream(
        stamps=stamps,
        log_times=stamps,
        frames=None if frames is None else frames.astype(np.int64),
        names=names,
        present=np.isfinite(positions[..., 0]),
        positions=positions,
        quaternions=quaternions if oriented else None,
    )


def _columns(table: Table, columns: list[Key], rows: np.ndarray) -> np.ndarray:
    """(T, len(columns))."""
    return np.stack([table.columns[column][rows] for column in columns], axis=1)


def _to_world(positions: np.ndarray, quaternions: np.ndarray, names: tuple[str, ...], session: Session) -> None:
    """Turn positions (T, B, 3) and quaternions (T, B, 4) that are relative to the base, but for its own, in place."""
    base = session.base
    if isinstance(base, FixedBase):
        place = np.full((len(positions), 3), base.position) / METRES_PER[session.frame.unit]
        turns = np.full((len(positions), 4), base.quaternion)
    else:
        place, turns = positions[:, names.index(base)].copy(), quaternions[:, names.index(base)].copy()
    good = np.isfinite(place).all(axis=1) & (np.linalg.norm(np.nan_to_num(turns), axis=1) > 0)
    turn = rotation_from_wxyz(turns[good])
    for index, name in enumerate(names):
        if name == base:
            continue
        positions[good, index] = turn.apply(positions[good, index]) + place[good]
        both = good & np.isfinite(quaternions[:, index]).all(axis=1)
        if both.any():
            local = rotation_from_wxyz(quaternions[both, index])
            quaternions[both, index] = wxyz_from_rotation(rotation_from_wxyz(turns[both]) * local)
    positions[~good], quaternions[~good] = np.nan, np.nan


def _joints(
    table: Table, layout: TableLayout, role: str, rows: np.ndarray, stamps: np.ndarray
) -> JointStream | None:
    """The motors of the rows (T,) that say something. Of gaps 0 is none here: it is where a motor may be."""
    motors: Motors | None = getattr(layout, role)
    if motors is None:
        return None
    values = [
        np.full(len(rows), column.value) if isinstance(column, Constant) else table.columns[column][rows]
        for column in motors.values()
    ]
    positions = np.stack(values, axis=1)
    positions[np.isin(positions, [value for value in layout.gaps if value != 0])] = np.nan
    sent = np.isfinite(positions)
    full = sent.any(axis=1)
    columns = [f"{name} ({column.value:g})" if isinstance(column, Constant) else str(column)
               for name, column in motors.items()]  # fmt: skip
    return JointStream(
        topic=f"columns {', '.join(columns)}",
        stamps=stamps[full],
        log_times=stamps[full],
        names=tuple(motors),
        positions=positions[full],
        sent=sent[full],
        undecodable=0,
    )


def _without_rows_of_motors(poses: PoseStream, streams: list[JointStream | None], stamps: np.ndarray) -> PoseStream:
    """Where rows (T,) are either of poses or of motors, as of two writers of one file: those of poses."""
    moved = np.zeros(len(stamps), bool)
    for stream in streams:
        if stream is not None:
            moved |= np.isin(stamps, stream.stamps)
    visible = poses.present.any(axis=1)
    interleaved = np.any(visible & ~moved) and np.any(moved & ~visible)
    return poses.take(visible | ~moved) if interleaved else poses
