"""Episodes as a dataset in LeRobot's format, version 3.0, which lerobot 0.4 to 0.6 read.

    meta/info.json  meta/stats.json  meta/tasks.parquet  meta/episodes/chunk-000/file-000.parquet
    data/chunk-000/file-000.parquet

The format is that of https://huggingface.co/docs/lerobot/lerobot-dataset-v3; what lerobot's own writer leaves was
compared with.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from trunkline.ar.dataset.episodes import Episode

VERSION = "v3.0"
INDICES = ("frame_index", "episode_index", "index", "task_index")
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
FILE = "chunk-000/file-000.parquet"
CHUNK, MOST_MB = 1000, 100  # files a chunk, and MB a file: what a writer that adds to the dataset keeps to


def write_dataset(folder: Path, episodes: Sequence[Episode], fps: int, robot: str) -> None:
    """All episodes into the empty `folder`; they have the same features."""
    tasks = list(dict.fromkeys(episode.task for episode in episodes))
    frames, rows, first = [], [], 0
    for number, episode in enumerate(episodes):
        columns = _frames(episode, number, first, tasks.index(episode.task), fps)
        frames.append(columns)
        row = {"episode_index": number, "tasks": [episode.task], "length": len(columns["index"]),
               "data/chunk_index": 0, "data/file_index": 0, "dataset_from_index": first,
               "dataset_to_index": first + len(columns["index"])}  # fmt: skip
        row |= {f"stats/{name}/{key}": value for name, v in columns.items() for key, value in _stats(v).items()}
        rows.append(row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})
        first += len(columns["index"])
    whole = {name: np.concatenate([columns[name] for columns in frames]) for name in frames[0]}
    for place in ("meta/episodes/chunk-000", "data/chunk-000"):
        (folder / place).mkdir(parents=True)
    pq.write_table(pa.table({name: _column(values) for name, values in whole.items()}), folder / "data" / FILE)
    pq.write_table(pa.Table.from_pylist(rows), folder / "meta/episodes" / FILE)
    pd.DataFrame({"task_index": range(len(tasks))}, index=tasks).to_parquet(folder / "meta/tasks.parquet")
    _write_json(folder / "meta/stats.json", {name: _stats(values) for name, values in whole.items()})
    info = {
        "codebase_version": VERSION, "robot_type": robot, "total_episodes": len(episodes), "total_frames": first,
        "total_tasks": len(tasks), "chunks_size": CHUNK, "data_files_size_in_mb": MOST_MB,
        "video_files_size_in_mb": MOST_MB, "fps": fps, "splits": {"train": f"0:{len(episodes)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "video_path": None,
        "features": {name: _feature(values, episodes[0].names.get(name)) for name, values in whole.items()},
    }  # fmt: skip
    _write_json(folder / "meta/info.json", info)


def _frames(episode: Episode, number: int, first: int, task: int, fps: int) -> dict[str, np.ndarray]:
    """Columns of an episode's rows."""
    count = len(next(iter(episode.frames.values())))
    columns = {n: v if v.dtype == bool else v.astype(np.float32) for n, v in episode.frames.items()}
    rows = np.arange(count)
    indices = (rows, np.full(count, number), first + rows, np.full(count, task))
    return columns | {"timestamp": (rows / fps).astype(np.float32)} | dict(zip(INDICES, indices, strict=True))


def _feature(values: np.ndarray, names: tuple[str, ...] | None) -> dict:
    shape = [1] if values.ndim == 1 else [values.shape[1]]
    return {"dtype": values.dtype.name, "shape": shape, "names": None if names is None else list(names)}


def _column(values: np.ndarray) -> pa.Array:
    if values.ndim == 1:
        return pa.array(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def _stats(values: np.ndarray) -> dict[str, list]:
    """Of each number of a feature over its rows."""
    table = values.reshape(len(values), -1)
    wide = table.astype(float)
    stats = {"min": table.min(axis=0), "max": table.max(axis=0), "mean": wide.mean(axis=0), "std": wide.std(axis=0),
             "count": np.array([len(table)])}  # fmt: skip
    stats |= {name: np.quantile(wide, share, axis=0) for name, share in QUANTILES.items()}
    return {name: value.tolist() for name, value in stats.items()}


def _write_json(path: Path, table: dict) -> None:
    path.write_text(json.dumps(table, indent=4) + "\n", encoding="utf-8")
