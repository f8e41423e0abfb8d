"""Rows of small tables as poses and motors: times, turns, gaps, frames and trials, each worked out by hand."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from trunkline.errors import InputError
from trunkline.recordings.session.layout import TableLayout, TableTime
from trunkline.recordings.session.session import Session
from trunkline.recordings.session.source import LogSource
from trunkline.recordings.tables.source import TableReader

HALF = np.sqrt(0.5)
POSITION = ["x", "y", "z"]
TIP = {"tip": {"position": POSITION}}
ROWS = "t,x,y,z\n0,1,2,3\n0.5,2,3,4\n"


def session_of(tables: dict, trials: list[dict] | None = None, **more) -> Session:
    """Of one trial of a.csv, or of `trials`; time in the column t in s, and the tip's position in x, y and z."""
    tables = {"time": {"column": "t", "unit": "s"}, "bodies": TIP} | tables
    entries = [{"experiment": "motion", "split": "identify"} | trial for trial in trials or [{"file": "a.csv"}]]
    content = {"frame": {"up": [0, 0, 1]}, "base": {"position": [0, 0, 0]}, "tables": tables, "trials": entries}
    return Session.model_validate(content | more)


def sources(folder: Path, text: str, tables: dict, trials: list[dict] | None = None, **more) -> list[LogSource]:
    """What the trials of a.csv, with that text, give."""
    (folder / "a.csv").write_text(text)
    session = session_of(tables, trials, **more)
    reader = TableReader(folder, session)
    return [reader.open(trial) for trial in session.trials]


def read(folder: Path, text: str, tables: dict | None = None, **more) -> LogSource:
    (source,) = sources(folder, text, tables or {}, **more)
    return source


# when rows of t = 0, 0.5 (or as the case has it) were taken, ns; start is added
TIMES = {
    "s": ({"column": "t", "unit": "s"}, "0 0.5", [0, 500_000_000]),
    "ms": ({"column": "t", "unit": "ms"}, "10 500", [10_000_000, 500_000_000]),
    "us": ({"column": "t", "unit": "us"}, "10 500", [10_000, 500_000]),
    "ns": ({"column": "t", "unit": "ns"}, "10 500", [10, 500]),
    "min": ({"column": "t", "unit": "min"}, "0.5 2", [30_000_000_000, 120_000_000_000]),
    "to the nearest ns": ({"column": "t", "unit": "s"}, "0.1 0.7", [100_000_000, 700_000_000]),
    "start": ({"column": "t", "unit": "ms", "start": 2.5}, "10 500", [2_510_000_000, 3_000_000_000]),
    "start before": ({"column": "t", "unit": "s", "start": -2.5}, "0 0.5", [-2_500_000_000, -2_000_000_000]),
    "rate": ({"rate": 50}, "7 7", [0, 20_000_000]),
    "rate and start": ({"rate": 50, "start": 1}, "7 7", [1_000_000_000, 1_020_000_000]),
    "frames at a rate": ({"frames": "t", "rate": 200}, "100 102", [500_000_000, 510_000_000]),
    "date": (
        {"column": "t", "unit": "date"}, "1970-01-02T00:00:01.120 1970-01-02T00:00:03",
        [86_401_120_000_000, 86_403_000_000_000],
    ),
    "of a date the month before the day": (
        {"column": "t", "unit": "date"}, "1970-02-01T00:00:00 1970-02-01T00:00:01",
        [31 * 86_400_000_000_000, 31 * 86_400_000_000_000 + 1_000_000_000],
    ),
    "date in a time zone": (
        {"column": "t", "unit": "date"}, "1970-01-01T03:00:00+02:00 1970-01-01T01:00:01Z",
        [3_600_000_000_000, 3_601_000_000_000],
    ),
    "date and start": (
        {"column": "t", "unit": "date", "start": 1.5}, "1970-01-01T00:00:00 1970-01-01T00:00:01",
        [1_500_000_000, 2_500_000_000],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("time", "cells", "stamps"), TIMES.values(), ids=TIMES)
def test_times(tmp_path, time, cells, stamps):
    rows = "".join(f"{cell},{row},2,3\n" for row, cell in enumerate(cells.split()))
    source = read(tmp_path, f"t,x,y,z\n{rows}", {"time": time})
    assert source.poses.stamps.tolist() == source.poses.log_times.tolist() == stamps
    assert source.poses.stamps.dtype == np.int64
    assert source.log.count == 2


@pytest.mark.parametrize(
    ("time", "cells", "line"),
    [
        ({"column": "t", "unit": "s"}, ["0", ""], "line 3, column 't': found 'nan', expected a time in every row"),
        ({"column": "t", "unit": "min"}, ["0", "2e8"], "line 3, column 't': found '2e+08', expected a time before the"),
        ({"column": "t", "unit": "date"}, ["1970-01-01", "soon"], "line 3, column 't': found 'soon', expected a date"),
        ({"column": "t", "unit": "date"}, ["01.02.1970", "1970-01-01"], "line 2, column 't': found '01.02.1970', exp"),
        ({"frames": "t", "rate": 9}, ["0", ""], "line 3, column 't': found 'nan', expected a time in every row"),
        ({"frames": "x", "column": "t", "unit": "s"}, ["0,", "1,1"], "line 2, column 'x': found 'nan', expected a fr"),
    ],
)
def test_times_that_are_none(tmp_path, time, cells, line):
    rows = "".join(f"{cell if ',' in cell else f'{cell},1'},2,3\n" for cell in cells)
    with pytest.raises(InputError) as caught:
        read(tmp_path, f"t,x,y,z\n{rows}", {"time": time})
    assert str(caught.value).startswith(f"{tmp_path}/a.csv: {line}")


def test_a_line_that_is_refused_is_that_of_the_file_whichever_trial_it_is_of(tmp_path):
    text = "t,x,y,z,run\n0,1,2,3,a\n1,1,2,3,a\n0,1,2,3,b\n,1,2,3,b\n"
    with pytest.raises(InputError, match=r"a\.csv: line 5, column 't': found 'nan'"):
        sources(tmp_path, text, {"trial": "run"}, [{"file": "a.csv", "label": label} for label in "ab"])


def test_frame_numbers_beside_a_time(tmp_path):
    poses = read(tmp_path, "t,x,y,z,n\n0,1,2,3,7\n0.5,2,3,4,9\n",
                 {"time": {"column": "t", "unit": "s", "frames": "n"}}).poses  # fmt: skip
    assert (poses.frames.tolist(), poses.stamps.tolist()) == ([7, 9], [0, 500_000_000])
    assert read(tmp_path, ROWS).poses.frames is None


@pytest.mark.parametrize(("clock", "count"), [("stamp", 3), ("log", 4)])
def test_times_of_a_clock_that_is_not_set_are_left_out(tmp_path, clock, count):
    text = "t,x,y,z,u\n0,1,2,3,1\n1e6,1,2,4,2\n1000001,1,2,5,3\n1000002,1,2,6,4\n"
    source = read(tmp_path, text, {"commands": ["u"]}, clock=clock)
    assert (len(source.poses.stamps), len(source.commands.stamps)) == (count, count)


# turns


def turned(folder: Path, cells: str, tables: dict) -> list[float]:
    """The quaternion, w first and not below 0, of a row of a, b, c and d."""
    columns = ["a", "b", "c", "d"][: cells.count(",") + 1]
    key = "euler" if len(columns) == 3 else "quaternion"
    tables = {"bodies": {"tip": {"position": POSITION, key: columns}}} | tables
    text = f"t,x,y,z,{','.join(columns)}\n0,1,2,3,{cells}\n1,1,2,3,{cells}\n"
    quaternion = read(folder, text, tables).poses.quaternions[1, 0]
    return (quaternion * (-1 if quaternion[0] < 0 else 1)).tolist()


@pytest.mark.parametrize(("order", "right"), [("wxyz", [0.5, -0.1, 0.7, 0.5]), ("xyzw", [0.5, 0.5, -0.1, 0.7])])
def test_quaternions(tmp_path, order, right):
    np.testing.assert_allclose(turned(tmp_path, "0.5,-0.1,0.7,0.5", {"quaternion": order}), right)


# a quarter about the first axis, then one about the second
@pytest.mark.parametrize("unit", ["deg", "rad"])
@pytest.mark.parametrize(
    ("convention", "right"),
    [
        ("xyz", [0.5, 0.5, 0.5, -0.5]),  # q = j i = -k, of half angles (1 + j)(1 + i) / 2
        ("XYZ", [0.5, 0.5, 0.5, 0.5]),  # (1 + i)(1 + j) / 2, i j = k
        ("zyx", [0.5, 0.5, 0.5, 0.5]),  # (1 + j)(1 + k) / 2, j k = i
        ("ZYX", [0.5, -0.5, 0.5, 0.5]),  # (1 + k)(1 + j) / 2, k j = -i
    ],
)
def test_two_quarter_turns(tmp_path, convention, right, unit):
    quarter = 90 if unit == "deg" else np.pi / 2
    euler = {"euler": {"convention": convention, "unit": unit}}
    np.testing.assert_allclose(turned(tmp_path, f"{quarter},{quarter},0", euler), right, atol=1e-12)


@pytest.mark.parametrize(("unit", "right"), [("deg", [np.cos(np.pi / 360), np.sin(np.pi / 360), 0, 0]),
                                             ("rad", [np.cos(0.5), np.sin(0.5), 0, 0])])  # fmt: skip
def test_angles_of_one(tmp_path, unit, right):
    euler = {"euler": {"convention": "xyz", "unit": unit}}
    np.testing.assert_allclose(turned(tmp_path, "1,0,0", euler), right, atol=1e-12)


# gaps: rows of x, y, z, whether each is visible


@pytest.mark.parametrize(
    ("gaps", "cells", "visible"),
    [
        ([], "0,0,0", True),
        ([], "1,,3", False),
        ([0], "0,0,0", False),
        ([0], "0,2,0", True),
        ([-9999], "-9999,-9999,-9999", False),
        ([-9999], "1,-9999,3", False),
        ([-9999], "1,9999,3", True),
        ([0, -9999], "0,1,-9999", False),
        ([0, -9999], "0,-1,0", True),
    ],
)
def test_gaps_of_bodies(tmp_path, gaps, cells, visible):
    """What is no place has no orientation either."""
    tables = {"gaps": gaps, "bodies": {"tip": {"position": POSITION, "quaternion": list("abcd")}}, "quaternion": "wxyz"}
    poses = read(tmp_path, f"t,x,y,z,a,b,c,d\n0,1,1,1,1,0,0,0\n1,{cells},1,0,0,0\n", tables).poses
    assert poses.present[:, 0].tolist() == [True, visible]
    assert np.isfinite(poses.positions[1]).all() == np.isfinite(poses.quaternions[1]).all() == visible


def test_gaps_of_motors(tmp_path):
    """0 is where a motor may be; what one does not say another may."""
    text = "t,x,y,z,u,v\n0,1,2,3,0,0\n1,1,2,4,-9999,0\n2,1,2,5,,\n3,1,2,6,-9999,-9999\n4,1,2,7,5,6\n"
    commands = read(tmp_path, text, {"gaps": [0, -9999], "commands": {"m2": "v", "m1": "u"}}).commands
    assert commands.names == ("m2", "m1")
    assert commands.stamps.tolist() == [0, 1_000_000_000, 4_000_000_000]
    np.testing.assert_array_equal(commands.positions, [[0, 0], [0, np.nan], [6, 5]])
    np.testing.assert_array_equal(commands.sent, [[True, True], [True, False], [True, True]])


def test_columns_of_motors_and_constants(tmp_path):
    text = "t,x,y,z,u,v,w\n0,1,2,3,10,20,30\n1,1,2,4,11,21,31\n"
    source = read(tmp_path, text, {"commands": ["v", "u"], "tendon_positions": {"v": "w", "u": {"value": 0.5}}})
    assert source.commands.names == source.tendon_positions.names == ("v", "u")
    assert source.commands.positions.tolist() == [[20, 10], [21, 11]]
    assert source.tendon_positions.positions.tolist() == [[30, 0.5], [31, 0.5]]
    assert source.commands.topic == "columns v, u"
    assert source.tendon_positions.topic == "columns w, u (0.5)"


# frames

BOTH = {"base": {"position": ["X", "Y", "Z"], "quaternion": ["a", "b", "c", "d"]},
        "tip": {"position": POSITION, "quaternion": ["e", "f", "g", "h"]}}  # fmt: skip
HEAD = "t,X,Y,Z,a,b,c,d,x,y,z,e,f,g,h\n"
ABOUT_Z, ABOUT_X = f"{HALF},0,0,{HALF}", f"{HALF},{HALF},0,0"


def test_poses_relative_to_a_tracked_base(tmp_path):
    """The base at (10, 20, 30), a quarter about z: x of the base is y; then one about x: k' i' = j'."""
    rows = f"0,10,20,30,{ABOUT_Z},1,2,3,{ABOUT_X}\n1,,,,,,,,1,2,3,{ABOUT_X}\n2,10,20,30,{ABOUT_Z},1,2,4,1,0,0,0\n"
    layout = {"bodies": BOTH, "quaternion": "wxyz", "frame": "base"}
    poses = read(tmp_path, HEAD + rows, layout, base="base").poses
    assert poses.names == ("base", "tip")
    np.testing.assert_allclose(poses.positions[0], [[10, 20, 30], [8, 21, 33]], atol=1e-12)
    np.testing.assert_allclose(poses.quaternions[0], [[HALF, 0, 0, HALF], [0.5, 0.5, 0.5, 0.5]], atol=1e-12)
    assert np.isnan(poses.positions[1]).all()
    assert np.isnan(poses.quaternions[1]).all()
    np.testing.assert_allclose(poses.positions[2, 1], [8, 21, 34], atol=1e-12)


def test_poses_in_the_world_stay(tmp_path):
    rows = f"0,10,20,30,{ABOUT_Z},1,2,3,{ABOUT_X}\n1,,,,,,,,1,2,3,{ABOUT_X}\n"
    poses = read(tmp_path, HEAD + rows, {"bodies": BOTH, "quaternion": "wxyz"}, base="base").poses
    np.testing.assert_allclose(poses.positions[:, 1], [[1, 2, 3]] * 2)
    assert poses.present.tolist() == [[True, True], [False, True]]


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("mm", 1e-3), ("cm", 1e-2)])
def test_poses_relative_to_a_stated_base(tmp_path, unit, metres):
    """The base's place is in m, the table's in `unit`."""
    base = {"position": [0.5, 0, -0.25], "quaternion": [HALF, 0, 0, HALF]}
    poses = read(tmp_path, ROWS, {"frame": "base"}, base=base, frame={"up": [0, 0, 1], "unit": unit}).poses
    np.testing.assert_allclose(poses.positions[0, 0], [0.5 / metres - 2, 1, -0.25 / metres + 3])


# trials and files


def test_trials_of_one_file(tmp_path):
    """Labels that are numbers are compared as such; of a rate each trial begins at 0."""
    text = "run,x,y,z,u\n1.0,1,2,3,1\n1.0,1,2,4,2\nb,1,2,5,3\n02,1,2,6,4\n02,1,2,7,5\n1,1,2,8,6\n"
    trials = [{"file": "a.csv", "label": label} for label in (2, "b", 1)]
    tables = {"time": {"rate": 10}, "trial": "run", "commands": ["u"]}
    two, b, last = sources(tmp_path, text, tables, trials)
    assert [source.poses.positions[:, 0, 2].tolist() for source in (two, b, last)] == [[6, 7], [5], [3, 4, 8]]
    assert [source.commands.positions[:, 0].tolist() for source in (two, b, last)] == [[4, 5], [3], [1, 2, 6]]
    assert [source.poses.stamps.tolist() for source in (two, b)] == [[0, 100_000_000], [0]]
    assert [source.log.count for source in (two, b, last)] == [2, 1, 3]


def test_a_trial_without_a_label_goes_by_its_name(tmp_path):
    text = "run,t,x,y,z\na,0,1,2,3\nb,1,1,2,4\n"
    trials = [{"file": "a.csv", "name": name} for name in ("b", "a")]
    b, a = sources(tmp_path, text, {"trial": "run"}, trials)
    assert [source.poses.positions[0, 0, 2] for source in (b, a)] == [4, 3]


def test_one_file_that_two_trials_read_otherwise(tmp_path):
    trials = [{"file": "a.csv", "name": "whole"}, {"file": "a.csv", "name": "less", "table": {"header": 2, "names": 1}}]
    whole, less = sources(tmp_path, ROWS, {}, trials)
    assert (len(whole.poses.stamps), len(less.poses.stamps)) == (2, 1)


def motors(folder: Path, count: int, declared: dict | None = None, times: str = "") -> LogSource:
    """Four rows of poses of two trials, the second's source; motors of `count` rows in a file of their own."""
    head = "ms,u\n" if times else "u\n"
    stamps = times.split() or [""] * count
    rows = "".join(f"{stamp},{row}\n" if times else f"{row}\n" for row, stamp in enumerate(stamps))
    (folder / "motors.csv").write_text(head + rows)
    poses = "run,t,x,y,z\na,0,1,2,3\na,1,1,2,4\nb,2,1,2,5\nb,3,1,2,6\n"
    tables = {"trial": "run", "commands": ["u"], "motors_file": {"file": "motors.csv"} | (declared or {})}
    trials = [{"file": "a.csv", "label": label} for label in "ab"]
    return sources(folder, poses, tables, trials)[1]


@pytest.mark.parametrize(("count", "commands"), [(4, [2, 3]), (5, [2, 3]), (3, [2]), (2, [])])
def test_motors_row_by_row_with_the_poses_of_the_trial(tmp_path, count, commands):
    source = motors(tmp_path, count)
    assert source.commands.positions[:, 0].tolist() == commands
    assert source.commands.stamps.tolist() == [2_000_000_000, 3_000_000_000][: len(commands)]
    assert source.poses.positions[:, 0, 2].tolist() == [5, 6]
    note = f"{count} rows of motors.csv and 4 of a.csv put side by side from the first on"
    assert source.poses.notes == ([] if count == 4 else [note])


def test_motors_by_times_of_their_own(tmp_path):
    """At another rate, of all trials; `start` puts them on the poses' clock."""
    time = {"time": {"column": "ms", "unit": "ms", "start": 2}}
    source = motors(tmp_path, 0, time, times="-1000 -500 0 250 500 750")
    assert source.commands.positions[:, 0].tolist() == [0, 1, 2, 3, 4, 5]
    assert (source.commands.stamps / 1e9).tolist() == [1, 1.5, 2, 2.25, 2.5, 2.75]
    assert source.poses.notes == []


def test_what_either_file_lost_is_said(tmp_path):
    (tmp_path / "motors.csv").write_text("u,v\n1,1\n2,1\n3")
    tables = {"commands": ["u", "v"], "motors_file": {"file": "motors.csv"}}
    source = read(tmp_path, ROWS + "1,2\n", tables)
    assert source.log.damage == [f"line 4 is cut off, with {count} of {width} cells: left out"
                                 for count, width in ((2, 4), (1, 2))]  # fmt: skip


# whether a row is a frame: of poses (x, y, z) and of a motor (u)
SEEN, HIDDEN = "1,2,3", ",,"


@pytest.mark.parametrize(
    ("rows", "times"),
    [
        ([f"{SEEN},", f"{HIDDEN},5", "4,5,6,"], [0, 2]),  # two writers
        ([f"{SEEN},5", f"{HIDDEN},6", "4,5,6,7"], [0, 1, 2]),  # one, with a gap
        ([f"{SEEN},", f"{HIDDEN},", f"{HIDDEN},5", "4,5,6,"], [0, 1, 3]),  # two, with a gap
        ([f"{SEEN},", f"{HIDDEN},", "4,5,6,"], [0, 1, 2]),
    ],
)
def test_rows_of_motors_are_no_frames_and_gaps_are(tmp_path, rows, times):
    text = "t,x,y,z,u\n" + "".join(f"{time},{row}\n" for time, row in enumerate(rows))
    poses = read(tmp_path, text, {"commands": ["u"]}).poses
    assert (poses.stamps // 1_000_000_000).tolist() == times


# declarations


@pytest.mark.parametrize(
    ("time", "problem"),
    [
        ({"rate": 0}, "greater than 0"),
        ({"rate": 2e6}, "less than or equal to 1000000"),
        ({"rate": 9, "unit": "s"}, "found 's' beside `rate`"),
        ({"frames": "n", "column": "t"}, "unit: missing"),
    ],
)
def test_times_that_are_not_declared_so(time, problem):
    with pytest.raises(ValidationError, match=problem):
        TableTime.model_validate(time)


@pytest.mark.parametrize("convention", ["xyz", "zxz", "ZYX", "XYX"])
def test_conventions(convention):
    euler = {"convention": convention, "unit": "deg"}
    assert TableLayout(time={"rate": 1}, bodies=TIP, euler=euler).euler.convention == convention


@pytest.mark.parametrize("convention", ["xxy", "yzz", "XXY", "xYz", "xy", "xyzx", "abc", ""])
def test_conventions_that_are_none(convention):
    with pytest.raises(ValidationError, match="expected SciPy's three letters"):
        TableLayout(time={"rate": 1}, bodies=TIP, euler={"convention": convention, "unit": "deg"})


def test_names_may_be_any_line_of_the_header():
    assert TableLayout(time={"rate": 1}, bodies=TIP, header=2, names=2).names == 2
    with pytest.raises(ValidationError, match="found 3, expected a line of the header, which has 2"):
        TableLayout(time={"rate": 1}, bodies=TIP, header=2, names=3)


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"separator": ",", "decimal": ","}, "found ',' beside the separator ','"),
        ({"bodies": {"tip": {"position": ["x", "y", "x"]}}}, "found the column 'x' twice"),
        ({"bodies": {"tip": {"position": POSITION, "quaternion": [1, 2, 3, 1]}}, "quaternion": "wxyz"}, "1 twice"),
        ({"bodies": {"tip": {"position": POSITION, "euler": ["a", "b"]}}}, "found 2 columns, expected 3"),
    ],
)
def test_columns_and_commas_that_are_not_declared_so(keys, problem):
    with pytest.raises(ValidationError, match=problem):
        TableLayout.model_validate({"time": {"rate": 1}, "bodies": TIP} | keys)


def test_dates_of_parquet(tmp_path):
    """As dates, or as numbers of s."""
    frame = pd.DataFrame(dict(zip(POSITION, [[1.0, 2.0]] * 3, strict=True)))
    frame["t"] = np.array([1500, 2000]).astype("datetime64[ms]")
    frame.to_parquet(tmp_path / "a.parquet")
    for unit in ("date", "s"):
        session = session_of({"time": {"column": "t", "unit": unit}}, [{"file": "a.parquet"}])
        poses = TableReader(tmp_path, session).open(session.trials[0]).poses
        assert poses.stamps.tolist() == [1_500_000_000, 2_000_000_000]
