"""What is guessed of small tables: of each the lines of the proposed block that its names and numbers decide."""

import numpy as np
import pandas as pd
import pytest
import yaml

from trunkline.errors import InputError
from trunkline.recordings.preparation.table_survey import survey_table
from trunkline.recordings.tables.guess import _yaml, guess

COUNT = 40
T = np.arange(COUNT) / 100
PLACES = {axis: [f"{number + 0.1 * row:.6g}" for row in range(COUNT)] for number, axis in enumerate("xyz")}


def numbers(values, start=0.0) -> list[str]:
    return [f"{start + value:.12g}" for value in values]


def table(path, columns: dict[str, list[str]], separator=",", decimal=".", encoding="utf-8", above=(), below=()):
    """A text of cells."""
    rows = [separator.join(row).replace(".", decimal) for row in zip(*columns.values(), strict=True)]
    path.write_bytes("\n".join([*above, separator.join(columns), *below, *rows, ""]).encode(encoding))
    return path


def block(path) -> dict:
    """The proposed block."""
    return yaml.safe_load("\n".join(guess(path).tables))


def of_csv(folder, columns: dict[str, list[str]], **form) -> dict:
    return block(table(folder / "a.csv", columns, **form))


TIMED = {"time": numbers(T)} | PLACES
FORMS = {
    "commas": ({}, {"separator": ",", "decimal": ".", "encoding": "utf-8", "header": 1}),
    "semicolons": ({"separator": ";"}, {"separator": ";", "decimal": "."}),
    "semicolons, decimal commas": ({"separator": ";", "decimal": ","}, {"separator": ";", "decimal": ","}),
    "tabs": ({"separator": "\t"}, {"separator": "tab", "decimal": "."}),
    "tabs, decimal commas": ({"separator": "\t", "decimal": ","}, {"separator": "tab", "decimal": ","}),
    "blanks": ({"separator": "  "}, {"separator": "blanks", "decimal": "."}),
    "UTF-16": ({"encoding": "utf-16"}, {"encoding": "utf-16"}),
    "UTF-16 without a mark": ({"encoding": "utf-16-le"}, {"encoding": "utf-16"}),
    "Latin-1": ({"above": ["20 °C"], "encoding": "latin-1"}, {"encoding": "latin-1", "header": 2}),
    "UTF-8 that is no ASCII": ({"above": ["20 °C"]}, {"encoding": "utf-8", "header": 2}),
    "lines above": ({"above": ["arm 7", "by, hand"]}, {"header": 3}),
    "a line of units": ({"below": ["s,mm,mm,mm"]}, {"header": 2, "names": 1}),
    "lines above and units": ({"above": ["arm 7"], "below": ["s,mm,mm,mm"]}, {"header": 3, "names": 2}),
}


@pytest.mark.parametrize(("form", "right"), FORMS.values(), ids=FORMS)
def test_how_a_text_is_written(tmp_path, form, right):
    proposed = of_csv(tmp_path, TIMED, **form)
    assert {key: proposed[key] for key in right} == right
    assert ("names" in proposed) == ("names" in right)
    assert proposed["bodies"] == {"body": {"position": ["x", "y", "z"]}}
    assert proposed["time"]["column"] == "time"


def test_no_header_and_no_names(tmp_path):
    """The column that increases is time, and three each are a body."""
    columns = {"t": numbers(T)} | {str(i): numbers(np.sin(T + i)) for i in range(6)}
    path = table(tmp_path / "a.csv", columns)
    path.write_text(path.read_text().partition("\n")[2])
    proposed = block(path)
    assert proposed["header"] == 0
    assert proposed["time"] == {"column": 1, "unit": "s"}
    assert proposed["bodies"] == {"body_1": {"position": [2, 3, 4]}, "body_2": {"position": [5, 6, 7]}}


def test_names_over_several_columns(tmp_path):
    """A line of bodies, each over its axes, and one of axes: the columns go by their numbers."""
    columns = {"Time": numbers(T)} | {f"{axis}{' ' * i}": PLACES[axis] for i in range(2) for axis in "xyz"}
    path = table(tmp_path / "a.csv", columns, above=[",base,,,tip,,"])
    path.write_text(path.read_text().replace("Time,x,y,z,x ,y ,z ", "Time,x,y,z,x,y,z"))
    proposed = block(path)
    assert (proposed["header"], proposed["time"]["column"]) == (2, 1)
    assert proposed["bodies"] == {"base": {"position": [2, 3, 4]}, "tip": {"position": [5, 6, 7]}}


# of a column of times: its name, its cells, the unit
UNITS = {
    "by a name in brackets": ("Time [ms]", numbers(T), "ms"),
    "by a name behind a line": ("time_us", numbers(T), "us"),
    "in parentheses": ("time (min)", numbers(T), "min"),
    "s by their steps": ("time", numbers(T), "s"),
    "ms by their steps": ("time", numbers(1e3 * T), "ms"),
    "us by their steps": ("time", numbers(1e6 * T), "us"),
    "s since 1970": ("stamp", numbers(T, 1.77e9), "s"),
    "ms since 1970": ("stamp", [f"{1_770_000_000_000 + 10 * row}" for row in range(COUNT)], "ms"),
    "us since 1970": ("stamp", [f"{1_770_000_000_000_000 + 10_000 * row}" for row in range(COUNT)], "us"),
    "ns since 1970": ("stamp", [f"{1_770_000_000_000_000_000 + 10_000_000 * row}" for row in range(COUNT)], "ns"),
    "us in 1973": ("stamp", [f"{110_000_000_000_000 + 10_000 * row}" for row in range(COUNT)], "us"),
    "dates": ("time", [f"2026-03-14 14:15:{row:02d}.5" for row in range(COUNT)], "date"),
}


@pytest.mark.parametrize(("name", "cells", "unit"), UNITS.values(), ids=UNITS)
def test_units_of_time(tmp_path, name, cells, unit):
    assert of_csv(tmp_path, {name: cells} | PLACES)["time"] == {"column": name, "unit": unit}


@pytest.mark.parametrize(
    ("columns", "time"),
    [
        ({"frame": numbers(range(COUNT)), "time": numbers(T)}, {"column": "time", "unit": "s", "frames": "frame"}),
        ({"frame": numbers(range(COUNT))}, {"rate": 100, "frames": "frame"}),
        ({"id": ["7"] * COUNT}, {"rate": 100}),
        ({"time": ["7"] * COUNT}, {"rate": 100}),
        ({"time": numbers(-T)}, {"rate": 100}),
        ({}, {"rate": 100}),
    ],
)
def test_columns_of_time_run_and_frame_numbers_count(tmp_path, columns, time):
    assert of_csv(tmp_path, columns | PLACES)["time"] == time


HALF = ["0.5"] * COUNT
# columns beside the position, and what a body gets, or is left to fill in
TURNS = {
    "named": ({f"q{axis}": HALF for axis in "xyzw"}, {"quaternion": ["qw", "qx", "qy", "qz"]}, ""),
    "in words": ({f"rot_{axis}": HALF for axis in "wxyz"},
                 {"quaternion": ["rot_w", "rot_x", "rot_y", "rot_z"]}, ""),
    "numbered": ({f"q{i}": HALF for i in range(4)}, {}, "FILL IN: quaternion: [q0, q1, q2, q3], with"),
    "numbers of another norm": ({f"q{i}": ["0.7"] * COUNT for i in range(4)}, {}, ""),
    "angles": ({name: HALF for name in ("yaw", "pitch", "roll")}, {}, "FILL IN: euler: [roll, pitch, yaw], with"),
}  # fmt: skip


@pytest.mark.parametrize(("columns", "body", "comment"), TURNS.values(), ids=TURNS)
def test_orientations(tmp_path, columns, body, comment):
    path = table(tmp_path / "a.csv", TIMED | columns)
    proposed, text = block(path), "\n".join(guess(path).tables)
    assert proposed["bodies"] == {"body": {"position": ["x", "y", "z"]} | body}
    assert proposed.get("quaternion") == ("wxyz" if body else None)
    assert comment in text
    assert ("FILL IN" in text) == bool(comment)


@pytest.mark.parametrize(("axes", "gaps"), [("xyz", [-9999]), ("x", None)])
def test_gaps_are_in_all_three_places(tmp_path, axes, gaps):
    columns = {axis: cells[:-3] + ["-9999"] * 3 if axis in axes else cells for axis, cells in PLACES.items()}
    assert of_csv(tmp_path, {"time": numbers(T)} | columns).get("gaps") == gaps


@pytest.mark.parametrize(
    "name", ["y", "N", "yes", "no", "On", "off", "true", "False", "null", "x [mm]", "#1", "a: b", "Ö"]
)
def test_names_are_texts_in_any_version_of_yaml(name):
    """Some words are none there: in 1.1 y is true."""
    assert yaml.safe_load(_yaml(name)) == name
    assert _yaml(name) == f'"{name}"'


@pytest.mark.parametrize("name", ["tip_x", "tip.x", "T1"])
def test_other_names_go_without_quotes(name):
    assert _yaml(name) == name


# commands and measured positions by name, and their unit: (commands, tendon_positions), or None where it is not clear
MOTORS = {
    "in mm": (["cmd 1 [mm]", "cable pos 1 [mm]"], (["cmd 1 [mm]"], ["cable pos 1 [mm]"]), 1e-3),
    "in m": (["motor_1_target (m)", "motor_1_actual (m)"], (["motor_1_target (m)"], ["motor_1_actual (m)"]), 1.0),
    "drums": (["motor 1 [deg]"], None, np.pi / 180),
    "two units": (["cmd 1 [mm]", "cmd 2 [m]"], None, 1.0),
    "forces": (["tension_1"], None, 1.0),
}


@pytest.mark.parametrize(("names", "roles", "metres"), MOTORS.values(), ids=MOTORS)
def test_motors(tmp_path, names, roles, metres):
    path = table(tmp_path / "a.csv", TIMED | dict.fromkeys(names, HALF))
    proposed, result = block(path), guess(path)
    commands, positions = roles or (None, None)
    for key, columns in (("commands", commands), ("tendon_positions", positions)):
        assert proposed.get(key) == (columns and {f"motor_{i}": name for i, name in enumerate(columns, 1)})
    assert ("FILL IN the unit" in "\n".join(result.motors)) == (roles is None)
    assert result.metres == metres


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        (["a"] * 20 + ["b"] * 20, ["a", "b"]),
        (["7"] * 20 + ["9"] * 20, ["7", "9"]),
        (["a"] * 10 + ["b"] * 10 + ["a"] * 20, []),  # again
        (["a"] * 40, []),
        ([f"{row}" for row in range(COUNT)], []),  # each row
    ],
)
def test_trials_follow_each_other(tmp_path, labels, names):
    path = table(tmp_path / "a.csv", TIMED | {"run": labels})
    assert guess(path).labels == names
    assert block(path).get("trial") == ("run" if names else None)


def test_each_trial_is_surveyed_with_its_rows(tmp_path):
    """The first has what was guessed, and why."""
    columns = {"time": numbers(T), "run": ["a"] * 25 + ["b"] * 15, "cmd_1 [mm]": numbers(1e3 * T)}
    path = table(tmp_path / "a.csv", columns | {f"tip_{axis} [cm]": cells for axis, cells in PLACES.items()})
    first, second = survey_table(path)
    assert (first.label, second.label) == ("a", "b")
    assert [len(survey.poses.stamps) for survey in (first, second)] == [25, 15]
    np.testing.assert_allclose(second.poses.positions[0, 0], [2.5, 3.5, 4.5])
    np.testing.assert_allclose(second.commands.positions[:, 0], T[25:])  # in m
    assert (first.unit, second.unit) == ("cm", "cm")
    assert "trials: column 'run', by its name: 2 labels" in "\n".join(first.notes)
    assert first.tables[0] == "tables:"
    assert first.tables[-1] == "  motor_1: {unit: mm, tendons: {tendon_1: 1}}"


@pytest.mark.parametrize(("head", "unit"), [("[inch]", "inch"), ("(mm)", "mm"), ("", None), ("[deg]", None)])
def test_the_unit_of_positions(tmp_path, head, unit):
    columns = {f"{axis} {head}".strip(): cells for axis, cells in PLACES.items()}
    (survey,) = survey_table(table(tmp_path / "a.csv", {"time": numbers(T)} | columns))
    assert survey.unit == unit


def test_a_line_of_units_says_that_of_positions_and_motors(tmp_path):
    path = table(tmp_path / "a.csv", TIMED | {"u1": HALF}, below=["ms,mm,mm,mm,mm"])
    result = guess(path)
    assert (result.unit, result.metres) == ("mm", 1e-3)
    assert block(path)["time"]["unit"] == "ms"
    assert block(path)["commands"] == {"motor_1": "u1"}


def test_times_and_numbers_of_parquet(tmp_path):
    frame = pd.DataFrame({axis: np.arange(COUNT) * 1.0 for axis in "xyz"})
    frame["stamp"] = 1_770_000_000_000_000_000 + 10_000_000 * np.arange(COUNT)
    frame.assign(stamp=frame["stamp"].astype("datetime64[ns]")).to_parquet(tmp_path / "dates.parquet")
    frame.to_parquet(tmp_path / "numbers.parquet")
    assert block(tmp_path / "dates.parquet")["time"] == {"column": "stamp", "unit": "s"}
    assert block(tmp_path / "numbers.parquet")["time"] == {"column": "stamp", "unit": "ns"}


def test_what_is_no_position_is_refused_in_a_line(tmp_path):
    path = table(tmp_path / "a.csv", {"time": numbers(T), "force": HALF})
    with pytest.raises(InputError, match=r"a\.csv: found force, expected columns of x, y and z, such as tip_x"):
        guess(path)


# what labs' files are like


def test_a_table_that_is_not_there_or_is_empty_is_refused_in_a_line(tmp_path):
    for name in ("a.csv", "a.parquet", "a.npz", "a.mat"):
        with pytest.raises(InputError, match=rf"{name}: .*no such file or directory.*, expected a table"):
            guess(tmp_path / name)
    for text in ("", "\n\n", "time,x,y,z\n"):
        (tmp_path / "a.csv").write_text(text)
        with pytest.raises(InputError, match=r"a\.csv: found no row of numbers, expected a table"):
            guess(tmp_path / "a.csv")


def test_cells_in_quotes(tmp_path):
    """All of them, or those that have a separator in them."""
    quoted = {f'"{name}"': [f'"{cell}"' for cell in cells] for name, cells in TIMED.items()}
    for columns in (quoted, TIMED | {"note": ['"by hand, cold"'] * COUNT}):
        proposed = of_csv(tmp_path, columns)
        assert (proposed["separator"], proposed["header"]) == (",", 1)
        assert proposed["time"] == {"column": "time", "unit": "s"}
        assert proposed["bodies"] == {"body": {"position": ["x", "y", "z"]}}


def test_velocities_are_no_places_and_angles_by_axis_are_angles(tmp_path):
    beside = {f"tip_{kind}{axis}": HALF for kind in ("v", "w", "a") for axis in "xyz"}
    columns = {"time": numbers(T)} | {f"tip_{axis}": cells for axis, cells in PLACES.items()} | beside
    assert list(of_csv(tmp_path, columns)["bodies"]) == ["tip"]
    turned = columns | {f"tip_r{axis} [rad]": HALF for axis in "xyz"}
    path = table(tmp_path / "a.csv", turned)
    assert list(block(path)["bodies"]) == ["tip"]
    assert ("FILL IN: euler: [\"tip_rx [rad]\", \"tip_ry [rad]\", \"tip_rz [rad]\"], with `euler: {convention: xyz, "
            "unit: rad}`") in "\n".join(guess(path).tables)  # fmt: skip


@pytest.mark.parametrize("name", ["ts_us", "Zeit [us]"])
def test_other_names_of_time(tmp_path, name):
    assert of_csv(tmp_path, {name: numbers(1e6 * T)} | PLACES)["time"] == {"column": name, "unit": "us"}


def test_a_table_of_motors_alone_is_said(tmp_path):
    with pytest.raises(InputError, match="found m1, m2, .*of motors alone, it is the `motors_file` of the poses'"):
        guess(table(tmp_path / "a.csv", {"time": numbers(T), "m1": HALF, "m2": HALF}))


def test_durations_of_parquet(tmp_path):
    frame = pd.DataFrame({axis: np.arange(COUNT) * 1.0 for axis in "xyz"}).assign(time=pd.to_timedelta(T, unit="s"))
    frame.to_parquet(tmp_path / "a.parquet")
    assert block(tmp_path / "a.parquet")["time"] == {"column": "time", "unit": "s"}
