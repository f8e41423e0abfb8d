"""Motive's CSV export as poses.

Header rows are found by what they hold, as versions of Motive differ in their number. Cells end at commas, or at
semicolons where numbers have decimal commas. Quaternions are x, y, z, w; an occluded body has empty cells.
"""

import codecs
import csv
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.logs.messages import UNLABELLED
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.signals.units import METRES_PER

METRES = {unit: METRES_PER[short] for unit, short in
          {"meters": "m", "millimeters": "mm", "centimeters": "cm", "inches": "inch"}.items()}  # fmt: skip
POSITION, ROTATION = ("Position", "XYZ"), ("Rotation", "WXYZ")


class Export(NamedTuple):
    """What a CSV holds. remarks: what is to be said of it, a sentence each."""

    poses: PoseStream
    remarks: list[str]


def read_export(path: Path, unit: str | None = None) -> Export:
    """Read a CSV that Motive exported: positions in m, a stamp for each frame by the clock on UTC, or from 0.

    Unlabelled markers are left out. Where the header promises more frames than there are, those that are whole count.

    Args:
        unit: one of `METRES`, of a CSV whose header names none.

    Raises:
        InputError: naming the file and what is missing, or the row that cannot be read.
    """
    try:
        text = _text(Path(path))
        rows = _rows(text.splitlines())
    except (OSError, csv.Error) as error:
        raise InputError(f"{path}: {error}, expected a CSV export of Motive") from error
    first = next((i for i, row in enumerate(rows) if _begins_frames(row)), None)
    if first is None:
        problem = "found no row that begins with Frame and Time: this is no export of Motive's"
        raise InputError(f"{path}: {problem}, expected its CSV with header")
    about, remarks = dict(zip(rows[0][::2], rows[0][1::2], strict=False)), []
    scale = _scale(path, about, unit)
    columns = _columns(path, rows[:first], rows[first])
    kind = "Rigid Body" if any(key[0] == "Rigid Body" for key in columns) else "Marker"
    every = tuple(dict.fromkeys(key[1] for key in columns if key[0] == kind and key[2] == "Position"))
    names = tuple(name for name in every if kind != "Marker" or not UNLABELLED.fullmatch(name))
    if not names:
        problem = ", ".join(sorted({key[0] for key in columns})) or "nothing"
        problem = "unlabelled markers alone" if every else f"columns of {problem}"
        raise InputError(f"{path}: found {problem}, expected positions of rigid bodies or of markers with labels")
    if len(names) < len(every):
        remarks.append(f"{len(every) - len(names)} unlabelled markers left out")
    total = about.get("Total Exported Frames", "")
    frames = sum(any(map(str.strip, row)) for row in rows[first + 1 :])
    if total.isdigit() and frames < int(total):
        torn = bool(frames) and text[-1] not in "\r\n"  # the last number may lack digits
        rows = rows[:-1] if torn else rows
        lost = ", the last of them cut off and left out" if torn else ""
        expected = f"the header says {total} (Total Exported Frames): is it all there?"
        remarks.append(f"found {frames} frames{lost}, {expected}")
    numbers = _numbers(path, rows, first + 1)
    if not len(numbers):
        raise InputError(f"{path}: found no frame below the header")

    def gather(component: str, axes: str) -> np.ndarray | None:
        wanted = [(kind, name, component, axis) for name in names for axis in axes]
        if not set(wanted) <= set(columns):
            return None
        return numbers[:, [columns[key] for key in wanted]].reshape(len(numbers), len(names), len(axes))

    positions, quaternions = gather(*POSITION), gather(*ROTATION)
    if positions is None:
        raise InputError(f"{path}: a {kind.lower()} lacks one of its columns Position X, Y and Z")
    if quaternions is None and any(key[0] == kind and key[2] == "Rotation" for key in columns):
        raise InputError(f"{path}: rotation type: found {about.get('Rotation Type', 'angles')}, expected Quaternion")
    hidden = ~np.all(np.isfinite(positions), axis=-1)
    if quaternions is not None:
        hidden |= ~np.all(np.isfinite(quaternions), axis=-1)
        quaternions[hidden] = np.nan
    positions[hidden] = np.nan
    stamps = _start(about) + np.round(numbers[:, 1] * 1e9).astype(np.int64)
    poses = PoseStream(
        stamps=stamps,
        log_times=stamps,
        frames=numbers[:, 0].astype(int),
        names=names,
        present=~hidden,
        positions=scale * positions,
        quaternions=quaternions,
    )
    return Export(poses, remarks)


def _begins_frames(row: list[str]) -> bool:
    """Whether it is the row above the numbers; Vicon's has Sub Frame in place of Time."""
    return len(row) > 2 and row[0].strip() == "Frame" and row[1].strip().lower().startswith("time")


def _text(path: Path) -> str:
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError(f"{path}: found text in UTF-16, expected a CSV export of Motive in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = 1 + data.count(b"\n", 0, error.start)
        problem = f"row {row} holds the byte 0x{data[error.start]:02x}, as in Latin-1"
        raise InputError(f"{path}: {problem}, expected a CSV export of Motive in UTF-8") from error


def _rows(lines: list[str]) -> list[list[str]]:
    """Cells row by row, numbers with decimal points."""
    if not lines or lines[0].count(";") <= lines[0].count(","):
        return list(csv.reader(lines))
    return [[cell.replace(",", ".") for cell in row] for row in csv.reader(lines, delimiter=";")]


def _scale(path: Path, about: dict[str, str], declared: str | None) -> float:
    """Metres per unit of the export, which its header names, or else whoever imports it."""
    if about.get("Coordinate Space", "Global") != "Global":
        raise InputError(f"{path}: coordinate space: found {about['Coordinate Space']}, expected Global")
    unit = about.get("Length Units", "").strip().lower() or declared
    if unit is None:
        raise InputError(f"{path}: length units: found none in the header, expected `--unit`: {', '.join(METRES)}")
    if unit not in METRES:
        raise InputError(f"{path}: length units: found {about['Length Units']}, expected one of {', '.join(METRES)}")
    if declared not in (None, unit):
        raise InputError(f"{path}: length units: found {unit} in the header, expected `--unit {unit}`, or none")
    return METRES[unit]


def _columns(path: Path, above: list[list[str]], axes: list[str]) -> dict[tuple[str, str, str, str], int]:
    """(type, name, component, axis) to column; each of the rows above the axes is found by its content."""
    kinds = next((i for i, row in enumerate(above) if {"Rigid Body", "Marker", "Bone"} & set(row[1:])), None)
    components = next((i for i in range(len(above) - 1, -1, -1) if "Position" in above[i]), None)
    if kinds is None or components is None or components <= kinds:
        raise InputError(f"{path}: header: found no rows of types and of Position, expected both above the row Frame")
    between = range(kinds + 1, components)
    names = next((i for i in between if "Name" in above[i][:2]), kinds + 1)
    if names >= components:
        raise InputError(f"{path}: header: found no row of names between those of types and of Position")
    keys = zip(above[kinds], above[names], above[components], axes, strict=False)  # the shortest row ends them
    columns: dict[tuple[str, str, str, str], int] = {}
    for column, key in enumerate(keys):
        kind, name, component, axis = (part.strip() for part in key)
        if column < 2 or not component:
            continue
        if (kind, name, component, axis) in columns and component == "Position" and kind in ("Rigid Body", "Marker"):
            twice = f"found {component} {axis} of the {kind.lower()} {name!r} twice"
            raise InputError(f"{path}: header: {twice}, expected a name of its own for each")
        columns[kind, name, component, axis] = column
    return columns


def _numbers(path: Path, rows: list[list[str]], first: int) -> np.ndarray:
    """(T, columns), NaN for empty cells; rows may end early."""
    width = max((len(row) for row in rows[first - 1 :]), default=0)
    numbers = np.full((len(rows) - first, width), np.nan)
    for index, row in enumerate(rows[first:]):
        try:
            numbers[index, : len(row)] = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError as error:
            raise InputError(f"{path}: row {first + index + 1}: {error}") from error
    filled = np.isfinite(numbers).any(axis=1)
    lacking = np.flatnonzero(filled & ~np.isfinite(numbers[:, :2]).all(axis=1))
    if len(lacking):
        raise InputError(f"{path}: row {first + lacking[0] + 1} lacks its frame number or time")
    return numbers[filled]


def _start(about: dict[str, str]) -> int:
    """The capture's start, ns since the epoch, by a clock on UTC; 0 where it is not said."""
    text = about.get("Capture Start Time", "").replace("P.M.", "PM").replace("A.M.", "AM")
    try:
        moment = datetime.strptime(text, "%Y-%m-%d %I.%M.%S.%f %p").replace(tzinfo=UTC)
    except ValueError:
        return 0
    return round(moment.timestamp() * 1e3) * 1_000_000
