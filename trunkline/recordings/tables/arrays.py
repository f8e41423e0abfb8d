"""Parquet, npz and mat files as columns: a vector is one, an array of more dimensions one for each of its places."""

import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from trunkline.errors import InputError

FEWEST = 10  # rows, where anything has as many: matrices of calibration are smaller
HDF5 = b"MATLAB 7.3"  # how the files of `save -v7.3` begin
Columns = dict[str, np.ndarray]


def array_columns(path: Path) -> tuple[list[str], Callable[[list[str]], Columns]]:
    """Names of the columns, and what reads some of them, (N,) each: `force`, `pose[1]` … `pose[7]`, `act[2,3]`,
    `run.time` of a structure; numbers from 1.

    Raises:
        InputError: the file cannot be read.
    """
    if path.suffix.lower() == ".parquet":
        return _of_parquet(path)
    arrays = _load(path)
    lengths = Counter(length for array in arrays.values() for length in set(array.shape))
    rows = max(lengths, key=lambda length: (length >= FEWEST, lengths[length], length), default=0)  # the larger of two
    places: dict[str, tuple[str, tuple[int, ...]]] = {}
    for key, array in arrays.items():
        if rows in array.shape:
            arrays[key] = np.moveaxis(array, array.shape.index(rows), 0)
            places |= _with_places(key, arrays[key].shape[1:])
    if not places:
        raise InputError(f"{path}: found no arrays of numbers, expected some: of structures in an array, such as "
                         "trials(2).time of MATLAB, each needs a file of its own")  # fmt: skip

    def read(names: list[str]) -> Columns:
        return {name: arrays[places[name][0]][(slice(None), *places[name][1])] for name in names}

    return list(places), read


def _of_parquet(path: Path) -> tuple[list[str], Callable[[list[str]], Columns]]:
    try:
        schema = pq.read_schema(path)
    except pa.ArrowInvalid as error:
        raise InputError(f"{path}: {error}, expected a Parquet file") from error
    places: dict[str, tuple[str, tuple[int, ...]]] = {}
    for column in schema:
        lists = pa.types.is_fixed_size_list(column.type)
        places |= _with_places(column.name, (column.type.list_size,) if lists else ())

    def read(names: list[str]) -> Columns:
        table = pq.read_table(path, columns=list(dict.fromkeys(places[name][0] for name in names)))
        columns = {}
        for name in names:
            key, place = places[name]
            cells = table[key].to_numpy()
            columns[name] = np.array([np.nan if cell is None else cell[place[0]] for cell in cells]) if place else cells
        return columns

    return list(places), read


def _with_places(name: str, shape: tuple[int, ...]) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Names of an array's columns, and where each is in it."""
    if not shape:
        return {name: (name, ())}
    return {f"{name}[{','.join(str(i + 1) for i in place)}]": (name, place) for place in np.ndindex(shape)}


def _load(path: Path) -> Columns:
    """Arrays by name, without axes of length 1."""
    try:
        if path.suffix.lower() == ".npz":
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: array for name in file.files if (array := _unpickled(file, name)) is not None}
                if file.files and not arrays:
                    raise ValueError(
                        f"Object arrays ({', '.join(file.files)}) cannot be loaded with allow_pickle=False"
                    )
        else:
            with open(path, "rb") as file:
                if file.read(len(HDF5)) == HDF5:
                    raise InputError(f"{path}: found MATLAB 7.3 (HDF5), expected version 5: save(…, '-v7')")
            loaded = loadmat(path, simplify_cells=True)
            arrays = _flat({name: value for name, value in loaded.items() if not name.startswith("__")})
    except (ValueError, zipfile.BadZipFile, EOFError, MatReadError, NotImplementedError, TypeError) as error:
        raise InputError(f"{path}: {error}, expected an {path.suffix[1:]} file of arrays of numbers") from error
    return {name: np.squeeze(array) for name, array in arrays.items() if array.size > 1}


def _unpickled(file: np.lib.npyio.NpzFile, name: str) -> np.ndarray | None:
    """An array, but for one of Python's objects: those are not run, and may lie beside what is read."""
    try:
        return file[name]
    except ValueError as error:
        if "Object arrays" not in str(error):
            raise
        return None


def _flat(values: dict, before: str = "") -> Columns:
    """Arrays of structures in structures by `outer.inner`."""
    arrays = {}
    for name, value in values.items():
        if isinstance(value, dict):
            arrays |= _flat(value, f"{before}{name}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biufUSM":
            arrays[before + name] = value
    return arrays
