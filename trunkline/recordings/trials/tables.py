"""Trials as Parquet tables: a row a trial, and signals in long form, a row a frame and name."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from trunkline.errors import InputError
from trunkline.recordings.trials.recording import LENGTH, TrialRecording

FLAG, COUNT, NUMBER, VECTOR = pa.bool_(), pa.int64(), pa.float64(), pa.list_(pa.float64())
NAME, NAMES = pa.string(), pa.list_(pa.string())
PLANNED = {"experiment": NAME, "split": NAME, "level": NUMBER, "load": NUMBER}


def write_tables(
    folder: Path, trials: Sequence[TrialRecording], columns: dict[str, pa.DataType], counts: dict[str, str],
    poses: list[pa.Table], commands: list[pa.Table],
) -> None:  # fmt: skip
    """Write trials.parquet, poses.parquet and commands.parquet into `folder`; `planned` reads a row of the first back.

    Args:
        columns: of a trial's row beside what was planned, the fields of its class by name.
        counts: further columns, each with the field of whose rows it is the number.
    """
    kinds = PLANNED | columns
    rows = [
        {"trial": trial.name, "session": trial.session, "orientations": trial.quaternions is not None,
         "command_unit": trial.command_unit}
        | {name: getattr(trial, name) for name in ("markers", "tendons", *kinds)}
        | {name: len(getattr(trial, field)) for name, field in counts.items()}
        for trial in trials
    ]
    kinds = {"trial": NAME} | kinds | dict.fromkeys(counts, COUNT)
    kinds |= {"markers": NAMES, "tendons": NAMES, "orientations": FLAG}
    if any(trial.session for trial in trials):  # a single session's are without a column that names it
        kinds["session"] = NAME
    if any(trial.command_unit != LENGTH for trial in trials):  # likewise where all motors draw in lengths
        kinds["command_unit"] = NAME
    pq.write_table(pa.Table.from_pylist(rows, pa.schema(kinds)), Path(folder) / "trials.parquet")
    pq.write_table(pa.concat_tables(poses), Path(folder) / "poses.parquet")
    pq.write_table(pa.concat_tables(commands), Path(folder) / "commands.parquet")


def planned(row: dict, columns: dict[str, pa.DataType]) -> dict[str, Any]:
    """Arguments of a trial's class that its row of trials.parquet holds: what was planned, names, and `columns`."""
    fields = {name: row[name] for name in (*PLANNED, *columns)}
    vectors = {name: np.array(row[name]) for name, kind in columns.items() if kind == VECTOR}
    names = {"markers": tuple(row["markers"]), "tendons": tuple(row["tendons"])}
    further = {"session": row.get("session", ""), "command_unit": row.get("command_unit", LENGTH)}
    return fields | vectors | names | further | {"name": row["trial"]}


def read_tables(folder: Path, stage: str) -> tuple[list[dict], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Rows of trials.parquet, columns of poses.parquet and of commands.parquet, which `stage` writes.

    Raises:
        InputError: one is missing or no such table.
    """
    tables = []
    for name in ("trials", "poses", "commands"):
        path = Path(folder) / f"{name}.parquet"
        expected = f"expected what the {stage} stage writes (run `dvc repro {stage}`)"
        if not path.is_file():
            raise InputError(f"{path}: no such file, {expected}")
        try:
            tables.append(pq.read_table(path))
        except pa.ArrowInvalid as error:
            raise InputError(f"{path}: not readable as Parquet, {expected}") from error
    trials, poses, commands = tables
    return trials.to_pylist(), columns_of(poses), columns_of(commands)


def pose_table(
    trial: str,
    time: np.ndarray,
    markers: tuple[str, ...],
    positions: np.ndarray,
    quaternions: np.ndarray | None,
) -> pa.Table:
    """Rows (trial, time, marker, x, y, z, qw, qx, qy, qz), frame by frame; quaternions NaN if None."""
    if quaternions is None:
        quaternions = np.full((*positions.shape[:2], 4), np.nan)
    columns = {axis: positions[..., i] for i, axis in enumerate("xyz")}
    columns |= {f"q{axis}": quaternions[..., i] for i, axis in enumerate("wxyz")}
    return long_table(trial, time, "marker", markers, columns)


def long_table(
    trial: str, time: np.ndarray, label: str, names: tuple[str, ...], columns: dict[str, np.ndarray]
) -> pa.Table:
    """(T, N) arrays as T·N rows with the columns trial, time, `label` and those of `columns`."""
    frames, count = len(time), len(names)
    keys = pa.DictionaryArray.from_arrays(np.zeros(frames * count, np.int32), pa.array([trial]))
    labels = pa.DictionaryArray.from_arrays(
        np.tile(np.arange(count, dtype=np.int32), frames), pa.array(list(names), pa.string())
    )
    data = {
        "trial": keys.cast(pa.string()),
        "time": np.repeat(time, count),
        label: labels.cast(pa.string()),
    }
    data |= {key: np.asarray(values, dtype=float).ravel() for key, values in columns.items()}
    return pa.table(data)


def columns_of(table: pa.Table) -> dict[str, np.ndarray]:
    """The numeric columns of a table, as numpy arrays."""
    return {
        field.name: table[field.name].to_numpy()
        for field in table.schema
        if pa.types.is_floating(field.type) or pa.types.is_boolean(field.type)
    }


def stack(columns: dict[str, np.ndarray], names: tuple[str, ...], shape: tuple[int, int]) -> np.ndarray:
    """Columns side by side: (*shape, len(names))."""
    return np.stack([columns[name].reshape(shape) for name in names], axis=-1)
