"""Motive's CSV exports: what is imported is what was exported, in metres, whatever the header looks like."""

import csv

import numpy as np
import pytest

from demo.instruments import measure
from tests.support.sessions import LIMITS, MARKERS, instruments, release_truth
from trunkline.errors import InputError
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.preparation.export import read_export
from trunkline.recordings.preparation.motive import main
from trunkline.recordings.session.session import read_session

BODIES = ("base", *MARKERS)


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
    expected, result = read_export(path).poses, read_export(tmp_path / "german.csv").poses
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
    assert read_export(write(tmp_path / "a.csv", measured)).poses.stamps[0] == 1_763_647_785_344_000_000


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


def test_a_header_that_promises_more_frames_is_a_warning(tmp_path, measured, capsys):
    """Whole rows count; one that the end of the file tears does not."""
    path = write(tmp_path / "a.csv", measured)
    count = len(read_export(path).poses.stamps)
    spoil(path, "Take Name", f"Total Exported Frames,{count},Take Name")
    assert read_export(path).remarks == []
    spoil(path, f"Total Exported Frames,{count}", "Total Exported Frames,30100")
    assert len(read_export(path).poses.stamps) == count
    assert main(["--session", str(tmp_path / "session"), str(path)]) == 0
    assert f"a.csv: found {count} frames, the header says 30100 (Total Exported" in capsys.readouterr().err
    path.write_text(path.read_text()[:-3])
    torn = read_export(path)
    assert len(torn.poses.stamps) == count - 1
    assert "the last of them cut off and left out" in torn.remarks[0]


def test_a_unit_that_the_header_lacks_is_an_option(tmp_path, measured, capsys):
    path = write(tmp_path / "a.csv", measured)
    expected = read_export(path).poses.positions
    spoil(path, "Length Units,Millimeters", "")
    assert main(["--session", str(tmp_path / "session"), str(path)]) == 1
    assert "length units: found none in the header, expected `--unit`: meters" in capsys.readouterr().err
    assert main(["--session", str(tmp_path / "session"), "--unit", "millimeters", str(path)]) == 0
    np.testing.assert_array_equal(read_export(path, "millimeters").poses.positions, expected)


def test_a_unit_that_the_header_contradicts_is_refused(tmp_path, measured):
    with pytest.raises(InputError, match="found millimeters in the header, expected `--unit millimeters`, or none"):
        read_export(write(tmp_path / "a.csv", measured), "meters")


def test_vicon_exports_are_said_to_be_none(tmp_path):
    path = tmp_path / "trial.csv"
    path.write_text("Trajectories\n50\n,,arm:base,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1.0,2.0,3.0\n")
    with pytest.raises(InputError, match="begins with Frame and Time: this is no export of Motive's, expected its CSV"):
        read_export(path)


@pytest.mark.parametrize("name", ["Unlabeled 1000", "Unlabeled:1037", "Unlabelled_3", "arm:Unlabeled 7", "unlabeled"])
def test_unlabelled_markers_are_left_out(tmp_path, measured, name):
    path = write(tmp_path / "a.csv", measured, "Meters", rotation="", kind="Marker")
    expected = [body for body in BODIES if body != MARKERS[-1]]
    path.write_text(path.read_text(encoding="utf-8-sig").replace(f",{MARKERS[-1]}", f",{name}"), encoding="utf-8-sig")
    poses, remarks = read_export(path)
    assert list(poses.names) == expected
    assert remarks == ["1 unlabelled markers left out"]


def test_takes_of_one_name_are_refused_before_anything_is_written(tmp_path, measured, capsys):
    takes = [tmp_path / day / "Take_001.csv" for day in ("monday", "friday")]
    for take in takes:
        take.parent.mkdir()
        write(take, measured)
    session = tmp_path / "session"
    assert main(["--session", str(session), *map(str, takes)]) == 1
    assert f"{takes[1]}: found {takes[0]} of the same name, and both would become" in capsys.readouterr().err
    assert not list(session.iterdir())
    assert main(["--session", str(session), str(takes[0])]) == 0
    assert main(["--session", str(session), str(takes[0])]) == 0, "the same take again is the same log"
    spoil(takes[1], "\n4,0.033333,", "\n4,0.033334,")
    log = (session / "Take_001.mcap").read_bytes()
    assert main(["--session", str(session), str(takes[1])]) == 1
    assert "Take_001.mcap there already, of another take" in capsys.readouterr().err
    assert (session / "Take_001.mcap").read_bytes() == log


def test_takes_that_come_later_are_said_to_be_in_no_trial(tmp_path, measured, capsys):
    session = tmp_path / "session"
    assert main(["--session", str(session), str(write(tmp_path / "release_1.csv", measured))]) == 0
    assert "proposed" in capsys.readouterr().out
    assert main(["--session", str(session), str(write(tmp_path / "release_2.csv", measured))]) == 0
    assert "session.yaml: left as it is, without release_2.mcap: add what is missing" in capsys.readouterr().out
