"""The gate: every way in which a metric can be bad fails, by name; nothing passes by being absent, or bit by bit."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

from trunkline.errors import InputError
from trunkline.hybrid.shares import wilson
from trunkline.pipeline import baseline, gate
from trunkline.pipeline.limits import Limit, limit_files, lookup, metrics_folder, read_limits

ROOT = Path(__file__).parents[2]
LIMITS = """
fit:
  error.validate: {max: 2.0, slack: 0.01, below: {key: error.cad, factor: 5}}
  accuracy: {min: 0.9}
  spread: {better: lower}
  watertight: {equals: true}
  opset: {equals: 15}
"""
GOOD = {"error": {"validate": 1.0, "cad": 8.0}, "accuracy": 0.95, "spread": 4.0, "watertight": True, "opset": 15}


@pytest.fixture
def project(tmp_path):
    project = tmp_path / "project"
    (project / "tests").mkdir(parents=True)
    (project / "dvc.yaml").touch()
    (project / "tests" / "limits.yaml").write_text(LIMITS)
    (project / "artifacts" / "fit").mkdir(parents=True)
    write(project, GOOD)
    git(project, "init", "-q")
    commit(project)
    assert renew(project, "the first") == 0
    commit(project)
    return project


def write(project, metrics):
    (project / "artifacts" / "fit" / "metrics.json").write_text(json.dumps(metrics))


def git(project, *arguments):
    identity = ["-c", "user.name=test", "-c", "user.email=test@localhost"]
    subprocess.run(["git", *identity, *arguments], cwd=project, check=True)


def commit(project):
    git(project, "add", "-A")
    git(project, "commit", "-qm", "metrics")


def renew(project, *reason):
    return baseline.main(project, list(reason))


def stored(project):
    return json.loads((project / "tests" / "baseline.json").read_text())


def found(project):
    file = project / "tests" / "limits.yaml"
    return gate.failures(read_limits(file), baseline.read_baseline(baseline.baseline_file(file)), project)


def changed(**changes):
    metrics = json.loads(json.dumps(GOOD))
    for key, value in changes.items():
        holder = metrics["error"] if key in metrics["error"] else metrics
        holder[key] = value
    return metrics


def test_good_metrics_pass(project, capsys):
    assert found(project) == []
    assert gate.main(project) == 0
    assert "5 metrics in 1 stages, 0 problems" in capsys.readouterr().out


def test_metrics_that_no_row_names_are_let_alone(project):
    write(project, GOOD | {"new": 3, "unknown": None, "by": {"kind": [1.0]}})
    assert found(project) == []


def test_a_missing_file_fails(project, capsys):
    (project / "artifacts" / "fit" / "metrics.json").unlink()
    assert found(project) == ["fit: artifacts/fit/metrics.json is missing"]
    assert gate.main(project) == 1
    assert "gate: FAIL fit: artifacts/fit/metrics.json is missing" in capsys.readouterr().out


def test_a_file_that_is_not_json_fails(project):
    (project / "artifacts" / "fit" / "metrics.json").write_text('{"accuracy": 0.9')
    assert "not JSON" in found(project)[0]


@pytest.mark.parametrize(
    ("metrics", "problem"),
    [
        ({k: v for k, v in GOOD.items() if k != "accuracy"}, "accuracy: missing, expected a value"),
        ({**GOOD, "error": 3.0}, "error.validate: missing, expected a value"),
        ([1, 2], "error.validate: missing, expected a value"),
        (changed(accuracy=None), "accuracy: null, expected a value"),
        (changed(accuracy="0.95"), "accuracy: found '0.95', expected a finite number"),
        (changed(accuracy=True), "accuracy: found True, expected a finite number"),
        (changed(validate=2.5, cad=20.0), "error.validate: found 2.5, expected at most 2"),
        (changed(accuracy=0.85), "accuracy: found 0.85, expected at least 0.9"),
        (changed(watertight=False), "watertight: found False, expected True"),
        (changed(watertight=1), "watertight: found 1, expected True"),
        (changed(opset=16), "opset: found 16, expected 15"),
        (changed(cad=4.9), "error.validate: found 1, expected 5 times below error.cad, 4.9"),
        (changed(cad=None), "error.cad: found None"),
        (changed(validate=1.31), "error.validate: found 1.31, baseline 1, expected at most 1.3"),
        (changed(accuracy=0.93), "accuracy: found 0.93, baseline 0.95, expected at least 0.935"),
        (changed(spread=5.3), "spread: found 5.3, baseline 4, expected at most 5.2"),
    ],
)
def test_each_bad_value_fails_by_name(project, metrics, problem):
    write(project, metrics)
    assert any(problem in line for line in found(project)), found(project)
    assert gate.main(project) == 1


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("key", ["error.validate", "error.cad", "spread", "free.1"])
def test_a_number_that_is_not_finite_fails_under_whatever_key(project, key, value):
    last = key.rpartition(".")[2]
    write(project, changed(free=[1.0, value]) if last == "1" else changed(**{last: value}))
    assert found(project) == [f"fit: {key}: found {value}, expected a finite number"]
    assert gate.main(project) == 1


def test_a_little_worse_and_better_pass(project):
    write(project, changed(validate=1.29, accuracy=0.936, spread=5.1))
    assert found(project) == []
    write(project, changed(validate=0.2, accuracy=1.0, spread=0.0))
    assert found(project) == []


def test_many_commits_of_a_little_worse_fail_as_soon_as_they_sum_up(project):
    """15 commits of +9.9 %, each green beside the one before, took an error to four times its value."""
    refused = []
    for step in range(1, 16):
        write(project, changed(validate=1.099**step, cad=100.0))
        commit(project)
        if gate.main(project):
            refused.append(step)
    assert refused == list(range(3, 16))  # 1.099² = 1.21, 1.099³ = 1.33


def test_slack_counts_near_zero(project):
    write(project, changed(validate=0.001))
    commit(project)
    assert renew(project, "better") == 0
    write(project, changed(validate=0.0109))
    assert found(project) == []
    write(project, changed(validate=0.0112))
    assert found(project) == ["fit: error.validate: found 0.0112, baseline 0.001, expected at most 0.011"]


@pytest.mark.parametrize(
    ("limit", "before", "expected"),
    [
        ({"max": 9.0}, 2.0, 2.6),
        ({"max": 2.5}, 2.0, 2.5),
        ({"better": "lower", "factor": 2}, 2.0, 4.0),
        ({"better": "lower", "slack": 5}, 0, 5),
        ({"better": "lower"}, -1.0, -0.7),
        ({"min": 0.5}, 0.9, 0.87),
        ({"min": 0.88}, 0.9, 0.88),
        ({"better": "higher", "slack": 0.2}, 1.0, 0.8),
        ({"better": "higher"}, 1300, 1000),
    ],
)
def test_bounds_by_hand(limit, before, expected):
    assert Limit(**limit).bound(before) == pytest.approx(expected)


SHARES = "fit:\n  hold.rate: {min: 0.95, interval: hold.high, slack: 0.02}\n"


def share(found, runs, **more):
    low, high = wilson(found, runs)
    return {"hold": {"rate": found / runs, "low": low, "high": high} | more}


@pytest.mark.parametrize(
    ("metrics", "problem"),
    [
        (share(196, 200), None),
        (share(187, 200), None),  # 93.5 %, and may be 96 %
        (share(182, 200), "found 0.91, its interval to 0.942"),
        (share(18, 20), None),
        (share(196, 200, high=None), "hold.high: found None, expected the better end of its interval"),
        (share(196, 200, rate=None), "null, expected a value"),
    ],
)
def test_a_share_falls_short_only_if_its_interval_does(tmp_path, metrics, problem):
    (tmp_path / "limits.yaml").write_text(SHARES)
    limit = read_limits(tmp_path / "limits.yaml")["fit"]["hold.rate"]
    lines = limit.problems(metrics, "hold.rate", None)
    assert [line for line in lines if problem is None or not line.startswith(problem)] == []
    assert bool(lines) == bool(problem)


def test_a_share_is_held_to_the_baseline_by_its_interval_too():
    limit = Limit(min=0.5, interval="hold.high", slack=0.02)
    assert limit.problems(share(195, 200), "hold.rate", 1.0) == []  # to 0.989: a few of 200 are chance
    (line,) = limit.problems(share(190, 200), "hold.rate", 1.0)
    assert line.endswith("baseline 1, expected at least 0.98")


def test_a_stage_that_never_ran_is_told_and_holds_nothing_until_it_did(project, capsys):
    """Its first baseline ends that: from then on it fails without its metrics."""
    (project / "tests" / "limits.yaml").write_text(LIMITS + "rare:\n  rate: {min: 0.5}\n")
    assert gate.main(project) == 0
    assert "gate: rare: never ran, its 1 rows hold nothing yet" in capsys.readouterr().out
    commit(project)
    assert renew(project, "of what ran") == 0
    file = project / "artifacts" / "rare" / "metrics.json"
    file.parent.mkdir()
    file.write_text('{"rate": 0.4}')
    assert found(project)[0].startswith("rare: rate: no baseline")
    assert found(project)[1] == "rare: rate: found 0.4, expected at least 0.5"
    file.write_text('{"rate": 0.6}')
    commit(project)
    assert renew(project, "it ran") == 0
    assert found(project) == []
    file.unlink()
    assert found(project) == ["rare: artifacts/rare/metrics.json is missing"]
    assert gate.main(project) == 1


def test_of_the_project_s_stages_only_the_rehearsal_may_not_have_run():
    """No baseline without a row of each other stage, or a stage's metrics could be deleted unseen."""
    for file in limit_files(ROOT):
        before = baseline.read_baseline(baseline.baseline_file(file))
        assert set(own_limits(file)) - set(before.metrics) <= {"rehearse"}


def test_a_row_without_a_baseline_fails_and_the_command_adds_it(project):
    (project / "tests" / "limits.yaml").write_text(LIMITS + "  error.cad: {better: lower}\n")
    assert found(project) == ['fit: error.cad: no baseline, expected one (`make baseline REASON="..."`)']
    commit(project)
    assert renew(project, "a new row") == 0
    assert found(project) == []
    assert stored(project)["metrics"]["fit"]["error.cad"] == 8.0


def test_the_baseline_keeps_of_what_and_why_and_what_got_worse(project, capsys):
    write(project, changed(validate=1.5, spread=3.0, accuracy=0.94))
    commit(project)
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=project, capture_output=True, text=True, check=True).stdout
    assert gate.main(project) == 1
    assert renew(project, "another  motor\n") == 0
    first, second = stored(project)["changes"]
    assert first["reason"] == "the first"
    assert first["worse"] == []
    assert second["reason"] == "another motor"
    assert head.startswith(second["commit"])
    assert second["worse"] == ["fit: error.validate: 1, now 1.5", "fit: accuracy: 0.95, now 0.94"]
    assert gate.main(project) == 0
    commit(project)
    assert renew(project, "again") == 0
    assert "nothing changed" in capsys.readouterr().out
    assert len(stored(project)["changes"]) == 2


@pytest.mark.parametrize(
    ("change", "reason", "problem"),
    [
        (lambda project: None, " ", "found no reason"),
        (lambda project: write(project, changed(spread=3.0)), "why", "changes that are not committed"),
        (lambda project: shutil.rmtree(project / ".git"), "why", "found no commit"),
    ],
)
def test_a_baseline_needs_a_reason_and_a_commit_of_its_own(project, monkeypatch, capsys, change, reason, problem):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(project.parent))
    before = stored(project)
    change(project)
    assert renew(project, reason) == 1
    assert problem in capsys.readouterr().err
    assert stored(project) == before


@pytest.mark.parametrize(
    ("metrics", "problem"),
    [
        (changed(validate=2.5), "fit: error.validate: found 2.5, expected at most 2"),
        (changed(spread=float("nan")), "spread: found nan, expected a finite number"),
    ],
)
def test_metrics_that_miss_their_goals_are_no_baseline(project, capsys, metrics, problem):
    write(project, metrics)
    commit(project)
    assert renew(project, "why") == 1
    assert problem in capsys.readouterr().err


def test_a_baseline_that_was_edited_fails(project, capsys):
    file = project / "tests" / "baseline.json"
    file.write_text(file.read_text().replace('"spread": 4.0', '"spread": 9.0'))
    commit(project)
    assert gate.main(project) == 1
    assert "fit: spread: baseline 9, expected that of" in capsys.readouterr().out


def test_it_needs_no_history(project, tmp_path, monkeypatch, capsys):
    clone = tmp_path / "clone"
    git(project, "clone", "-q", "--depth", "1", project.as_uri(), str(clone))
    assert gate.main(clone) == 0
    write(clone, changed(validate=1.31))
    assert gate.main(clone) == 1
    assert "error.validate: found 1.31, baseline 1" in capsys.readouterr().out
    write(clone, GOOD)
    shutil.rmtree(clone / ".git")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    assert gate.main(clone) == 0
    monkeypatch.setenv("PATH", "")
    assert gate.main(clone) == 0


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ("", "limits.yaml: "),
        ("fit: {}", "limits.yaml: fit: "),
        ("fit:\n  a: {}", "limits.yaml: fit: a: found no bound, expected one of max, min, better, equals"),
        ("fit:\n  a: {max: 1, min: 0}", "limits.yaml: fit: a: found max and min, expected one of"),
        ("fit:\n  a: {maximum: 1}", "limits.yaml: fit: a.maximum: unknown key, did you mean"),
        ("fit:\n  a: {max: .nan}", "limits.yaml: fit: a.max: found nan, expected a finite number"),
        ("fit:\n  a: {min: -.inf}", "limits.yaml: fit: a.min: found -inf, expected a finite number"),
        ("fit:\n  a: {max: 1, slack: .inf}", "limits.yaml: fit: a.slack: found inf, expected a finite number"),
        ("fit:\n  a: {max: 1, factor: .nan}", "limits.yaml: fit: a.factor: found nan, expected a finite number"),
        ("fit:\n  a: {max: 1, factor: 100}", "limits.yaml: fit: a.factor: found 100, expected 1 to 3"),
        ("fit:\n  a: {max: 1, below: {key: b, factor: .inf}}", "limits.yaml: fit: a.below.factor: found inf"),
        ("- a", "limits.yaml: "),
    ],
)
def test_limits_that_hold_nothing_are_refused_in_one_line(project, capsys, limits, problem):
    (project / "tests" / "limits.yaml").write_text(limits)
    assert gate.main(project) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert problem in line


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"spread": 4.0', '"spread": NaN', "baseline.json: metrics: fit.spread: found nan, expected a finite number"),
        ('"spread": 4.0', '"spread": Infinity', "baseline.json: metrics: fit.spread: found inf, expected a finite"),
        ('"spread": 4.0', '"spread": null', "baseline.json: metrics: fit.spread: found None"),
        ('"the first"', '""', "baseline.json: changes: 0.reason: found ''"),
        ('"changes"', '"change"', "baseline.json: "),
        ("{", "", "baseline.json: "),
    ],
)
def test_a_bad_baseline_is_refused_in_one_line(project, capsys, old, new, problem):
    file = project / "tests" / "baseline.json"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new, 1))
    assert gate.main(project) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert problem in line


@pytest.mark.parametrize("name", ["limits.yaml", "baseline.json"])
def test_a_missing_file_is_refused(project, name, capsys):
    (project / "tests" / name).unlink()
    assert gate.main(project) == 1
    assert f"{name}: no such file" in capsys.readouterr().err


# the project's own rows

own_limits = cache(read_limits)  # of a file that no test writes to


def own_rows():
    for file in limit_files(ROOT):
        for stage, rows in own_limits(file).items():
            for key in rows if metrics_of(file, stage).exists() else ():  # what never ran is told by the gate
                yield pytest.param(file, stage, key, id=f"{metrics_folder(file).name}-{stage}-{key}")


def metrics_of(file, stage):
    return metrics_folder(file) / "artifacts" / stage / "metrics.json"


def copied(file, folder):
    """Limits, baseline and metrics of the project or an example, in `folder` as those of a project."""
    (folder / "tests").mkdir()
    shutil.copy(file, folder / "tests" / "limits.yaml")
    before = baseline.read_baseline(baseline.baseline_file(file))
    for stage in filter(lambda stage: metrics_of(file, stage).exists(), own_limits(file)):
        (folder / "artifacts" / stage).mkdir(parents=True)
        shutil.copy(metrics_of(file, stage), folder / "artifacts" / stage)
    return before


@pytest.mark.parametrize(("file", "stage", "key"), list(own_rows()))
def test_each_row_can_fail(file, stage, key, tmp_path):
    """What is a little beyond a row's bound is refused, and there is such a value."""
    before, limit = copied(file, tmp_path), own_limits(file)[stage][key]
    path = tmp_path / "artifacts" / stage / "metrics.json"
    metrics = json.loads(path.read_text())
    holder = lookup(metrics, key.rpartition(".")[0]) if "." in key else metrics
    if limit.equals is not None:
        bad = not limit.equals if isinstance(limit.equals, bool) else limit.equals + 1
    else:
        value = before.metrics[stage][key]
        bound = limit.bound(value)
        assert abs(bound - value) <= max(2 * abs(value), limit.slack) * (1 + 1e-9)
        assert limit.rises or bound > 0  # nothing of which more is better can be negative
        bad = bound + (1 if limit.rises else -1) * max(1e-6 * abs(bound), 1e-12)
    holder[key.rpartition(".")[2]] = bad
    if limit.interval:
        lookup(metrics, limit.interval.rpartition(".")[0])[limit.interval.rpartition(".")[2]] = bad
    path.write_text(json.dumps(metrics))
    lines = gate.failures(own_limits(file), before, tmp_path)
    assert any(line.startswith(f"{stage}: {key}: found ") for line in lines), lines
    del holder[key.rpartition(".")[2]]
    path.write_text(json.dumps(metrics))
    expected = f"{stage}: {key}: missing, expected a value"
    assert expected in gate.failures(own_limits(file), before, tmp_path)


def test_a_bound_is_an_input_error(tmp_path):
    (tmp_path / "limits.yaml").write_text("fit:\n  a: {max: .nan}")
    with pytest.raises(InputError, match="a.max: found nan"):
        read_limits(tmp_path / "limits.yaml")
