"""The same session as logs and as tables of every kind gives the same raw trials."""

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from tests.recordings.tables.lab_table import (
    assert_equal,
    columns_of,
    layout_of,
    logged,
    measured,
    raw_trials,
    trial_of,
    write_declared,
    write_text,
)

CURL, RELEASE = measured()


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    return logged(tmp_path_factory.mktemp("logs") / "session")


def test_the_session_has_what_tables_must_keep(right):
    """Gaps in some bodies, motion, pulls."""
    raw = right["curl_40"]
    assert 0 < np.isnan(raw.positions).mean() < 0.3
    assert np.ptp(raw.commands) > 0.03


TEXTS = {
    "comma": ({}, {}),
    "semicolon": ({"separator": ";"}, {"separator": ";"}),
    "tab": ({"separator": "\t"}, {"separator": "tab"}),
    "blanks": ({"separator": "   ", "blank": "NaN"}, {"separator": "blanks"}),
    "decimal comma": ({"separator": ";", "decimal": ","}, {"separator": ";", "decimal": ","}),
    "decimal comma and tabs": ({"separator": "\t", "decimal": ","}, {"separator": "tab", "decimal": ","}),
    "UTF-8 with mark": ({"encoding": "utf-8-sig"}, {}),
    "UTF-16": ({"encoding": "utf-16"}, {"encoding": "utf-16"}),
    "UTF-16 without mark": ({"encoding": "utf-16-le"}, {"encoding": "utf-16"}),
    "Latin-1": ({"encoding": "latin-1", "above": ["Prüfstand, 20 °C"]}, {"encoding": "latin-1", "header": 2}),
    "header of three lines": ({"above": ["arm 7", "cell, by, cell"]}, {"header": 3}),
    "units under the names": ({"below": ["units follow"]}, {"header": 2, "names": 1}),
    "NaN in words": ({"blank": "NaN"}, {}),
    "NA": ({"blank": "n/a"}, {}),
}


@pytest.mark.parametrize(("form", "declared"), TEXTS.values(), ids=TEXTS)
def test_texts(tmp_path, right, form, declared):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL), **form)
    write_declared(tmp_path, layout_of(CURL) | declared, [trial_of(CURL)])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


def test_no_header(tmp_path, right):
    """Columns by number."""
    columns = columns_of(CURL)
    write_text(tmp_path / "curl_40.csv", columns, names=False)
    names = list(columns)
    layout = layout_of(CURL)
    layout |= {"header": 0, "time": {"column": 1, "unit": "s"}}
    for body in layout["bodies"].values():
        body |= {key: [names.index(name) + 1 for name in body[key]] for key in body}
    for key in ("commands", "tendon_positions"):
        layout[key] = {motor: names.index(name) + 1 for motor, name in layout[key].items()}
    write_declared(tmp_path, layout, [trial_of(CURL)])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


def test_parquet(tmp_path, right):
    pd.DataFrame(columns_of(CURL)).to_parquet(tmp_path / "curl_40.parquet")
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL, file="curl_40.parquet")])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


@pytest.mark.parametrize("unit", ["date", "s"])
def test_parquet_with_dates(tmp_path, right, unit):
    frame = pd.DataFrame(columns_of(CURL)).assign(t=pd.to_datetime(CURL.stamps))
    frame.to_parquet(tmp_path / "curl_40.parquet")
    time = {"column": "t", "unit": unit}
    write_declared(tmp_path, layout_of(CURL) | {"time": time}, [trial_of(CURL, file="curl_40.parquet")])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


def in_arrays(where=""):
    """(arrays, the layout that reads them): poses (T, 7) of each body, motors (T, K)."""
    columns, layout, arrays = columns_of(CURL), layout_of(CURL), {}
    arrays["t"] = columns["t"]
    for name, body in layout["bodies"].items():
        arrays[name] = np.stack([columns[key] for key in [*body["position"], *body["quaternion"]]], axis=1)
        body["position"] = [f"{where}{name}[{place}]" for place in (1, 2, 3)]
        body["quaternion"] = [f"{where}{name}[{place}]" for place in (4, 5, 6, 7)]
    for key in ("commands", "tendon_positions"):
        arrays[key] = np.stack([columns[name] for name in layout[key].values()], axis=1)
        layout[key] = {motor: f"{where}{key}[{place}]" for place, motor in enumerate(layout[key], 1)}
    layout["time"]["column"] = f"{where}t"
    return arrays, layout


def test_npz(tmp_path, right):
    arrays, layout = in_arrays()
    np.savez(tmp_path / "curl_40.npz", note=np.array("with a note"), **arrays)
    write_declared(tmp_path, layout, [trial_of(CURL, file="curl_40.npz")])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


@pytest.mark.parametrize("turned", [False, True], ids=["rows", "columns"])
def test_mat(tmp_path, right, turned):
    """A structure, as MATLAB's users save it; time along either axis."""
    arrays, layout = in_arrays("run.")
    savemat(tmp_path / "curl_40.mat", {"run": {name: array.T if turned else array for name, array in arrays.items()}})
    write_declared(tmp_path, layout, [trial_of(CURL, file="curl_40.mat")])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


@pytest.mark.parametrize(("unit", "number"), [("mm", 1000.0), ("cm", 100.0)])
def test_units(tmp_path, right, unit, number):
    write_text(tmp_path / "curl_40.csv", columns_of(CURL, number))
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)], frame={"up": [0, 1, 0], "unit": unit})
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


def test_pulls_in_the_unit_that_motors_have(tmp_path, right):
    columns = columns_of(CURL)
    motors = [name for name in columns if name[:4] in ("cmd_", "pos_")]
    write_text(tmp_path / "curl_40.csv", columns | {name: np.degrees(columns[name] / 0.02) for name in motors})
    motors = {tendon: {"unit": "deg", "spool_radius": 0.02, "tendons": {tendon: 1}} for tendon in CURL.tendons}
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)], motors=motors)
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


def test_quaternions_with_w_last(tmp_path, right):
    layout = layout_of(CURL) | {"quaternion": "xyzw"}
    for name, body in layout["bodies"].items():
        body["quaternion"] = [f"{name}_q{axis}" for axis in "xyzw"]
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    write_declared(tmp_path, layout, [trial_of(CURL)])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


@pytest.mark.parametrize("unit", ["deg", "rad"])
@pytest.mark.parametrize("convention", ["xyz", "XYZ", "ZYX", "zxz"])
def test_euler_angles(tmp_path, right, convention, unit):
    columns, layout = columns_of(CURL), layout_of(CURL)
    for name, body in layout["bodies"].items():
        quaternions = np.stack([columns.pop(key) for key in body.pop("quaternion")], axis=1)
        good = np.isfinite(quaternions[:, 0])
        angles = np.full((len(good), 3), np.nan)
        turns = Rotation.from_quat(quaternions[good], scalar_first=True)
        angles[good] = turns.as_euler(convention, degrees=unit == "deg")
        body["euler"] = [f"{name}_{angle}" for angle in "abc"]
        columns |= dict(zip(body["euler"], angles.T, strict=True))
    layout |= {"euler": {"convention": convention, "unit": unit}}
    write_text(tmp_path / "curl_40.csv", columns)
    write_declared(tmp_path, layout, [trial_of(CURL)])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


@pytest.mark.parametrize("value", [0.0, -9999.0])
def test_numbers_that_stand_for_gaps(tmp_path, right, value):
    """Commands that are 0 are none."""
    columns = {name: np.where(np.isnan(values), value, values) for name, values in columns_of(CURL).items()}
    write_text(tmp_path / "curl_40.csv", columns)
    write_declared(tmp_path, layout_of(CURL) | {"gaps": [value]}, [trial_of(CURL)])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


def test_a_coordinate_of_zero_is_no_gap_and_a_motor_s_sentinel_is(tmp_path, right):
    columns = columns_of(CURL)
    columns["unit_02_x"][7] = 0.0
    columns["cmd_1"][9], columns["cmd_2"][9], columns["cmd_3"][9] = -9999, -9999, -9999
    write_text(tmp_path / "curl_40.csv", columns)
    write_declared(tmp_path, layout_of(CURL) | {"gaps": [0, -9999]}, [trial_of(CURL)])
    raw = raw_trials(tmp_path)["curl_40"]
    assert raw.positions[7, 0, 0] == 0
    assert len(raw.command_time) == len(right["curl_40"].command_time) - 1


def test_a_column_that_names_the_trial(tmp_path, right):
    rows = [columns_of(CURL), columns_of(RELEASE) | {f"{kind}_{i}": np.zeros(len(RELEASE.stamps))
            for i in (1, 2, 3) for kind in ("cmd", "pos")}]  # fmt: skip
    whole = {name: np.concatenate([some[name] for some in rows]) for name in rows[0]}
    whole |= {"run": ["a"] * len(CURL.stamps) + ["7.0"] * len(RELEASE.stamps)}
    write_text(tmp_path / "all.csv", whole)
    trials = [trial_of(CURL, file="all.csv", label="a"), trial_of(RELEASE, file="all.csv", label=7)]
    write_declared(tmp_path, layout_of(CURL) | {"trial": "run"}, trials)
    raw = raw_trials(tmp_path)
    assert_equal(raw["curl_40"], right["curl_40"])
    np.testing.assert_allclose(raw["release_a"].positions, right["release_a"].positions, atol=1e-6)


def test_windows_of_a_file(tmp_path, right):
    """As of a log: s from its first pose."""
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    trials = [trial_of(CURL, window=[0.0, 1.2]), trial_of(CURL, name="later", window=[1.3, 2.4], split="validate")]
    write_declared(tmp_path, layout_of(CURL), trials)
    raw = raw_trials(tmp_path)
    whole = right["curl_40"]
    for name, (begin, end) in (("curl_40", (0.0, 1.2)), ("later", (1.3, 2.4))):
        inside = (whole.time >= begin) & (whole.time <= end)
        np.testing.assert_allclose(raw[name].positions, whole.positions[inside], atol=1e-6)
        np.testing.assert_allclose(raw[name].time, whole.time[inside] - whole.time[inside][0], atol=1e-6)


TIMES = {
    "rate": lambda m: ({}, {"rate": 120}),
    "frames": lambda m: ({"frame": m.frames + 7.0}, {"frames": "frame", "rate": 120}),
    "milliseconds": lambda m: ({"t": 1e-6 * (m.stamps - m.stamps[0])}, {"column": "t", "unit": "ms"}),
    "nanoseconds since 1970": lambda m: ({"t": m.stamps.astype(float)}, {"column": "t", "unit": "ns"}),
    "start": lambda m: ({}, {"column": "t", "unit": "s", "start": -1000}),
    "dates": lambda m: ({"t": m.stamps.astype("datetime64[ns]").astype(str).tolist()}, {"column": "t", "unit": "date"}),
}


@pytest.mark.parametrize("case", TIMES.values(), ids=TIMES)
def test_times(tmp_path, right, case):
    changed, time = case(CURL)
    columns = columns_of(CURL) | changed
    if "column" not in time:
        columns.pop("t")
    write_text(tmp_path / "curl_40.csv", columns)
    write_declared(tmp_path, layout_of(CURL) | {"time": time}, [trial_of(CURL)])
    assert_equal(raw_trials(tmp_path)["curl_40"], right["curl_40"])


@pytest.mark.parametrize("fixed", [False, True], ids=["tracked", "stated"])
def test_poses_relative_to_the_base(tmp_path, right, fixed):
    columns, layout = columns_of(RELEASE), layout_of(RELEASE) | {"frame": "base"}
    base_q = RELEASE.quaternions[:, 0]
    place = RELEASE.positions[:, 0]
    if fixed:
        base_q, place = np.tile(base_q[0], (len(base_q), 1)), np.tile(place[0], (len(place), 1))
    good = np.isfinite(base_q[:, 0])
    back = Rotation.from_quat(base_q[good], scalar_first=True).inv()
    for number, name in enumerate(RELEASE.bodies[1:], 1):
        local = np.full(place.shape, np.nan)
        local[good] = back.apply(RELEASE.positions[good, number] - place[good])
        turned = np.full(base_q.shape, np.nan)
        both = good & np.isfinite(RELEASE.quaternions[:, number, 0])
        alike = Rotation.from_quat(base_q[both], scalar_first=True).inv()
        turned[both] = (alike * Rotation.from_quat(RELEASE.quaternions[both, number], scalar_first=True)).as_quat(
            scalar_first=True)  # fmt: skip
        columns |= {f"{name}_{axis}": local[:, i] for i, axis in enumerate("xyz")}
        columns |= {f"{name}_q{axis}": turned[:, i] for i, axis in enumerate("wxyz")}
    write_text(tmp_path / "release_a.csv", columns)
    more = {}
    if fixed:
        layout["bodies"].pop("base")
        more["base"] = {"position": place[0].tolist(), "quaternion": base_q[0].tolist()}
    write_declared(tmp_path, layout, [trial_of(RELEASE)], **more)
    raw = raw_trials(tmp_path)["release_a"]
    here = np.isfinite(right["release_a"].base_positions[:, 0])
    np.testing.assert_allclose(raw.positions[here], right["release_a"].positions[here], atol=1e-6)
    np.testing.assert_allclose(np.abs(raw.quaternions[here]), np.abs(right["release_a"].quaternions[here]), atol=1e-6)


@pytest.mark.parametrize("timed", [False, True], ids=["row by row", "with times"])
def test_motors_in_a_file_of_their_own(tmp_path, right, timed):
    columns = columns_of(CURL)
    motors = {name: columns.pop(name) for name in list(columns) if name[:4] in ("cmd_", "pos_")}
    write_text(tmp_path / "curl_40.csv", columns)
    write_text(tmp_path / "motors.txt", ({"ms": 1e3 * columns["t"] - 5000} if timed else {}) | motors, separator=" ")
    time = {"time": {"column": "ms", "unit": "ms", "start": 5}} if timed else {}
    write_declared(tmp_path, layout_of(CURL) | {"motors_file": {"file": "motors.txt"} | time}, [trial_of(CURL)])
    session_trials = raw_trials(tmp_path)
    assert_equal(session_trials["curl_40"], right["curl_40"])


def test_rows_of_motors_between_those_of_poses(tmp_path, right):
    """One writer for both, each with its times: a row without a pose is no frame in which nothing was seen."""
    columns = columns_of(CURL)
    motors = [name for name in columns if name[:4] in ("cmd_", "pos_")]
    both = {}
    for name, values in columns.items():
        twice = np.repeat(values, 2)
        if name != "t":
            twice[1 if name not in motors else 0 :: 2] = np.nan
        both[name] = twice
    both["t"][1::2] += 0.001
    write_text(tmp_path / "curl_40.csv", both)
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL)])
    raw = raw_trials(tmp_path)["curl_40"]
    np.testing.assert_allclose(raw.positions, right["curl_40"].positions, atol=1e-6)
    np.testing.assert_allclose(raw.command_time, right["curl_40"].command_time + 0.001, atol=1e-6)


def test_a_trial_whose_file_is_otherwise(tmp_path, right):
    """`table` of the trial says what differs; a constant is a command throughout."""
    write_text(tmp_path / "curl_40.csv", columns_of(CURL))
    columns = columns_of(RELEASE)
    columns["seconds"] = columns.pop("t")
    write_text(tmp_path / "release_a.csv", columns, separator=";")
    table = {"separator": ";", "time": {"column": "seconds", "unit": "s"}, "tendon_positions": None}
    table["commands"] = {name: {"value": 0.01} for name in CURL.tendons}
    write_declared(tmp_path, layout_of(CURL), [trial_of(CURL), trial_of(RELEASE, table=table)])
    raw = raw_trials(tmp_path)
    assert_equal(raw["curl_40"], right["curl_40"])
    np.testing.assert_allclose(raw["release_a"].positions, right["release_a"].positions, atol=1e-6)
    assert (raw["release_a"].commands == 0.01).all()


def test_logs_and_tables_in_a_session(tmp_path, right):
    folder = tmp_path / "session"
    logged(folder)
    write_text(folder / "curl_again.csv", columns_of(CURL))
    trials = [trial_of(RELEASE, file="release_a.mcap"), trial_of(CURL, file="curl_again.csv")]
    write_declared(folder, layout_of(CURL), trials)
    raw = raw_trials(folder)
    assert_equal(raw["curl_40"], right["curl_40"])
    assert raw["release_a"].positions.shape == right["release_a"].positions.shape


def test_a_table_is_read_once_and_only_columns_that_are_named_stay(tmp_path, monkeypatch):
    from trunkline.recordings.tables import source

    reads = []
    read = source.read_table
    monkeypatch.setattr(source, "read_table", lambda *some: reads.append(read(*some)) or reads[-1])
    columns = columns_of(CURL)
    write_text(tmp_path / "curl_40.csv", columns | {"force": np.zeros(len(CURL.stamps))})
    trials = [trial_of(CURL, name=name, window=[begin, begin + 0.7]) for begin, name in ((0, "a"), (0.8, "b"))]
    write_declared(tmp_path, layout_of(CURL), trials)
    raw_trials(tmp_path)
    (table,) = reads
    assert set(table.columns) == set(columns) - {"frame"}
