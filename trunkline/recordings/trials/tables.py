"""Signals as Parquet tables in long form: a row a frame and name."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from trunkline.errors import InputError


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


def with_sessions(schema: pa.Schema, sessions: list[str]) -> pa.Schema:
    """The schema of trials.parquet, of which a single session's, "", is without a column that names it."""
    return schema.append(pa.field("session", pa.string())) if any(sessions) else schema


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
