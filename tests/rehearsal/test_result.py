"""Rates with their intervals, and a table that is resumed."""

import numpy as np
import pytest

from rehearsal.experiments.follow import Path as Way
from rehearsal.experiments.result import COLUMNS, Result, append_result, causes, rate, read_results, summary
from trunkline.ar.hybrid.rates import wilson
from trunkline.errors import InputError
from upkeep.rehearsal_table import rehearsal_table


def runs(successes: int, failures: int) -> list[Result]:
    failed = [Result("reach", 100 + seed, False, "aim: beside it") for seed in range(failures)]
    return [Result("reach", seed, True) for seed in range(successes)] + failed


def test_the_interval_is_wilsons():
    assert rate(runs(18, 2)) == (0.9, *wilson(18, 20))


def test_causes_are_counted_by_their_kind():
    assert causes([*runs(3, 2), Result("reach", 9, False, "missed: by little")]) == {"aim": 2, "missed": 1}


def test_rows_are_read_back(tmp_path):
    file, first = tmp_path / "out/runs.csv", Result("reach", 3, False, "aim: beside, it", 2, 12.25, package="abc")
    assert read_results(file) == []
    append_result(file, first)
    append_result(file, Result("follow", 4, True))
    rows = read_results(file)
    assert [(row.experiment, row.seed, row.success, row.cause, row.plans) for row in rows] == [
        ("reach", 3, False, "aim: beside, it", 2), ("follow", 4, True, "", 0)
    ]  # fmt: skip
    assert rows[0].aimed_mm == pytest.approx(12.25, abs=0.1)
    assert np.isnan(rows[1].aimed_mm)


def test_kinds_of_objects_are_told_apart_where_there_are_several(tmp_path):
    mixed = [Result("grasp", seed, seed > 1, object="ab"[seed % 2]) for seed in range(6)]
    table_rows = summary([*mixed, *runs(2, 1)])
    assert {kind: (entry["runs"], entry["successes"]) for kind, entry in table_rows["grasp"]["objects"].items()} == {
        "a": (3, 2), "b": (3, 2)
    }  # fmt: skip
    assert table_rows["grasp"]["runs"] == 6
    assert "objects" not in table_rows["reach"]
    table = rehearsal_table(table_rows, {}, "of a test", variants=True)
    assert [line.split(" | ")[0] for line in table.splitlines()[2:]] == ["| reach", "| grasp", "| … a", "| … b"]


def test_a_row_is_added_to_a_table_of_fewer_columns_without_a_change_of_its_others(tmp_path):
    """A column that is new has its default in older rows; what they have stays, digit by digit."""
    file, old = tmp_path / "runs.csv", "experiment,seed,success,nearest_mm,package\nreach,3,False,12.25,abc\n"
    file.write_text(old)
    (before,) = read_results(file)
    assert (before.experiment, before.seed, before.nearest_mm, before.package) == ("reach", 3, 12.25, "abc")
    assert np.isnan(before.radius_mm)
    append_result(file, Result("reach", 4, True, radius_mm=2.5))
    rows = read_results(file)
    assert [(row.seed, row.nearest_mm, row.radius_mm, row.package) for row in rows[:1]] == [
        (3, 12.25, pytest.approx(np.nan, nan_ok=True), "abc")
    ]  # fmt: skip
    assert (rows[1].seed, rows[1].radius_mm) == (4, 2.5)
    assert file.read_text().splitlines()[0].split(",") == COLUMNS


@pytest.mark.parametrize("header", ["seed,success", "experiment,seed", "experiment,seed,success,weight", ""])
def test_a_table_that_is_none_of_runs_is_refused(tmp_path, header):
    file = tmp_path / "runs.csv"
    file.write_text(f"{header}\n")
    with pytest.raises(InputError, match="found columns"):
        read_results(file)


def test_the_object_rests_until_its_path_begins_and_after_it_ends():
    way = Way(np.array([0.5, 0.0, 0.1]), 0.06, 0.12, 15.0, np.random.default_rng(0))
    np.testing.assert_array_equal(way(7.0), way.start)
    way.begin(8.0)
    np.testing.assert_allclose(way(8.0 + 1e-6), way.start, atol=1e-9)
    np.testing.assert_array_equal(way(23.0), way(30.0))
    assert np.linalg.norm(way(15.0) - way.start) > 0.01
    assert not way.finished(22.9)
    assert way.finished(23.1)
