"""Columns of a table by name or number: those that are wanted, read once; of a bad cell its line and column."""

import codecs
import csv
import io
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from trunkline.errors import InputError, nearest
from trunkline.recordings.session.layout import TEXT, TextForm
from trunkline.recordings.tables.arrays import array_columns

BLANK = re.compile(r"\s*(nan|na|n/a|null|none|-|\?)?\s*", re.IGNORECASE)  # cells that say that there is nothing
MARKS = {codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16", codecs.BOM_UTF8: "utf-8-sig"}
BLOCK = 8192  # rows whose cells are text at a time
Key = int | str


@dataclass
class Table:
    """N rows of a file. rows: where each is, from 1: its line of a text, its row of another. Shape (N,).

    columns: numbers by column, NaN where a cell says nothing. Shape (N,). texts: of the columns that were wanted so.
    damage: one sentence for each thing that was lost.
    """

    path: Path
    rows: np.ndarray
    columns: dict[Key, np.ndarray] = field(default_factory=dict)
    texts: dict[Key, list[str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)

    def place(self, row: int, column: Key) -> str:
        """For messages: file, line and column of a cell."""
        word = "line" if self.path.suffix.lower() in TEXT else "row"
        return f"{self.path}: {word} {self.rows[row]}, column {column!r}"


def read_table(path: Path, form: TextForm, numbers: list[Key], texts: list[Key]) -> Table:
    """Read the columns `numbers` and `texts` of a file, and none besides.

    Raises:
        InputError: with file, line and column, where the file, a column's name or a cell is not as declared.
    """
    try:
        if path.suffix.lower() not in TEXT:
            return _of_arrays(path, numbers, texts)
        with opened(path, form.encoding) as file:
            return _of_text(path, form, file, numbers, texts)
    except UnicodeError as error:
        line = _first_line_beyond(path, form.encoding)
        expected = "expected `encoding` in session.yaml to say which: utf-8, utf-16 or latin-1"
        raise InputError(f"{path}: line {line}: found bytes that are not {form.encoding}, {expected}") from error
    except csv.Error as error:
        raise InputError(f"{path}: {error}, expected a table of text") from error
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}, expected a table") from error


def _first_line_beyond(path: Path, encoding: str) -> int:
    """The first line of a file that is not in an encoding. What a decoder says counts from its own last block."""
    data = path.read_bytes()
    try:
        data.decode(encoding)
    except UnicodeDecodeError as error:
        return 1 + data[: error.start].count(b"\n")
    return 1


def opened(path: Path, encoding: str) -> io.TextIOWrapper:
    """A text file; the mark at its begin says more of its encoding than whoever declares it."""
    with open(path, "rb") as file:
        begin = file.read(3)
    marked = next((name for mark, name in MARKS.items() if begin.startswith(mark)), None)
    without = "utf-16-le" if encoding == "utf-16" else encoding
    return open(path, encoding=marked or without, newline="")


def cells_of(file: Iterable[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """(line, cells) of every line, empty ones too."""
    if separator == " ":
        yield from ((number, line.split()) for number, line in enumerate(file, 1))
        return
    reader = csv.reader(file, delimiter=separator, skipinitialspace=True)
    for cells in reader:
        yield reader.line_num, cells


def _of_text(path: Path, form: TextForm, file: io.TextIOWrapper, numbers: list[Key], texts: list[Key]) -> Table:
    lines = cells_of(file, form.separator_of(path))
    above = [cells for _, cells in islice(lines, form.header)]
    names = [name.strip() for name in above[(form.names or form.header) - 1]] if len(above) == form.header > 0 else []
    if names and names[0].startswith("#"):  # as NumPy writes a header
        names = [name for name in (names[0].lstrip("# "), *names[1:]) if name]
    body = ((line, cells) for line, cells in lines if any(cell.strip() for cell in cells))
    first = next(body, None)
    if first is None:
        raise InputError(f"{path}: found no row below {form.header} lines of header, expected `header` and `encoding` "
                         "in session.yaml to be as in the file")  # fmt: skip
    width = max(len(names), len(first[1]))
    places = {key: _place(path, key, names, width, form.names or form.header) for key in dict.fromkeys(numbers + texts)}
    table, rows = Table(path, np.empty(0, int), texts={key: [] for key in texts}), []
    parts: dict[Key, list[np.ndarray]] = {key: [] for key in numbers}
    block = [first]
    while block:
        block += islice(body, BLOCK)
        after = next(body, None)
        for line, cells in block:
            if len(cells) != width and (len(cells) < width or any(map(str.strip, cells[width:]))):
                if after is None and line == block[-1][0] and len(rows) + len(block) > 1 and len(cells) < width:
                    table.damage.append(f"line {line} is cut off, with {len(cells)} of {width} cells: left out")
                    block = block[:-1]
                    break
                raise InputError(f"{path}: line {line}: found {len(cells)} cells, expected {width}, as in the lines "
                                 "before: are `separator`, `decimal` and `header` right?")  # fmt: skip
        for key in numbers:
            parts[key].append(_numbers(path, [(line, cells[places[key]]) for line, cells in block], key, form.decimal))
        for key in texts:
            table.texts[key] += [cells[places[key]].strip() for _, cells in block]
        rows += [line for line, _ in block]
        block = [] if after is None else [after]
    table.rows = np.array(rows)
    table.columns = {key: np.concatenate(some) for key, some in parts.items()}
    return table


def _numbers(path: Path, cells: list[tuple[int, str]], key: Key, decimal: str) -> np.ndarray:
    """(n,) of cells with their lines."""
    texts = [cell.replace(",", ".") for _, cell in cells] if decimal == "," else [cell for _, cell in cells]
    try:
        return np.array(texts, float)
    except ValueError:
        pass
    values = np.full(len(cells), np.nan)
    for row, ((line, cell), text) in enumerate(zip(cells, texts, strict=True)):
        try:
            values[row] = float(text)
        except ValueError:
            if not BLANK.fullmatch(cell):
                comma = ': `decimal: ","`?' if decimal == "." and re.fullmatch(r"\s*-?\d+,\d+\s*", cell) else ""
                expected = f"expected a number{comma}" + (", or `header` that counts this line" if row == 0 else "")
                raise InputError(f"{path}: line {line}, column {key!r}: found {cell!r:.40}, {expected}") from None
    return values


def _of_arrays(path: Path, numbers: list[Key], texts: list[Key]) -> Table:
    """Of a Parquet, npz or mat file."""
    names, read = array_columns(path)
    wanted = {key: names[_place(path, key, names, len(names), 0)] for key in dict.fromkeys(numbers + texts)}
    arrays = read(list(dict.fromkeys(wanted.values())))
    count = max((len(array) for array in arrays.values()), default=0)
    table = Table(path, np.arange(1, count + 1))
    for key, name in wanted.items():
        array = arrays[name]
        if len(array) != count:
            raise InputError(f"{path}: column {key!r}: found {len(array)} rows, expected {count} as in other columns")
        if key in texts:
            cells = array.astype(str) if array.dtype.kind == "M" else array
            table.texts[key] = [str(value) for value in cells.tolist()]
        if key in numbers:
            table.columns[key] = _cast(table, key, array)
    return table


def _cast(table: Table, key: Key, array: np.ndarray) -> np.ndarray:
    """(N,) numbers; times become seconds since 1970, and what passed seconds."""
    if array.dtype.kind in "Mm":
        return seconds_of(array)
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        pass
    values = np.full(len(array), np.nan)
    for row, value in enumerate(array.tolist()):
        try:
            values[row] = np.nan if value is None else float(value)
        except (TypeError, ValueError):
            if not BLANK.fullmatch(str(value)):
                raise InputError(f"{table.place(row, key)}: found {value!r:.40}, expected a number") from None
    return values


def seconds_of(array: np.ndarray) -> np.ndarray:
    """Dates as s since 1970, durations as s; NaN where there is none. Shape (N,)."""
    kind = "datetime64[ns]" if array.dtype.kind == "M" else "timedelta64[ns]"
    return np.where(np.isnat(array), np.nan, array.astype(kind).astype(np.int64) * 1e-9)


def _place(path: Path, key: Key, names: list[str], width: int, line: int) -> int:
    """Where a column is, from 0."""
    where = f"{path}: line {line}" if line else f"{path}"
    if isinstance(key, int):
        if key > width:
            raise InputError(f"{where}: found {width} columns, expected column {key} of session.yaml")
        return key - 1
    if names.count(key) != 1:
        some = ", ".join(name[:40] for name in names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
        if not names:
            problem = "found no names of columns, as `header: 0`"
            raise InputError(f"{path}: {problem}, expected numbers from 1 in place of {key!r} in session.yaml")
        problem = f"column {key!r} {names.count(key)} times" if key in names else f"the columns {some}"
        expected = "its number from 1 in session.yaml" if key in names else f"{key!r} of session.yaml"
        if len(names) == 1:
            expected += ": is `separator` right?"
        raise InputError(f"{where}: found {problem}, expected {expected}{nearest(key, names)}")
    return names.index(key)
