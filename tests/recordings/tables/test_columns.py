"""Cells, lines and names of small tables, each with the numbers that have to come out."""

import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from trunkline.errors import InputError
from trunkline.recordings.session.layout import TextForm
from trunkline.recordings.tables import columns
from trunkline.recordings.tables.arrays import array_columns
from trunkline.recordings.tables.columns import Table, read_table

LABELS = ["t", "x", "y"]
# of the rows (0, 1.5, -2) and (1, 2.5, -3), by what is special: the name of the file, its bytes, how it is declared
TEXTS = {
    "commas": ("a.csv", b"t,x,y\n0,1.5,-2\n1,2.5,-3\n", {}),
    "of .tsv tabs": ("a.tsv", b"t\tx\ty\n0\t1.5\t-2\n1\t2.5\t-3\n", {}),
    "of .txt blanks": ("a.txt", b"t x y\n0 1.5 -2\n1 2.5 -3\n", {}),
    "of .dat blanks": ("a.dat", b"t   x  y\n 0   1.5  -2\n 1   2.5  -3\n", {}),
    "of decimal commas semicolons": ("a.csv", b"t;x;y\n0;1,5;-2\n1;2,5;-3,0\n", {"decimal": ","}),
    "decimal commas between tabs": ("a.tsv", b"t\tx\ty\n0\t1,5\t-2\n1\t2,5\t-3\n", {"decimal": ","}),
    "decimal commas between blanks": ("a.txt", b"t x y\n0 1,5 -2\n1 2,5 -3\n", {"decimal": ","}),
    "UTF-8 with a mark": ("a.csv", b"\xef\xbb\xbft,x,y\n0,1.5,-2\n1,2.5,-3\n", {}),
    "a mark that says more than the declaration": (
        "a.csv", b"\xef\xbb\xbft,x,y\n0,1.5,-2\n1,2.5,-3\n", {"encoding": "latin-1"}),
    "UTF-16 with a mark": ("a.csv", "t,x,y\n0,1.5,-2\n1,2.5,-3\n".encode("utf-16"), {"encoding": "utf-16"}),
    "UTF-16 that nobody declares": ("a.csv", "t,x,y\n0,1.5,-2\n1,2.5,-3\n".encode("utf-16"), {}),
    "UTF-16 the other way round": ("a.csv", "\ufefft,x,y\n0,1.5,-2\n1,2.5,-3\n".encode("utf-16-be"), {}),
    "UTF-16 without a mark": ("a.csv", "t,x,y\n0,1.5,-2\n1,2.5,-3\n".encode("utf-16-le"), {"encoding": "utf-16"}),
    "lines as Windows ends them": ("a.csv", b"t,x,y\r\n0,1.5,-2\r\n1,2.5,-3\r\n", {}),
    "quoted, with blanks before": ("a.csv", b'"t", "x", "y"\n0, "1.5", "-2"\n1, 2.5, -3\n', {}),
    "separators at the ends of rows": ("a.csv", b"t,x,y\n0,1.5,-2,,\n1,2.5,-3,, \n", {}),
    "and of some of them": ("a.csv", b"t,x,y\n0,1.5,-2\n1,2.5,-3, ,\n", {}),
    "separators at the ends of all lines": ("a.csv", b"t,x,y,,\n0,1.5,-2,,\n1,2.5,-3,,\n", {}),
    "empty lines": ("a.csv", b"t,x,y\n\n0,1.5,-2\n , ,\n1,2.5,-3\n\n", {}),
    "a line of units": ("a.csv", b"t,x,y\ns,mm,mm\n0,1.5,-2\n1,2.5,-3\n", {"header": 2, "names": 1}),
    "lines above": ("a.csv", b"arm 7\n\nt,x,y\n0,1.5,-2\n1,2.5,-3\n", {"header": 3}),
    "names between two lines": ("a.csv", b"arm 7\nt,x,y\ns,mm,mm\n0,1.5,-2\n1,2.5,-3\n", {"header": 3, "names": 2}),
    "a header as NumPy writes it": ("a.txt", b"# t x y\n0 1.5 -2\n1 2.5 -3\n", {}),
    "and with commas": ("a.csv", b"# t,x,y\n0,1.5,-2\n1,2.5,-3\n", {}),
    "no end of the last line": ("a.csv", b"t,x,y\n0,1.5,-2\n1,2.5,-3", {}),
}  # fmt: skip


@pytest.mark.parametrize(("name", "data", "form"), TEXTS.values(), ids=TEXTS)
def test_texts(tmp_path, name, data, form):
    (tmp_path / name).write_bytes(data)
    table = read_table(tmp_path / name, TextForm(**form), ["t", "x", 3], ["y"])
    assert [table.columns[key].tolist() for key in ("t", "x", 3)] == [[0, 1], [1.5, 2.5], [-2, -3]]
    assert [cell[:2] for cell in table.texts["y"]] == ["-2", "-3"]
    assert table.damage == []


def written(tmp_path, text: str, name: str = "a.csv"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def read(path, **form) -> Table:
    return read_table(path, TextForm(**form), [1, 2], [])


def refusal(path, numbers: list, texts: list | None = None, **form) -> str:
    with pytest.raises(InputError) as caught:
        read_table(path, TextForm(**form), numbers, texts or [])
    return str(caught.value).removeprefix(f"{path}: ")


@pytest.mark.parametrize("cell", ["", " ", "nan", "NaN", "NA", "n/a", "null", "None", "-", "?"])
def test_cells_that_say_nothing(tmp_path, cell):
    values = read(written(tmp_path, f"t,x\n0,1\n1,{cell}\n2,3\n")).columns[2]
    np.testing.assert_array_equal(values, [1, np.nan, 3])


@pytest.mark.parametrize("cell", ["--", "off", "1.5.2", "1;5"])
def test_cells_that_are_no_numbers(tmp_path, cell):
    line = refusal(written(tmp_path, f"t,x\n0,1\n\n1,{cell}\n"), [1, 2])
    assert line == f"line 4, column 2: found {cell!r}, expected a number"


def test_lines_of_text_between_blanks_count_from_one(tmp_path):
    assert refusal(written(tmp_path, "t x\n0 1\n1 off\n", "a.txt"), [1, 2]).startswith("line 3, column 2: ")


def test_lines_are_those_of_the_file(tmp_path):
    table = read(written(tmp_path, "arm\nt,x\n0,1\n\n1,2\n"), header=2)
    assert table.rows.tolist() == [3, 5]
    assert table.place(1, "x") == f"{tmp_path}/a.csv: line 5, column 'x'"


def test_a_quoted_cell_of_two_lines(tmp_path):
    table = read(written(tmp_path, 't,x,note\n0,1,"two\nlines"\n1,2,\n'))
    assert table.columns[2].tolist() == [1, 2]


@pytest.mark.parametrize("count", [columns.BLOCK - 1, columns.BLOCK, columns.BLOCK + 1, 2 * columns.BLOCK + 2])
def test_no_row_of_a_long_table_is_lost(tmp_path, count):
    """It is read a block at a time."""
    path = written(tmp_path, "t,x\n" + "".join(f"{row},{-row}\n" for row in range(count)))
    table = read_table(path, TextForm(), [1], ["x"])
    np.testing.assert_array_equal(table.columns[1], np.arange(count))
    np.testing.assert_array_equal(table.rows, np.arange(count) + 2)
    assert table.texts["x"] == [str(-row) for row in range(count)]
    assert table.damage == []


@pytest.mark.parametrize("rows", [3, columns.BLOCK, columns.BLOCK + 1])
def test_a_last_row_that_is_cut_off_is_left_out_and_said(tmp_path, rows):
    path = written(tmp_path, "t,x\n" + "0,1\n" * rows + "7")
    table = read(path)
    assert len(table.rows) == len(table.columns[2]) == rows
    assert table.damage == [f"line {rows + 2} is cut off, with 1 of 2 cells: left out"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("t,x\n0\n1,2\n", "line 2: found 1 cells, expected 2"),  # a first row is no last one
        ("t,x\n0,1\n1\n2,3\n", "line 3: found 1 cells, expected 2"),
        ("t,x\n0,1\n1,2,3\n", "line 3: found 3 cells, expected 2"),  # too long is not cut off
        ("t,x\n0\n", "line 2: found 1 cells, expected 2"),
    ],
)
def test_rows_of_another_length(tmp_path, text, line):
    assert refusal(written(tmp_path, text), [1]).startswith(line)


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ([3], ""),
        ([4], "line 1: found 3 columns, expected column 4 of session.yaml"),
        (["x"], "line 1: found column 'x' 2 times, expected its number from 1 in session.yaml"),
        (["y"], "line 1: found the columns t, x, x, expected 'y' of session.yaml"),
    ],
)
def test_names_and_numbers_of_columns(tmp_path, keys, line):
    path = written(tmp_path, "t,x,x\n0,1,2\n1,2,4\n")
    if line:
        assert refusal(path, keys).startswith(line)
    else:
        assert read_table(path, TextForm(), keys, []).columns[3].tolist() == [2, 4]


def test_labels_go_without_the_blanks_beside_them(tmp_path):
    assert read_table(written(tmp_path, "run\n a \n b\n"), TextForm(), [], ["run"]).texts["run"] == ["a", "b"]


# Parquet, npz and mat


def test_times_and_what_is_missing_in_parquet(tmp_path):
    stamps = np.array(["2026-03-14T14:15:33.120", "NaT"], "datetime64[ns]")
    pose = pa.FixedSizeListArray.from_arrays(pa.array([1.0, 2.0, 3.0, 4.0]), 2)
    columns = {"t": stamps, "n": pa.array([7, None]), "text": ["5", "n/a"], "word": ["n/a", None], "pose": pose}
    table = pa.table(columns | {"first": pose[:1].take(pa.array([0, None]))})
    pq.write_table(table, tmp_path / "a.parquet")
    keys = ["t", "n", "text", "word", "pose[1]", "pose[2]", "first[1]", "first[2]", 5]
    result = read_table(tmp_path / "a.parquet", TextForm(), keys, ["t"])
    right = [
        [1773497733.12, np.nan],
        [7, np.nan],
        [5, np.nan],
        [np.nan, np.nan],
        [1, 3],
        [2, 4],
        [1, np.nan],
        [2, np.nan],
        [1, 3],
    ]
    for key, values in zip(keys, right, strict=True):
        np.testing.assert_allclose(result.columns[key], values, rtol=1e-15, err_msg=str(key))
    assert result.texts["t"][0].startswith("2026-03-14T14:15:33.12")
    assert result.rows.tolist() == [1, 2]
    pq.write_table(pa.table({"x": ["1", "off"]}), tmp_path / "b.parquet")
    assert refusal(tmp_path / "b.parquet", ["x"]) == "row 2, column 'x': found 'off', expected a number"


ROW = np.arange(5.0)
# arrays, and of the columns that are read of them each with its numbers; those that there are not
ARRAYS = {
    "rows": ({"t": ROW, "pose": np.stack([ROW, 10 * ROW], 1)}, {"pose[2]": 10 * ROW, "t": ROW}, ["pose", "pose[0]"]),
    "columns": ({"t": ROW, "pose": np.stack([ROW, 10 * ROW])}, {"pose[1]": ROW, "pose[2]": 10 * ROW}, ["pose[3]"]),
    "of two equally frequent lengths the larger": ({"pose": np.stack([ROW, 10 * ROW])}, {"pose[2]": 10 * ROW}, []),
    "the most frequent length is that of time": (
        {"t": ROW, "x": 2 * ROW, "table": np.arange(9)}, {"x": 2 * ROW}, ["table"]),
    "axes of length 1": ({"t": ROW[:, None], "x": 2 * ROW[None]}, {"t": ROW, "x": 2 * ROW}, ["t[1]"]),
    "more axes": (
        {"act": np.arange(30).reshape(5, 2, 3)}, {"act[1,1]": 6 * ROW, "act[2,3]": 6 * ROW + 5}, ["act[0,0]"]),
    "whole numbers": ({"t": np.arange(5), "on": ROW > 2}, {"t": ROW, "on": [0, 0, 0, 1, 1]}, []),
    "one number": ({"t": ROW, "rate": np.array(100.0)}, {"t": ROW}, ["rate"]),
    "empty ones": ({"t": ROW, "a": np.zeros((0, 0)), "b": np.zeros(0)}, {"t": ROW}, ["a", "b"]),
    "text beside": ({"t": ROW, "who": np.array("me")}, {"t": ROW}, ["who"]),
}  # fmt: skip


@pytest.mark.parametrize("suffix", ["npz", "mat"])
@pytest.mark.parametrize(("arrays", "right", "none"), ARRAYS.values(), ids=ARRAYS)
def test_arrays(tmp_path, suffix, arrays, right, none):
    path = tmp_path / f"a.{suffix}"
    (np.savez if suffix == "npz" else lambda name, **content: savemat(name, content))(path, **arrays)
    names, _ = array_columns(path)
    table = read_table(path, TextForm(), list(right), [])
    for name, values in right.items():
        np.testing.assert_array_equal(table.columns[name], values, err_msg=name)
    assert not set(none) & set(names)


def test_a_structure_in_a_structure_of_matlab(tmp_path):
    savemat(tmp_path / "a.mat", {"run": {"time": ROW, "mocap": {"tip": np.stack([ROW, -ROW])}}})
    names, _ = array_columns(tmp_path / "a.mat")
    assert names == ["run.time", "run.mocap.tip[1]", "run.mocap.tip[2]"]
    np.testing.assert_array_equal(read_table(tmp_path / "a.mat", TextForm(), [3], []).columns[3], -ROW)


def test_objects_of_python_are_not_run(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.array([{"a": 1}, 2], dtype=object))
    assert "allow_pickle=False" in refusal(tmp_path / "a.npz", ["t"])


def test_only_what_is_wanted_has_to_be_numbers(tmp_path):
    np.savez(tmp_path / "a.npz", t=ROW, word=np.array(list("abcde")))
    assert read_table(tmp_path / "a.npz", TextForm(), ["t"], ["word"]).texts["word"] == list("abcde")
    line = refusal(tmp_path / "a.npz", ["t", "word"])
    assert re.fullmatch(r"row 1, column 'word': found 'a', expected a number", line), line


def test_durations_are_seconds(tmp_path):
    pq.write_table(pa.table({"t": np.array([0, 20, "NaT"], "timedelta64[ms]")}), tmp_path / "a.parquet")
    values = read_table(tmp_path / "a.parquet", TextForm(), ["t"], []).columns["t"]
    np.testing.assert_allclose(values, [0, 0.02, np.nan])


def test_the_line_of_a_byte_of_another_encoding_far_down(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"t,x,note\n" + b"0,1,fine\n" * 20_000 + b"0,1,20 \xb0C\n" + b"0,1,fine\n" * 9)
    assert refusal(tmp_path / "a.csv", [1]).startswith("line 20002: found bytes that are not utf-8")


def test_objects_of_python_beside_what_is_read(tmp_path):
    np.savez(tmp_path / "a.npz", t=ROW, meta=np.array({"rate": 100}, dtype=object))
    assert read_table(tmp_path / "a.npz", TextForm(), ["t"], []).columns["t"].tolist() == ROW.tolist()
    assert "expected 'meta' of session.yaml" in refusal(tmp_path / "a.npz", ["meta"])


def test_matrices_beside_what_is_read(tmp_path):
    time = np.arange(30.0)
    calibration = {name: np.eye(3) for name in "KRSQ"}
    np.savez(tmp_path / "a.npz", t=time, tip=np.stack([time, 2 * time, 3 * time], 1), **calibration)
    table = read_table(tmp_path / "a.npz", TextForm(), ["t", "tip[3]"], [])
    assert table.columns["tip[3]"].tolist() == (3 * time).tolist()


def test_structures_in_an_array_are_said(tmp_path):
    trials = np.empty((1, 2), dtype=[("time", object), ("tip", object)])
    trials[0, 0] = trials[0, 1] = (ROW, ROW)
    savemat(tmp_path / "a.mat", {"trials": trials})
    assert refusal(tmp_path / "a.mat", ["trials.time"]).startswith("found no arrays of numbers, expected some: of stru")
