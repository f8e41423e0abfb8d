"""A raw trial: one trial as recorded, checked but not filtered, in the motion-capture frame, on its own clocks."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from trunkline.recordings.trials.recording import TrialRecording
from trunkline.recordings.trials.tables import (
    COUNT,
    NUMBER,
    VECTOR,
    long_table,
    planned,
    pose_table,
    read_tables,
    stack,
    write_tables,
)

BASE = "base"  # the base body's name in poses.parquet


@dataclass(kw_only=True)
class RawTrial(TrialRecording):
    """T frames, S markers, K tendons; the motors have Tc commands and Tm measured positions.

    name, experiment, split, level, load: as planned, see `PlannedTrial`. markers: S names, tendons: K names, as in the
    model.
    up: (3,) unit vector against gravity, 0 where there is none. time: (T,) s from the first frame.
    positions (T, S, 3) m, quaternions (T, S, 4) wxyz or None, base_positions (T, 3), base_quaternions (T, 4):
    in the motion-capture frame, NaN where there is no good sample.
    command_time (Tc,), tendon_time (Tm,): s on the motors' clock, which reads time - clock_offset.
    commands (Tc, K), tendon_positions (Tm, K): m of pull.
    repairs: how many `ingest` made in it.
    """

    up: np.ndarray
    base_positions: np.ndarray
    base_quaternions: np.ndarray
    command_time: np.ndarray
    tendon_time: np.ndarray
    clock_offset: float = 0.0
    repairs: int = 0


COLUMNS = {"up": VECTOR, "clock_offset": NUMBER, "repairs": COUNT}
COUNTS = {"frames": "time", "commands": "command_time", "tendon_positions": "tendon_time"}


def write_raw_trials(folder: Path, raw_trials: list[RawTrial]) -> None:
    """Write trials.parquet (a row a trial), poses.parquet (a row a frame and body, the base first) and
    commands.parquet (a row a tendon and time; `stream` is "command" or "position")."""
    poses, commands = [], []
    for raw in raw_trials:
        quaternions = raw.quaternions
        if quaternions is None:
            quaternions = np.full((*raw.positions.shape[:2], 4), np.nan)
        positions = np.concatenate([raw.base_positions[:, None], raw.positions], axis=1)
        quaternions = np.concatenate([raw.base_quaternions[:, None], quaternions], axis=1)
        poses.append(pose_table(raw.name, raw.time, (BASE, *raw.markers), positions, quaternions))
        for stream, time, values in (
            ("command", raw.command_time, raw.commands),
            ("position", raw.tendon_time, raw.tendon_positions),
        ):
            table = long_table(raw.name, time, "tendon", raw.tendons, {"pull": values})
            commands.append(table.append_column("stream", pa.array([stream] * len(table), pa.string())))
    write_tables(folder, raw_trials, COLUMNS, COUNTS, poses, commands)


def read_raw_trials(folder: Path, splits: tuple[str, ...]) -> list[RawTrial]:
    """The raw trials of `splits` that `write_raw_trials` wrote into `folder`, in the same order.

    Raises:
        InputError: as `read_tables`.
    """
    rows, poses, pulls = read_tables(folder, "ingest")
    raw_trials, pose_row, pull_row = [], 0, 0
    for row in rows:
        shape = (row["frames"], 1 + len(row["markers"]))
        pose = {key: column[pose_row : pose_row + shape[0] * shape[1]] for key, column in poses.items()}
        pose_row += shape[0] * shape[1]
        motors = {}
        for stream, count in (("command", row["commands"]), ("tendon", row["tendon_positions"])):
            size = (count, len(row["tendons"]))
            span = slice(pull_row, pull_row + size[0] * size[1])
            time = pulls["time"][span].reshape(size)[:, 0] if size[1] else np.empty(0)
            motors[stream] = time, pulls["pull"][span].reshape(size)
            pull_row = span.stop
        positions = stack(pose, ("x", "y", "z"), shape)
        quaternions = stack(pose, ("qw", "qx", "qy", "qz"), shape)
        raw_trials.append(
            RawTrial(
                **planned(row, COLUMNS),
                time=pose["time"].reshape(shape)[:, 0].copy(),
                positions=positions[:, 1:],
                quaternions=quaternions[:, 1:] if row["orientations"] else None,
                base_positions=positions[:, 0],
                base_quaternions=quaternions[:, 0],
                command_time=motors["command"][0],
                commands=motors["command"][1],
                tendon_time=motors["tendon"][0],
                tendon_positions=motors["tendon"][1],
            )
        )
    return [raw for raw in raw_trials if raw.split in splits]
