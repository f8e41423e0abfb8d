"""The split `test` at a release: goals, results, what was met before and no longer is. It decides nothing else."""

import json
from pathlib import Path

import pandas as pd
import pytest

from upkeep import release
from upkeep.baseline import baseline_file, read_baseline
from upkeep.limits import Below, limit_files, lookup, of_test
from upkeep.release import FAMILIES, GOALS, RELEASED, ReleaseGoal, arm_metrics, read_goals, read_released
from upkeep.results import KeptResult

ROOT = Path(__file__).parents[2]
GOALS_OF = """
.:
  fit.test.error: {max: 2.0}
  fit.test.share: {min: 0.9}
examples/arm:
  fit.test.error: {below: {key: null.test.error, factor: 4}}
"""
GOOD = {"fit": {"test": {"error": 1.0, "share": 0.95}}, "null": {"test": {"error": 4.0}}}


@pytest.fixture
def project(tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "dvc.yaml").touch()
    (tmp_path / GOALS).write_text(GOALS_OF)
    write(tmp_path, GOOD)
    write(tmp_path / "examples/arm", GOOD)
    return tmp_path


def write(folder, metrics):
    path = folder / "artifacts/score/metrics.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(metrics))


def changed(error=1.0, share=0.95, null=4.0):
    return {"fit": {"test": {"error": error, "share": share}}, "null": {"test": {"error": null}}}


def table_of(project, capsys):
    code = release.main(project, [])
    return code, capsys.readouterr().out.splitlines()


def test_the_table_has_goal_result_and_miss(project, capsys):
    write(project, changed(error=2.5))
    code, lines = table_of(project, capsys)
    assert code == 0, "nothing was met before"
    assert lines[0].endswith("| no version before |")
    assert lines[2:] == [
        "| `fit.test.error` | 2.5 | ≤ 2 | missed | – |",
        "| `fit.test.share` | 0.95 | ≥ 0.9 | met | – |",
        "| examples/arm: `fit.test.error` | 1 | 4 times below 4 | met | – |",
        "release: 3 goals, 1 missed, 0 lost",
    ]


@pytest.mark.parametrize(
    ("goal", "metrics", "met"),
    [
        ({"max": 1.0}, {"a": 1.0}, True),
        ({"max": 1.0}, {"a": 1.0001}, False),
        ({"min": 1.0}, {"a": 1.0}, True),
        ({"min": 1.0}, {"a": 0.9999}, False),
        ({"below": Below(key="b", factor=4)}, {"a": 1.0, "b": 4.0}, True),
        ({"below": Below(key="b", factor=4)}, {"a": 1.0, "b": 3.99}, False),
        ({"below": Below(key="b", factor=4)}, {"a": 1.0}, False),
        ({"max": 1.0}, {}, False),
        ({"max": 1.0}, {"a": None}, False),
        ({"max": 1.0}, {"a": float("nan")}, False),
        ({"min": 1.0}, {"a": float("inf")}, False),
        ({"max": 1.0}, {"a": True}, False),
    ],
)
def test_what_is_not_there_meets_no_goal(goal, metrics, met):
    assert ReleaseGoal(**goal).met(metrics, "a") is met


@pytest.mark.parametrize(
    ("now", "lost"),
    [
        (changed(), None),
        (changed(error=2.0), None),
        (changed(error=2.1), ".: fit.test.error: missed, was met"),
        (changed(share=0.89), None),  # was missed before
        ({"fit": {"test": {"share": 0.95}}}, ".: fit.test.error: missed, was met"),
        (changed(error=None), ".: fit.test.error: missed, was met"),
    ],
)
def test_a_goal_that_the_version_before_met_may_not_be_missed(project, capsys, now, lost):
    write(project, changed(share=0.5))
    assert release.main(project, ["--keep"]) == 0
    capsys.readouterr()
    write(project, now)
    code, lines = table_of(project, capsys)
    assert code == bool(lost)
    assert [line for line in lines if "FAIL" in line] == ([f"release: FAIL {lost}"] if lost else [])
    assert "| 0." in lines[0], "which version"


def test_a_goal_that_was_met_is_not_dropped(project, capsys):
    assert release.main(project, ["--keep"]) == 0
    (project / GOALS).write_text(GOALS_OF.replace("  fit.test.share: {min: 0.9}\n", ""))
    capsys.readouterr()
    code, lines = table_of(project, capsys)
    assert code == 1
    assert "release: FAIL .: fit.test.share: asked no longer, was met" in lines


def test_what_is_kept_is_this_version_s(project):
    """Also where a goal is lost: that is told once, and the next version is judged by what is."""
    assert release.main(project, ["--keep"]) == 0
    write(project, changed(error=9.0))
    assert release.main(project, ["--keep"]) == 1
    assert json.loads((project / RELEASED).read_text())["met"]["."] == {"fit.test.error": False, "fit.test.share": True}
    assert release.main(project, []) == 0


def test_without_keep_nothing_is_written(project):
    before = sorted(project.rglob("*"))
    release.main(project, [])
    assert sorted(project.rglob("*")) == before


@pytest.mark.parametrize(
    ("goals", "problem"),
    [
        ("", "release.yaml: "),
        (".: {}", "release.yaml: ."),
        (".:\n  a.test: {}", "found no goal, expected one of max, min, below"),
        (".:\n  a.test: {max: 1, min: 0}", "found max and min, expected one of"),
        (".:\n  a.test: {below: {key: b, factor: 0.5}}", "factor: found 0.5"),
        (".:\n  a.validate: {max: 1}", "a.validate: found no metric of `test`, expected one"),
    ],
)
def test_goals_that_ask_nothing_or_of_another_split_are_refused(project, capsys, goals, problem):
    (project / GOALS).write_text(goals)
    assert release.main(project, []) == 1
    assert problem in capsys.readouterr().err


def test_metrics_that_are_missing_end_in_one_line(project, capsys):
    (project / "examples/arm/artifacts/score/metrics.json").unlink()
    assert release.main(project, []) == 1
    assert "artifacts/score/metrics.json is missing" in capsys.readouterr().err


def arms(name, **cells):
    row = {"arm": name, "code": "abc", "attempt": 2, "sealed": "yes", "refused": "no", "held": 9, "intervals": 10}
    return pd.DataFrame(row | cells, index=[0])


def test_arms_are_those_of_this_code_at_their_first_attempt():
    """Not those of other code, which may have the same names, and not a second try at an arm."""
    table = pd.concat([
        arms("a", curl_tip=90.0, code="old", held=0, attempt=1), arms("a", curl_tip=1.0),
        arms("b", curl_tip=4.0, sealed="no", held=5), arms("a", curl_tip=80.0, held=0),
        arms("c", refused="filter", sealed="no", held=0, intervals=0),
    ])  # fmt: skip
    metrics = arm_metrics(table, "abc")["test"]
    assert (metrics["mean"], metrics["worst"]) == ({"curl_tip": 2.5}, {"curl_tip": 4.0})
    assert (metrics["sealed_arms"], metrics["refused_arms"], metrics["intervals_held"]) == (1, 1, 0.7)


def test_arms_that_nobody_measured_with_this_code_end_in_one_line(project, capsys):
    (project / GOALS).write_text(f"{FAMILIES}:\n  test.mean.every_tip: {{max: 2.0}}\n")
    assert release.main(project, []) == 1
    assert f"{FAMILIES}: found none, expected that of `make families`" in capsys.readouterr().err
    (project / FAMILIES).parent.mkdir(parents=True)
    result = {"command": "python -m studies.families", "commit": "abc", "code": {"studies": "old"}, "lines": []}
    (project / FAMILIES).write_text(json.dumps(result))
    assert release.main(project, []) == 1
    assert f"{FAMILIES}: found it of commit abc, expected it of this code" in capsys.readouterr().err


# the project's own


def test_no_row_and_no_baseline_of_the_project_is_of_test():
    """Whatever decides which commit passes: rows, what they are compared with, and the values that they are held to."""
    for file in limit_files(ROOT):
        text = file.read_text(encoding="utf-8")
        rows = [line.partition("#")[0] for line in text.splitlines()]
        assert [row for row in rows if ".test" in row or "test." in row or row.startswith("score:")] == [], file
        metrics = read_baseline(baseline_file(file)).metrics
        assert [(stage, key) for stage, keys in metrics.items() for key in keys if of_test(stage, key)] == []


def goals_so_far():
    """The project's, but for those of arms that are not measured before a release."""
    goals = read_goals(ROOT / GOALS)
    return {folder: rows for folder, rows in goals.items() if folder != str(FAMILIES) or (ROOT / FAMILIES).is_file()}


def test_each_goal_of_the_project_has_a_metric_of_test():
    for folder, rows in goals_so_far().items():
        if folder == str(FAMILIES):
            code = KeptResult.read(ROOT / FAMILIES).origin.digest
            metrics = arm_metrics(pd.read_csv(ROOT / FAMILIES.with_suffix(".csv"), dtype={"code": str}), code)
        else:
            metrics = json.loads((ROOT / folder / "artifacts/score/metrics.json").read_text())
        for key, goal in rows.items():
            assert lookup(metrics, key) is not None, f"{folder}: {key}"
            assert goal.below is None or lookup(metrics, goal.below.key) is not None, f"{folder}: {key}"


def test_what_the_project_released_names_its_goals():
    released = read_released(ROOT / RELEASED)
    assert released is not None
    assert {folder: set(rows) for folder, rows in released.met.items()} == {
        folder: set(rows) for folder, rows in goals_so_far().items()
    }
