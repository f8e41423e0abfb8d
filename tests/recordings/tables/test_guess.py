"""`trunkline inspect TABLE` proposes a session.yaml that is read as it is, and says why, and what it cannot know."""

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tests.recordings.tables.lab_table import assert_equal, columns_of, logged, measured, raw_trials, write_text
from trunkline.recordings.preparation.inspect import main

CURL, RELEASE = measured()


def proposed(capsys, path) -> tuple[str, dict]:
    """(what is printed, the proposed session.yaml, which is written beside the table)."""
    assert main([str(path)]) == 0
    described, _, text = capsys.readouterr().out.partition("Proposed session.yaml:\n")
    (path.parent / "session.yaml").write_text(text)
    return described + text, yaml.safe_load(text)


def in_mm(columns: dict) -> dict:
    """With headers as labs have them: units in brackets, commands in mm."""
    renamed = {}
    for name, values in columns.items():
        if name.startswith(("cmd", "pos")):
            word = {"cmd": "motor command", "pos": "motor position"}[name[:3]]
            renamed[f"{word} {name[4:]} [mm]"] = 1e3 * values
        elif name[-2:] in ("_x", "_y", "_z"):
            renamed[f"{name} [mm]"] = 1e3 * values
        elif name == "t":
            renamed["timestamp_ms"] = 1e3 * values
        else:
            renamed[name] = values
    return renamed


@pytest.mark.parametrize(
    "form",
    [
        {},
        {"separator": ";", "decimal": ","},
        {"separator": "\t", "encoding": "utf-16"},
        {"above": ["arm 7, Prüfstand", "by, hand"], "encoding": "latin-1"},
    ],
    ids=["plain", "semicolon", "UTF-16", "Latin-1"],
)
def test_a_proposal_gives_the_raw_trials_of_the_log(tmp_path, capsys, form):
    right = logged(tmp_path / "logs")["curl_40"]
    (tmp_path / "tables").mkdir()
    path = tmp_path / "tables" / "curl_40.csv"
    write_text(path, in_mm(columns_of(CURL)), **form)
    text, session = proposed(capsys, path)
    assert session["frame"]["unit"] == "mm"
    assert session["base"] == "base"
    assert (session["trials"][0]["experiment"], session["trials"][0]["level"]) == ("curl", 40)
    for why in ("time: column 'timestamp_ms', by its name; in ms, by its name", "motors: by their names in mm",
                "order of w, x, y, z, by the columns' names"):  # fmt: skip
        assert why in text
    assert_equal(raw_trials(path.parent)["curl_40"], right)


def test_parquet(tmp_path, capsys):
    pandas = pytest.importorskip("pandas")
    path = tmp_path / "release_a.parquet"
    pandas.DataFrame(in_mm(columns_of(RELEASE))).to_parquet(path)
    proposed(capsys, path)
    assert len(raw_trials(tmp_path)["release_a"].time) == len(RELEASE.stamps)


def test_what_it_cannot_know_is_left_to_fill_in(tmp_path, capsys):
    """The rate, the convention of angles, the motors' unit; all the same it is read."""
    columns = columns_of(RELEASE)
    del columns["t"], columns["frame"]
    for body in RELEASE.bodies:
        for axis, angle in zip("xyz", ("roll", "pitch", "yaw"), strict=True):
            columns[f"{body}_{angle}"] = columns.pop(f"{body}_q{axis}")
        del columns[f"{body}_qw"]
    columns["Tension 1"] = np.ones(len(RELEASE.stamps))
    write_text(tmp_path / "release_a.csv", columns)
    text, _ = proposed(capsys, tmp_path / "release_a.csv")
    assert "FILL IN the rate" in text
    assert "FILL IN: euler: [base_roll, base_pitch, base_yaw]" in text
    assert '# commands: {motor_1: "Tension 1"}' in text
    assert "#   motor_1: {unit: N, tendons: {tendon_1: 1}}" in text
    assert len(raw_trials(tmp_path)["release_a"].time) == len(RELEASE.stamps)


def test_four_numbers_of_norm_one_are_a_quaternion_of_unknown_order(tmp_path, capsys):
    turns = Rotation.random(50, rng=0).as_quat().T
    columns = {"time": np.arange(50) / 50} | {axis: np.arange(50.0) for axis in "xyz"}
    write_text(tmp_path / "a.csv", columns | {f"q{i}": turn for i, turn in enumerate(turns, 1)})
    text, _ = proposed(capsys, tmp_path / "a.csv")
    assert "FILL IN: quaternion: [q1, q2, q3, q4], with `quaternion: wxyz` or xyzw above" in text


def test_gaps_and_trials_are_seen(tmp_path, capsys):
    columns = {name: np.where(np.isnan(values), -9999.0, values) for name, values in columns_of(RELEASE).items()}
    half = len(RELEASE.stamps) // 2
    write_text(tmp_path / "all.csv", columns | {"run_id": ["a"] * half + ["b"] * (len(RELEASE.stamps) - half)})
    _, session = proposed(capsys, tmp_path / "all.csv")
    assert session["tables"]["gaps"] == [-9999]
    assert session["tables"]["trial"] == "run_id"
    assert [trial["label"] for trial in session["trials"]] == ["a", "b"]
    assert {len(raw.time) for raw in raw_trials(tmp_path).values()} == {half, len(RELEASE.stamps) - half}


def test_a_table_without_positions_is_refused_in_a_line(tmp_path, capsys):
    write_text(tmp_path / "a.csv", {"time": np.arange(9.0), "u1": np.arange(9.0)})
    assert main([str(tmp_path / "a.csv")]) == 1
    assert "a.csv: found u1, expected columns of x, y and z" in capsys.readouterr().err
