"""Rows of one table as trials, some of them drawn."""

from pathlib import Path

import numpy as np
import pytest

from tests.recordings.tables.lab_table import raw_trials, write_declared, write_text
from trunkline.errors import InputError
from trunkline.recordings.session.session import Session, read_session

ROWS, EVERY = 120, 2.0  # poses at rest, s from one to the next
PATH = {"file": "poses.csv", "experiment": "static_path"}
TABLES = {
    "time": {"column": "t", "unit": "s"},
    "bodies": {name: {"position": [f"{name}_{axis}" for axis in "xyz"]} for name in ("a", "b")},
    "commands": {"tendon_1": "pull"},
}
SHARES = [
    PATH | {"name": "drawn", "rows": {"last": 60, "draw": 20, "seed": 3}, "split": "identify"},
    PATH | {"name": "others", "rows": {"last": 60, "without": ["drawn"]}, "split": "validate"},
    PATH | {"name": "end", "rows": {"first": 61, "last": ROWS}, "split": "test"},
]


def columns() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    ways = np.cumsum(rng.normal(0, 0.002, (ROWS, 3)), axis=0)
    places = {"a": [0, 0.1, 0] + 0.5 * ways, "b": [0, 0.2, 0] + ways}
    at = {f"{name}_{axis}": place[:, i] for name, place in places.items() for i, axis in enumerate("xyz")}
    return {"t": EVERY * np.arange(ROWS), **at, "pull": 0.001 * np.arange(ROWS)}


def written(folder: Path, trials: list[dict], some: dict[str, np.ndarray] | None = None) -> Path:
    write_text(folder / "poses.csv", some or columns())
    base = {"position": [0, 0, 0], "quaternion": [1, 1, 0, 0]}
    write_declared(folder, TABLES, trials, base=base, tendons={"tendon_1": "tendon_1"})
    return folder


def test_rows_are_poses_with_their_commands(tmp_path):
    folder = written(tmp_path, SHARES)
    raw, there = raw_trials(folder), columns()
    chosen = {trial.name: np.array(trial.chosen) for trial in read_session(folder).trials}
    assert {name: len(rows) for name, rows in chosen.items()} == {"drawn": 20, "others": 40, "end": 60}
    assert sorted([*chosen["drawn"], *chosen["others"], *chosen["end"]]) == list(range(1, ROWS + 1))
    for name, rows in chosen.items():
        np.testing.assert_allclose(raw[name].positions[:, 1, 0], there["b_x"][rows - 1])
        last = np.searchsorted(raw[name].command_time, raw[name].time + 1e-6, side="right") - 1
        np.testing.assert_allclose(raw[name].commands[last, 0], there["pull"][rows - 1])


def test_a_seed_draws_the_same_rows_and_another_does_not(tmp_path):
    again = [trial | {"name": f"{trial['name']}_again"} for trial in SHARES[:1]]
    other = [trial | {"name": "other", "rows": trial["rows"] | {"seed": 4}} for trial in SHARES[:1]]
    first, same, another = (
        trial.chosen for trial in read_session(written(tmp_path, [*SHARES[:1], *again, *other])).trials
    )
    assert first == same
    assert first != another


def test_what_repeats_the_row_before_is_dropped_though_few_of_it_are_drawn(tmp_path):
    some = columns()
    for axis in "xyz":
        some[f"b_{axis}"][30:50] = some[f"b_{axis}"][30]
    folder = written(tmp_path, SHARES, some)
    raw = raw_trials(folder)["drawn"]
    rows = np.array(read_session(folder).trials[0].chosen)
    stale = (rows > 31) & (rows <= 50)  # the first of them was measured
    assert 0 < stale.sum() < 20
    np.testing.assert_array_equal(np.isnan(raw.positions[:, 1, 0]), stale)
    assert not np.isnan(raw.positions[:, 0]).any()


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ({"first": 9, "last": 8}, "last: found 8, expected no row before `first`, 9"),
        ({"last": 9, "draw": 3}, "seed: missing, expected both"),
        ({"last": 9, "seed": 3}, "draw: missing, expected both"),
        ({"last": 9, "draw": 10, "seed": 1}, "draw: found 10, expected at most the 9 rows that are left"),
        ({"last": 9, "without": ["end"]}, "without: found 'end', expected a trial with `rows` above"),
        ({"last": ROWS + 1}, f"rows.last: found row {ROWS + 1}, expected one of the {ROWS} below the header"),
    ],
)
def test_rows_that_cannot_be(tmp_path, rows, expected):
    folder = written(tmp_path, [PATH | {"name": "some", "rows": rows, "split": "identify"}])
    with pytest.raises(InputError, match=expected.replace("`", ".")):
        raise next(raw for raw in raw_trials(folder).values() if isinstance(raw, InputError))


def test_a_row_in_two_splits_is_refused(tmp_path):
    trials = [SHARES[0], SHARES[1] | {"rows": {"last": 60}}]
    with pytest.raises(InputError, match="share data"):
        read_session(written(tmp_path, trials))


def test_only_poses_at_rest_are_taken_by_rows():
    content = {"frame": {"up": [0, 1, 0]}, "base": "a", "tables": TABLES}
    trial = SHARES[2] | {"experiment": "motion"}
    with pytest.raises(ValueError, match="found it of a motion, expected `window`"):
        Session.model_validate(content | {"trials": [trial]})
