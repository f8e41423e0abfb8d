"""Motive's CSV exports: what is imported is what was exported, in metres, whatever the header looks like."""

import csv

import numpy as np
import pytest

from demo.instruments import measure
from tests.support.sessions import MARKERS, instruments, release_truth
from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.preparation.export import read_export
from trunkline.recordings.preparation.motive import main
from trunkline.recordings.session.session import read_session

BODIES = ("base", *MARKERS)
LIMITS = TrialLimits(duration=0.5, coverage=0.3, disorder=0.1, clock_offset=1.0)


@pytest.fixture(scope="module")
def measured():
    """A release with y up, and gaps."""
    settings = instruments(occlusions_per_s=1.0, dropped_frames=0.0)
    return measure(release_truth(), settings, np.random.default_rng(3))


def write(path, measured, unit="Millimeters", rows=("Name", "ID", "Parent"), rotation="Quaternion", kind="Rigid Body"):
    """An export as Motive writes it, with a column of errors behind each body, and the bodies' own markers too."""
    scale = {"Meters": 1.0, "Millimeters": 1e3}[unit]
    parts = [("Rotation", axis) for axis in "XYZW"] if rotation == "Quaternion" else []
    parts += [("Rotation", axis) for axis in rotation] if rotation not in ("Quaternion", "") else []
    parts += [("Position", axis) for axis in "XYZ"] + [("Mean Marker Error", "")] * (kind == "Rigid Body")
    extra = [("Rigid Body Marker", f"{name}:Marker1", "Position", axis) for name in BODIES for axis in "XYZ"]
    columns = [(kind, name, *part) for name in BODIES for part in parts] + (extra if kind == "Rigid Body" else [])
    about = ["Format Version", "1.23", "Take Name", path.stem, "Capture Frame Rate", "120.000000"]
    about += ["Capture Start Time", "2025-11-20 02.09.45.344 PM", "Rotation Type", rotation, "Length Units", unit]
    with open(path, "w", newline="", encoding="utf-8-sig") as file:
        writer = csv.writer(file)
        writer.writerow([*about, "Coordinate Space", "Global"])
        writer.writerow([])
        writer.writerow(["", "Type", *(c[0] for c in columns)])
        for row in rows:
            writer.writerow(["", row, *(c[1] if row == "Name" else "4F0A" for c in columns)])
        writer.writerow(["", "", *(c[2] for c in columns)])
        writer.writerow(["Frame", "Time (Seconds)", *(c[3] for c in columns)])
        for frame, (position, quaternion) in enumerate(zip(measured.positions, measured.quaternions, strict=True)):
            cells = [frame, f"{frame / 120:.6f}"]
            for _, name, component, axis in columns:
                body = BODIES.index(name.split(":")[0])
                value = {"Position": scale * position[body], "Rotation": quaternion[body, [1, 2, 3, 0]]}
                place = "XYZW".find(axis) if axis else -1
                number = value[component][place] if place >= 0 else 0.1
                cells.append("" if np.isnan(position[body, 0]) else f"{number:.9f}")
            writer.writerow(cells)
    return path


@pytest.mark.parametrize("unit", ["Meters", "Millimeters"])
@pytest.mark.parametrize("rows", [("Name", "ID"), ("Name", "ID", "Parent"), ("ID", "Name")])
def test_an_export_becomes_a_session_that_is_ingested(tmp_path, measured, unit, rows):
    path = write(tmp_path / "release_1.csv", measured, unit, rows)
    assert main(["--session", str(tmp_path / "session"), str(path)]) == 0
    session = read_session(tmp_path / "session")
    assert (session.frame.up, session.frame.unit, session.base, session.clock) == ((0, 1, 0), "m", "base", "frame")
    ((_, raw, findings),) = load_raw_trials(tmp_path / "session", session, LIMITS)
    assert raw.markers == MARKERS
    assert raw.experiment == "release"
    assert findings.repairs == []
    np.testing.assert_allclose(raw.positions, measured.positions[:, 1:], atol=1e-8)
    np.testing.assert_allclose(raw.quaternions, measured.quaternions[:, 1:], atol=1e-8)
    np.testing.assert_allclose(raw.time, np.arange(len(raw.time)) / 120, atol=1e-6)
    assert np.isnan(raw.positions).any()


def test_decimal_commas_between_semicolons(tmp_path, measured):
    path = write(tmp_path / "release_1.csv", measured)
    text = path.read_text(encoding="utf-8-sig")
    (tmp_path / "german.csv").write_text(text.replace(",", ";").replace(".", ","), encoding="utf-8-sig")
    expected, result = read_export(path), read_export(tmp_path / "german.csv")
    assert result.names == expected.names
    np.testing.assert_array_equal(result.positions, expected.positions)
    np.testing.assert_array_equal(result.stamps, expected.stamps)


def test_markers_alone_become_positions_alone(tmp_path, measured):
    path = write(tmp_path / "swing.csv", measured, "Meters", rotation="", kind="Marker")
    assert main(["--session", str(tmp_path / "session"), str(path)]) == 0
    (tmp_path / "session/session.yaml").write_text(
        "frame: {up: [0, 1, 0]}\nbase: {position: [0, 0, 0]}\ntrials:\n"
        "  - {file: swing.mcap, experiment: release, split: identify}\n"
    )
    ((_, raw, _),) = load_raw_trials(tmp_path / "session", read_session(tmp_path / "session"), LIMITS)
    assert raw.quaternions is None
    np.testing.assert_allclose(raw.positions, measured.positions, atol=1e-8)


def test_the_start_of_the_capture_dates_the_log(tmp_path, measured):
    assert read_export(write(tmp_path / "a.csv", measured)).stamps[0] == 1_763_647_785_344_000_000


def spoil(path, old, new):
    text = path.read_text(encoding="utf-8-sig")
    assert old in text
    path.write_text(text.replace(old, new, 7 if old.startswith(",") else 1))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Length Units,Millimeters", "Length Units,Feet", "length units: found Feet, expected one of meters"),
        ("Coordinate Space,Global", "Coordinate Space,Local", "coordinate space: found Local, expected Global"),
        ("Frame,Time", "Bild,Zeit", "found no row that begins with Frame"),
        ("0,0.000000,", "0,0.000000,abc", "row 9: could not convert string to float: 'abc"),
        ("\n4,0.033333,", "\n4,,", "row 13 lacks its frame number or time"),
        ("Take Name", "Total Exported Frames,9999,Take Name", "the header says 9999 (Total Exported Frames)"),
        (f",{MARKERS[1]}", f",{MARKERS[0]}", f"found Position X of the rigid body '{MARKERS[0]}' twice"),
    ],
)
def test_what_is_not_understood_is_one_line_and_writes_nothing(tmp_path, capsys, measured, old, new, message):
    path = write(tmp_path / "a.csv", measured)
    spoil(path, old, new)
    assert main(["--session", str(tmp_path / "session"), str(path)]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list((tmp_path / "session").iterdir())


def test_angles_for_quaternions_are_refused(tmp_path, capsys, measured):
    path = write(tmp_path / "a.csv", measured, rotation="XYZ")
    assert main(["--session", str(tmp_path / "session"), str(path)]) == 1
    assert "rotation type: found XYZ, expected Quaternion" in capsys.readouterr().err


def test_other_encodings_are_named(tmp_path, measured):
    path = write(tmp_path / "a.csv", measured)
    text = path.read_text(encoding="utf-8-sig").replace("Take Name,a", "Take Name,Prüfling")
    for encoding, message in (("utf-16", "found text in UTF-16"), ("latin-1", "row 1 holds the byte 0xfc")):
        path.write_bytes(text.encode(encoding))
        with pytest.raises(InputError, match=message):
            read_export(path)


def test_a_whole_export_says_how_many_frames_it_has(tmp_path, measured):
    path = write(tmp_path / "a.csv", measured)
    count = len(read_export(path).stamps)
    spoil(path, "Take Name", f"Total Exported Frames,{count},Take Name")
    assert len(read_export(path).stamps) == count
