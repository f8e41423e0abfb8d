"""OptiTrack Motive's CSV export as MCAP logs: `python -m trunkline.preparation.motive --session data/raw/NAME CSV…`

Header rows are found by what they hold, as versions of Motive differ in their number. Cells end at commas, or at
semicolons where numbers have decimal commas. Quaternions are x, y, z, w; an occluded body has empty cells; up is +y.
Rigid bodies become `mocap4r2_msgs/msg/RigidBodies`, and where an export has none, its markers become
`mocap4r2_msgs/msg/Markers`. A session.yaml is proposed unless there is one.
"""

import argparse
import csv
import os
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from trunkline.errors import InputError, in_one_line
from trunkline.logs.definitions import MARKERS, RIGID_BODIES
from trunkline.preparation.proposal import propose
from trunkline.preparation.survey import survey

UP = (0, 1, 0)
METRES = {"meters": 1.0, "millimeters": 1e-3, "centimeters": 1e-2}
POSITION, ROTATION = ("Position", "XYZ"), ("Rotation", "WXYZ")


@dataclass
class Export:
    """T frames of B bodies. start: ns since the epoch, or 0. frames: (T,), time: (T,) s from the start.

    positions: (T, B, 3) m, quaternions: (T, B, 4) wxyz or None; NaN where occluded.
    """

    start: int
    frames: np.ndarray
    time: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    quaternions: np.ndarray | None


def read_export(path: Path) -> Export:
    """Read a CSV that Motive exported.

    Raises:
        InputError: naming the file and what is missing, or the row that cannot be read.
    """
    try:
        rows = _rows(Path(path).read_text(encoding="utf-8-sig").splitlines())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: {error}, expected a CSV export of Motive") from error
    first = next((i for i, row in enumerate(rows) if len(row) > 2 and row[0].strip() == "Frame"), None)
    if first is None:
        raise InputError(f"{path}: found no row that begins with Frame, expected a CSV export of Motive with header")
    about = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    scale = _scale(path, about)
    columns = _columns(path, rows[:first], rows[first])
    kind = "Rigid Body" if any(key[0] == "Rigid Body" for key in columns) else "Marker"
    names = tuple(dict.fromkeys(key[1] for key in columns if key[0] == kind and key[2] == "Position"))
    if not names:
        found = ", ".join(sorted({key[0] for key in columns})) or "nothing"
        raise InputError(f"{path}: found columns of {found}, expected positions of rigid bodies or markers")
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
    hidden = ~np.isfinite(positions).all(axis=-1)
    if quaternions is not None:
        hidden |= ~np.isfinite(quaternions).all(axis=-1)
        quaternions[hidden] = np.nan
    positions[hidden] = np.nan
    frames = numbers[:, 0].astype(int)
    return Export(_start(about), frames, numbers[:, 1], names, scale * positions, quaternions)


def _rows(lines: list[str]) -> list[list[str]]:
    """Cells row by row, numbers with decimal points."""
    if not lines or lines[0].count(";") <= lines[0].count(","):
        return list(csv.reader(lines))
    return [[cell.replace(",", ".") for cell in row] for row in csv.reader(lines, delimiter=";")]


def write_log(path: Path, export: Export) -> None:
    """Write an export as an MCAP log, whole or not at all; an occluded body is missing from its frame's message."""
    oriented = export.quaternions is not None
    part = path.with_name(f".{path.name}.part")
    with open(part, "wb") as file, Writer(file) as writer:
        name, text = ("RigidBodies", RIGID_BODIES) if oriented else ("Markers", MARKERS)
        schema = writer.register_msgdef(f"mocap4r2_msgs/msg/{name}", text)
        stamps = export.start + np.round(export.time * 1e9).astype(np.int64)
        for index, stamp in enumerate(stamps.tolist()):
            seconds, nanoseconds = divmod(stamp, 1_000_000_000)
            bodies = [
                _body(export, index, body)
                for body in np.flatnonzero(np.isfinite(export.positions[index, :, 0]))
            ]
            message = {
                "header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "mocap"},
                "frame_number": int(export.frames[index]),
                "rigidbodies" if oriented else "markers": bodies,
            }
            writer.write_message("/rigid_bodies" if oriented else "/markers", schema, message, stamp, stamp)
    os.replace(part, path)


def _body(export: Export, frame: int, body: int) -> dict:
    position = dict(zip("xyz", export.positions[frame, body].tolist(), strict=True))
    if export.quaternions is None:
        return {"id_type": 0, "marker_index": body, "marker_name": export.names[body], "translation": position}
    orientation = dict(zip("wxyz", export.quaternions[frame, body].tolist(), strict=True))
    return {"rigid_body_name": export.names[body], "pose": {"position": position, "orientation": orientation}}


def _scale(path: Path, about: dict[str, str]) -> float:
    """Metres per unit of the export."""
    if about.get("Coordinate Space", "Global") != "Global":
        raise InputError(f"{path}: coordinate space: found {about['Coordinate Space']}, expected Global")
    unit = about.get("Length Units", "")
    if unit.lower() not in METRES:
        raise InputError(f"{path}: length units: found {unit or 'none'}, expected one of {', '.join(METRES)}")
    return METRES[unit.lower()]


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
    rows = [above[kinds], above[names], above[components], axes]
    width = min(map(len, rows))
    return {tuple(row[i].strip() for row in rows): i for i in range(2, width) if rows[2][i].strip()}


def _numbers(path: Path, rows: list[list[str]], first: int) -> np.ndarray:
    """(T, columns), NaN for empty cells; rows may end early."""
    width = max((len(row) for row in rows[first - 1 :]), default=0)
    numbers = np.full((len(rows) - first, width), np.nan)
    for index, row in enumerate(rows[first:]):
        try:
            numbers[index, : len(row)] = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError as error:
            raise InputError(f"{path}: row {first + index + 1}: {error}") from error
    numbers = numbers[np.isfinite(numbers).any(axis=1)]
    if not np.isfinite(numbers[:, :2]).all():
        raise InputError(f"{path}: a row lacks its frame number or time")
    return numbers


def _start(about: dict[str, str]) -> int:
    """The capture's start, ns since the epoch, by a clock on UTC; 0 where it is not said."""
    text = about.get("Capture Start Time", "").replace("P.M.", "PM").replace("A.M.", "AM")
    try:
        moment = datetime.strptime(text, "%Y-%m-%d %I.%M.%S.%f %p").replace(tzinfo=UTC)
    except ValueError:
        return 0
    return round(moment.timestamp() * 1e3) * 1_000_000


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m trunkline.preparation.motive",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("exports", nargs="+", type=Path, metavar="CSV")
    parser.add_argument("--session", required=True, type=Path, help="folder that becomes the session")
    chosen = parser.parse_args(arguments)
    chosen.session.mkdir(parents=True, exist_ok=True)
    for path in chosen.exports:
        export, log = read_export(path), chosen.session / f"{path.stem}.mcap"
        write_log(log, export)
        seen = np.isfinite(export.positions[..., 0]).mean()
        print(f"{log}: {len(export.time)} frames of {len(export.names)} bodies, {100 * seen:.1f} % seen")
    target = chosen.session / "session.yaml"
    if not target.exists():
        target.write_text(propose([survey(log) for log in sorted(chosen.session.glob("*.mcap"))], UP))
        print(f"{target}: proposed; check each trial's experiment, level and split")
    return 0


if __name__ == "__main__":
    sys.exit(main())
