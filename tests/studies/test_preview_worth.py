"""The study of previews: how often a radius holds, by time, and what becomes of plans that were declined."""

import pytest

from rehearsal.experiments.ablations import VARIANTS
from rehearsal.experiments.result import Result, append_result, read_results
from rehearsal.runs import Run, RunSource
from studies.preview_worth import ABLATED, CONFIRMED, coverage_table, declined_line, take_over


def test_a_tip_counts_within_the_radius_of_its_run_and_at_its_time():
    reaches = [
        Result("reach", 0, True, radius_mm=5.0, at_end_mm=4.0, after_2s_mm=6.0, after_10s_mm=5.0),
        Result("reach", 1, True, radius_mm=7.0, at_end_mm=6.0, after_2s_mm=6.0, after_10s_mm=8.0),
        Result("reach", 2, True),  # without a radius
    ]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in coverage_table({"all": reaches}).splitlines()]
    assert [row[:4] for row in rows[2:]] == [
        ["all", "at the end", "2 of 2", "100.0 %"],
        ["all", "2 s later", "1 of 2", "50.0 %"],
        ["all", "10 s later", "1 of 2", "50.0 %"],
    ]
    assert {row[5] for row in rows[2:]} == {"6 / 6.9"}
    assert rows[2][6] == "5 / 5.9"


def test_plans_that_were_declined_are_those_of_runs_with_more_than_one():
    def grasp(seed, plans, success, variant=""):
        return Result("grasp", seed, success, plans=plans, variant=variant)

    batch = [grasp(0, 1, True), grasp(1, 2, True), grasp(2, 5, False), grasp(3, 0, False)]
    confirmed = [grasp(seed, 1, seed < 2, CONFIRMED) for seed in range(4)]
    assert "declined: 2; confirmed nevertheless, 1 of them succeeded" in declined_line(batch + confirmed)
    assert declined_line([grasp(0, 1, True)]) == "No first plan of a grasp was declined."


@pytest.mark.parametrize("name", ABLATED)
def test_what_is_taken_away_is_a_variant_of_a_grasp(name):
    assert name in VARIANTS["grasp"]


def test_runs_of_the_rehearsal_are_taken_where_code_and_package_are_the_same(tmp_path):
    """What the study lacks and asks for, and that once."""
    rehearsed, table = tmp_path / "runs.csv", tmp_path / "study.csv"
    for seed, package, code in ((0, "a", "b"), (1, "a", "b"), (2, "other", "b"), (3, "a", "other"), (9, "a", "b")):
        append_result(rehearsed, Result("reach", seed, True, package=package, code=code, tip_mm=2.0))
    append_result(table, Result("reach", 0, True, package="a", code="b", tip_mm=1.0))
    for _ in range(2):
        take_over([Run("reach", seed) for seed in range(5)], rehearsed, RunSource("a", "b"), table)
    assert [(row.seed, row.tip_mm) for row in read_results(table)] == [(0, 1.0), (1, 2.0)]
