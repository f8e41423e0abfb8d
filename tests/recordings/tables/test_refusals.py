"""Bad declarations and bad cells: one line that says where, what was found and what was expected."""

import re

import numpy as np
import pytest

from tests.recordings.tables.lab_table import (
    columns_of,
    layout_of,
    measured,
    raw_trials,
    trial_of,
    write_declared,
    write_text,
)
from trunkline.errors import InputError

CURL, _ = measured()


def without(layout: dict, *path: str) -> dict:
    inside = layout
    for key in path[:-1]:
        inside = inside[key]
    del inside[path[-1]]
    return layout


def changed(**changes) -> dict:
    return layout_of(CURL) | changes


def with_body(**columns) -> dict:
    layout = layout_of(CURL)
    layout["bodies"]["base"] |= columns
    return layout


# what is declared, of the same table; the whole line behind session.yaml's or the table's name
DECLARED = {
    "no time": (without(layout_of(CURL), "time"), "session.yaml: tables.time: missing, expected a value"),
    "no unit of time": (
        changed(time={"column": "t"}),
        "session.yaml: tables.time: unit: missing, expected that of the column 't': s, ms, us, ns, min or date",
    ),
    "time and rate": (
        changed(time={"column": "t", "unit": "s", "rate": 100}),
        "session.yaml: tables.time: found both `column` and `rate`, expected one of the two",
    ),
    "neither": (
        changed(time={"frames": "frame"}),
        "session.yaml: tables.time: found no `column` and no `rate`, expected one of the two",
    ),
    "unknown unit": (
        changed(time={"column": "t", "unit": "sec"}),
        "session.yaml: tables.time.unit: found 'sec', expected 's', 'ms', 'us', 'ns', 'min' or 'date'",
    ),
    "misspelt key": (
        changed(separater=";"),
        "session.yaml: tables.separater: unknown key, did you mean 'separator'?",
    ),
    "unknown separator": (
        changed(separator="|"),
        "session.yaml: tables.separator: found '|', expected ',', ';', 'tab' or 'blanks'",
    ),
    "one comma for two": (
        changed(separator=",", decimal=","),
        "session.yaml: tables: decimal: found ',' beside the separator ',', expected another separator",
    ),
    "names beyond the header": (
        changed(names=3),
        "session.yaml: tables: names: found 3, expected a line of the header, which has 1",
    ),
    "two coordinates": (
        with_body(position=["base_x", "base_y"]),
        "session.yaml: tables.bodies.base.position: found 2 columns, expected 3",
    ),
    "a column twice": (
        with_body(position=["base_x", "base_y", "base_y"]),
        "session.yaml: tables.bodies.base.position: found the column 'base_y' twice, expected another for each",
    ),
    "column zero": (
        with_body(position=[0, 1, 2]),
        "session.yaml: tables.bodies.base.position.0: found 0, expected a column's name, or its number from 1",
    ),
    "no order of quaternions": (
        without(layout_of(CURL), "quaternion"),
        "session.yaml: tables: quaternion: missing, as bodies.base has one, expected wxyz or xyzw, the order of the "
        "columns",
    ),
    "quaternion and angles": (
        with_body(euler=["base_qx", "base_qy", "base_qz"]),
        "session.yaml: tables.bodies.base: euler: found it beside `quaternion`, expected one of the two",
    ),
    "a convention that is none": (
        changed(euler={"convention": "xYz", "unit": "deg"}),
        "session.yaml: tables.euler.convention: found 'xYz', expected SciPy's three letters, such as 'xyz' about axes "
        "that stand, or 'XYZ' about those that turn along",
    ),
    "a motor that is no column": (
        changed(commands={"tendon_1": 1.5}),
        "session.yaml: tables.commands.tendon_1: found 1.5, expected a column's name, or its number from 1",
    ),
    "a file of no motors": (
        without(without(changed(motors_file={"file": "m.csv"}), "commands"), "tendon_positions"),
        "session.yaml: tables: motors_file: found no columns of it, expected `commands` or `tendon_positions`",
    ),
    "no such column": (
        with_body(position=["base_x", "base_y", "bas_z"]),
        "curl_40.csv: line 1: found the columns t, frame, base_x, base_y, base_z, base_qw, base_qx, base_qy, base_qz, "
        "unit_02_x, unit_02_y, unit_02_z and 31 more, expected 'bas_z' of session.yaml, did you mean 'base_z'?",
    ),
    "no such number": (
        with_body(position=[3, 4, 99]),
        "curl_40.csv: line 1: found 43 columns, expected column 99 of session.yaml",
    ),
    "names without a header": (
        changed(header=0),
        "curl_40.csv: found no names of columns, as `header: 0`, expected numbers from 1 in place of 'base_x' in "
        "session.yaml",
    ),
    "another separator": (
        changed(separator=";"),
        "curl_40.csv: line 1: found the columns t,frame,base_x,base_y,base_z,base_qw,bas, expected 'base_x' of "
        "session.yaml: is `separator` right?",
    ),
    "too long a header": (
        changed(header=5000, names=1),
        "session.yaml: tables.header: found 5000, expected less than or equal to 1000",
    ),
    "header beyond the file": (
        changed(header=1000),
        "curl_40.csv: found no row below 1000 lines of header, expected `header` and `encoding` in session.yaml to be "
        "as in the file",
    ),
    "another encoding": (
        changed(encoding="utf-16"),
        "curl_40.csv: found no row below 1 lines of header, expected `header` and `encoding` in session.yaml to be "
        "as in the file",
    ),
    "no such trial": (
        changed(trial="frame"),
        "curl_40.csv: trial curl_40: column 'frame': found {any}, expected 'curl_40', the `label` of the trial",
    ),
    "no file of motors": (
        changed(motors_file={"file": "motors.csv"}),
        "motors.csv: no such file or directory, expected a table",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DECLARED, ids=DECLARED)
def test_declarations(tmp_path, case):
    layout, line = DECLARED[case]
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    write_declared(tmp_path, layout, [trial_of(CURL)])
    pattern = re.escape(f"{tmp_path}/{line}").replace(r"\{any\}", ".*")
    assert re.fullmatch(pattern, refusal(tmp_path)), refusal(tmp_path)


def refusal(folder) -> str:
    """The line with which a session, or its one trial, is refused; empty where it is read."""
    try:
        ((_, raw),) = raw_trials(folder).items()
    except InputError as error:
        raw = error
    if not isinstance(raw, InputError):
        return ""
    problem, _, line = str(raw).removesuffix(")").partition(" (line ")
    if problem.startswith(f"{folder}/session.yaml: "):
        key = problem.removeprefix(f"{folder}/session.yaml: ").partition(":")[0].split(".")
        written = (folder / "session.yaml").read_text().splitlines()[int(line) - 1]
        assert any(f"{part}:" in written for part in key) or "- 0" in written, f"{key}: line {line}: {written}"
        return problem
    return str(raw)


def test_bytes_of_another_encoding(tmp_path):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL), above=["arm 7", "20 °C"], encoding="latin-1")
    write_declared(tmp_path, layout_of(CURL) | {"header": 3}, [trial_of(CURL)])
    assert refusal(tmp_path) == (f"{tmp_path}/curl_40.csv: line 2: found bytes that are not utf-8, expected "
                                 "`encoding` in session.yaml to say which: utf-8, utf-16 or latin-1")  # fmt: skip


def test_declarations_that_are_right_are_read(tmp_path):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)])
    assert refusal(tmp_path) == ""


def test_a_label_without_a_column_and_a_table_without_tables(tmp_path):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL, label=3)])
    assert refusal(tmp_path) == (f"{tmp_path}/session.yaml: trials.0.label: found 3, expected none, or "
                                 "`trial` in `tables`: the column that has it")  # fmt: skip
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL, table={"headers": 3})])
    assert refusal(tmp_path) == f"{tmp_path}/session.yaml: trials.0.table: headers: unknown key, did you mean 'header'?"
    write_declared(tmp_path, None, [trial_of(CURL)])
    assert refusal(tmp_path) == (f"{tmp_path}/session.yaml: trials.0.file: found the table 'curl_40.csv', "
                                 "expected `tables`, which says what its columns are (`trunkline inspect` "
                                 "proposes it)")  # fmt: skip


def test_relative_poses_need_a_turned_base(tmp_path):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    write_declared(tmp_path, layout_of(CURL) | {"frame": "base"}, [trial_of(CURL)], base={"position": [0, 0, 0]})
    assert refusal(tmp_path) == (f"{tmp_path}/session.yaml: base: quaternion missing, expected how it is turned, "
                                 "as `tables` has `frame: base`")  # fmt: skip


# a line of the table to another, and the line that refuses it
CELLS = {
    "a word": (17, "base_y", "abc", "line 17, column 'base_y': found 'abc', expected a number"),
    "a decimal comma": (
        17, "base_y", '"1,5"',
        "line 17, column 'base_y': found '1,5', expected a number: `decimal: \",\"`?",
    ),
    "first row": (
        2, "cmd_1", "[mm]",
        "line 2, column 'cmd_1': found '[mm]', expected a number, or `header` that counts this line",
    ),
    "no time": (9, "t", "", "line 9, column 't': found 'nan', expected a time in every row"),
    "too many cells": (
        9, "t", "1,2",
        "line 9: found 44 cells, expected 43, as in the lines before: are `separator`, `decimal` and `header` right?",
    ),
    "far time": (9, "t", "1e12", "line 9, column 't': found '1e+12', expected a time before the year 2255: is its "
                                 "`unit` right?"),
}  # fmt: skip


@pytest.mark.parametrize("case", CELLS.values(), ids=CELLS)
def test_cells(tmp_path, case):
    number, column, cell, line = case
    columns = columns_of(CURL)
    path = tmp_path / "curl_40.csv"
    write_text(path, columns)
    lines = path.read_text().splitlines()
    cells = lines[number - 1].split(",")
    cells[list(columns).index(column)] = cell
    lines[number - 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)])
    assert refusal(tmp_path) == f"{path}: {line}"


def test_a_column_of_words_that_nobody_names_is_no_matter(tmp_path):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL) | {"note": ["by hand"] * len(CURL.stamps)})
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)])
    assert refusal(tmp_path) == ""


def test_a_file_that_is_cut_off_loses_its_last_row_and_says_so(tmp_path):
    path = tmp_path / "curl_40.csv"
    write_text(path, columns_of(CURL))
    text = path.read_text()
    path.write_text(text[: text.rstrip().rfind("\n") + 30])
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)])
    raw = raw_trials(tmp_path)["curl_40"]
    assert len(raw.time) == len(CURL.stamps) - 1
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:50], lines[50][:30], *lines[51:]]))
    assert re.fullmatch(rf"{path}: line 51: found \d cells, expected 43, .*", refusal(tmp_path)), refusal(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "line"),
    [
        ("a.parquet", b"no such thing", "expected a Parquet file"),
        ("a.npz", b"no such thing", "expected an npz file of arrays of numbers"),
        ("a.mat", b"no such thing", "expected an mat file of arrays of numbers"),
        ("a.mat", b"MATLAB 7.3 MAT-file", "found MATLAB 7.3 (HDF5), expected version 5: save(…, '-v7')"),
    ],
)  # fmt: skip
def test_files_that_are_not_what_their_names_say(tmp_path, name, content, line):
    (tmp_path / name).write_bytes(content)
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL, file=name)])
    message = refusal(tmp_path)
    assert message.startswith(f"{tmp_path / name}: ")
    assert message.endswith(line)


def test_arrays_of_python_objects_are_not_run(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.array([{"a": 1}, 2], dtype=object))
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL, file="a.npz")])
    assert "allow_pickle" in refusal(tmp_path)


def test_labels_of_one_file_in_two_splits_share_nothing(tmp_path):
    columns = columns_of(CURL) | {"run": ["a"] * 150 + ["b"] * (len(CURL.stamps) - 150)}
    write_text(tmp_path / "all.csv", columns)
    trials = [trial_of(CURL, name=label, file="all.csv", split=split)
              for label, split in (("a", "identify"), ("b", "test"))]  # fmt: skip
    write_declared(tmp_path, layout_of(CURL) | {"trial": "run"}, trials)
    assert {name: len(raw.time) for name, raw in raw_trials(tmp_path).items()} == {
        "a": 150, "b": len(CURL.stamps) - 150}  # fmt: skip
    trials[1]["label"] = "a"
    write_declared(tmp_path, layout_of(CURL) | {"trial": "run"}, trials)
    with pytest.raises(InputError, match="trials a and b share data"):
        raw_trials(tmp_path)
