"""`trunkline record-poses` as a lab calls it: the folder that it writes, what it prints, what it refuses."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.support.folders import ROOT
from tests.support.small_arm import plain_spec, small_mjcf
from trunkline.kinematics.ik.inputs import gravity_of
from trunkline.recordings.session.session import read_session
from trunkline.tools.record_poses import __main__ as command
from trunkline.tools.record_poses.__main__ import main

NAMES = ["tendon_1", "tendon_2", "tendon_3"]


@pytest.fixture(scope="module")
def lab(tmp_path_factory) -> Path:
    """A folder with models, and the project's settings."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "arm.xml").write_text(small_mjcf(6))
    passive = plain_spec(0.1, 0.001, 0.0)
    passive.compile()
    (folder / "passive.xml").write_text(passive.to_xml())
    (folder / "conf").symlink_to(ROOT / "conf")
    shutil.copy(ROOT / "params.yaml", folder)
    return folder


@pytest.fixture(autouse=True)
def _in_the_lab(lab, monkeypatch):
    monkeypatch.chdir(lab)


def write(folder: Path, *options: str) -> list[dict[str, str]]:
    """The rows of the table that the command writes."""
    assert main([str(folder), "--model", "arm.xml", *options]) == 0
    with open(folder / "poses.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def numbers(rows: list[dict[str, str]], *columns: str) -> np.ndarray:
    return np.array([[float(row[column]) for column in columns] for row in rows])


def test_the_table_says_in_mm_and_degrees_what_to_send(tmp_path):
    rows = write(tmp_path / "poses", "--count", "20", "--pull", "25", "--tilt", "30", "--sides", "0", "180")
    assert [row["pose"] for row in rows] == [f"pose_{number:02d}" for number in range(1, 21)]
    pulls, mounts = numbers(rows, *(f"{name}_mm" for name in NAMES)), numbers(rows, "tilt_deg", "azimuth_deg")
    assert 20 < pulls.max() <= 25
    assert 10 < mounts[:, 0].max() <= 30
    assert set(mounts[:, 1].tolist()) == {0.0, 180.0}
    assert len(np.unique(mounts, axis=0)) == 5
    assert mounts[0, 0] == mounts[:, 0].min(), "in the order in which they are recorded"
    tips = numbers(rows, "tip_x_mm", "tip_y_mm", "tip_z_mm")
    assert (np.linalg.norm(tips, axis=1) < 510).all()
    assert (tips[:, 2] < 0).all(), "the arm points along -z of its base"


def test_the_mount_stays_as_it_is_unless_it_is_to_be_tilted(tmp_path, capsys):
    rows = write(tmp_path / "poses", "--count", "15")
    assert not numbers(rows, "tilt_deg", "azimuth_deg").any()
    printed = capsys.readouterr().out
    assert "the mount stays as it is, the arm hanging straight" in printed
    assert "in all some 8 minutes:" in printed, "15 times 3 + 2 + 3 + 20 + 3 s"


def test_tilts_take_minutes_of_their_own_and_are_told_by_their_side(tmp_path, capsys):
    write(tmp_path / "poses", "--count", "15", "--tilt", "30", "--mounts", "3", "--standing")
    printed = " ".join(capsys.readouterr().out.split())
    assert "in all some 17 minutes, with 3 for each tilt of the mount:" in printed
    assert "the mount has 3 tilts, one after the other: turn it by tilt_deg from the standing arm" in printed


def test_it_prints_what_to_do_and_where_to_see_what_it_brought(tmp_path, capsys):
    rows = write(tmp_path / "poses", "--count", "15")
    printed = " ".join(capsys.readouterr().out.split())
    loose = -numbers(rows, *(f"{name}_mm" for name in NAMES)).min()
    assert f"let all cables out by {loose:.0f} mm from the straight arm within 3 s, and wait 2 s" in printed
    assert "2 s later draw its motors in to the row's pulls, evenly within 3 s" in printed
    assert "touch nothing for 20 s" in printed
    assert "its trial is from 25 s on" in printed
    assert "dvc repro artifacts/report/certificate.html then shows" in printed


def test_its_trials_are_read_as_a_session(tmp_path):
    folder = tmp_path / "poses"
    rows = write(folder, "--count", "15")
    for row in rows:
        (folder / f"{row['pose']}.mcap").write_bytes(row["pose"].encode())
    session = read_session(folder)
    assert [trial.name for trial in session.trials] == [row["pose"] for row in rows]
    assert {(trial.experiment, trial.split, trial.window) for trial in session.trials} == {
        ("static_pull", "validate", (25.0, 28.0))
    }
    assert session.tendons == {name: name for name in NAMES}
    assert session.frame.gravity == "standard"


def test_its_trials_can_be_added_to_those_of_another_session(tmp_path):
    folder = tmp_path / "poses"
    rows = write(folder, "--count", "15")
    added = (folder / "session.yaml").read_text().partition("trials:\n")[2]
    before = (
        "frame: {up: [0, 1, 0]}\nbase: mount\ntrials:\n  - {file: drop.mcap, experiment: release, split: identify}\n"
    )
    (folder / "session.yaml").write_text(before + added)
    for name in ["drop", *(row["pose"] for row in rows)]:
        (folder / f"{name}.mcap").write_bytes(name.encode())
    assert len(read_session(folder).trials) == 16


def test_the_same_seed_gives_the_same_files_and_another_seed_others(tmp_path):
    options = ("--count", "15", "--tilt", "20")
    for name, seed in (("first", "3"), ("again", "3"), ("other", "4")):
        write(tmp_path / name, *options, "--seed", seed)
    texts = {name: (tmp_path / name / "poses.csv").read_bytes() for name in ("first", "again", "other")}
    assert texts["first"] == texts["again"] != texts["other"]


def test_a_network_of_tilts_about_one_axis_has_poses_of_these_alone(tmp_path, lab):
    settings = tmp_path / "tilts"
    settings.mkdir()
    values = yaml.safe_load((lab / "params.yaml").read_text())
    values["fk_dataset"]["gravity"] = "tilt"
    (settings / "params.yaml").write_text(yaml.safe_dump(values))
    rows = write(tmp_path / "poses", "--count", "15", "--tilt", "40", "--settings", str(settings))
    mounts = numbers(rows, "tilt_deg", "azimuth_deg")
    assert mounts[:, 0].max() > 10
    assert not mounts[:, 1].any()
    sideways = gravity_of(np.array([[np.radians(40.0), *np.zeros(7)]]))[0]
    assert sideways[0] > 0, "as the network means a tilt: towards +x"
    assert sideways[1] == 0


@pytest.fixture
def weightless(tmp_path, lab) -> Path:
    """Settings of an arm that gravity does not bend."""
    values = yaml.safe_load((lab / "params.yaml").read_text())
    values["fk_dataset"] |= {"gravity": "none"}
    (tmp_path / "weightless").mkdir()
    (tmp_path / "weightless/params.yaml").write_text(yaml.safe_dump(values))
    return tmp_path / "weightless"


def test_an_arm_without_gravity_has_no_tilts_and_says_so_in_its_session(tmp_path, weightless, capsys):
    write(tmp_path / "poses", "--count", "15", "--settings", str(weightless))
    assert "the mount" not in capsys.readouterr().out
    head = yaml.safe_load((tmp_path / "poses/session.yaml").read_text())
    assert head["frame"]["gravity"] == "none"
    for option in (["--tilt", "5"], ["--standing"]):
        assert main([str(tmp_path / "more"), "--model", "arm.xml", *option, "--settings", str(weightless)]) == 1
        assert f"error: {option[0]}: found it, expected none: " in capsys.readouterr().err


def test_the_folder_is_written_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    def fails(*_):
        raise OSError(28, "No space left on device")

    empty = tmp_path / "empty"
    empty.mkdir()
    with monkeypatch.context() as patched:
        patched.setattr(command, "session_lines", fails)
        for folder in (tmp_path / "new", empty):
            assert main([str(folder), "--model", "arm.xml", "--count", "15"]) == 1
    assert [*tmp_path.iterdir()] == [empty]
    assert [*empty.iterdir()] == []
    write(empty, "--count", "15")
    assert sorted(file.name for file in empty.iterdir()) == ["poses.csv", "session.yaml"]
    assert [*tmp_path.iterdir()] == [empty]


@pytest.mark.parametrize(("options", "line"), [
    (["--count", "0"], "--count: found 0, expected 15 to 500 poses"),
    (["--count", "14"], "--count: found 14, expected 15 to 500 poses"),
    (["--pull", "0"], "--pull: found 0, expected more than 0 mm"),
    (["--pull", "nan"], "--pull: found nan, expected more than 0 mm"),
    (["--pull", "900"], "--pull: found 900, expected at most "),
    (["--tilt", "-1"], "--tilt: found -1, expected 0 to 180°"),
    (["--tilt", "nan"], "--tilt: found nan, expected 0 to 180°"),
    (["--sides", "0", "400"], "--sides: found 400, expected -360 to 360°"),
    (["--mounts", "0"], "--mounts: found 0, expected 1 to 500"),
    (["--seed", "-1"], "--seed: found -1, expected 0 or more"),
    (["--model", "none.xml"], "none.xml: no such file, expected the MJCF of an arm"),
    (["--model", "passive.xml"], "passive.xml: found no motor, expected an arm that pulls cables"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused_in_a_line(options, line, tmp_path, capsys):
    assert main([str(tmp_path / "poses"), "--model", "arm.xml", *options]) == 1
    printed = capsys.readouterr()
    (error,) = printed.err.splitlines()
    assert error.startswith(f"error: {line}")
    assert printed.out == ""
    assert [*tmp_path.iterdir()] == []


def test_without_a_model_it_says_what_makes_one(tmp_path, capsys):
    assert main([str(tmp_path / "poses")]) == 1
    assert capsys.readouterr().err == "error: .: found no identified model, expected one (run `dvc repro`) or --model\n"


def test_a_folder_with_something_in_it_stays_as_it_is(tmp_path, capsys):
    (tmp_path / "log.mcap").write_bytes(b"log")
    for folder in (tmp_path, tmp_path / "log.mcap"):
        assert main([str(folder), "--model", "arm.xml"]) == 1
        assert capsys.readouterr().err == f"error: {folder}: found something there, expected a new or an empty folder\n"
    assert [*tmp_path.iterdir()] == [tmp_path / "log.mcap"]


def test_the_current_folder_is_not_replaced(tmp_path, lab, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([".", "--model", str(lab / "arm.xml")]) == 1
    assert capsys.readouterr().err == "error: .: found the current folder, expected another one\n"
