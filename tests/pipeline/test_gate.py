"""The gate: every way in which a metric can be bad fails, by name; nothing passes by being absent."""

import json
import shutil
import subprocess

import pytest

from trunkline.errors import InputError
from trunkline.pipeline import gate

LIMITS = """
fit:
  error.validate: {max: 2.0, regression: 0.1, slack: 0.01, below: {key: error.cad, factor: 5}}
  accuracy: {min: 0.9, regression: 0.05}
  watertight: {equals: true}
  opset: {equals: 15}
"""
GOOD = {"error": {"validate": 1.0, "cad": 6.0}, "accuracy": 0.95, "watertight": True, "opset": 15}


@pytest.fixture
def project(tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "limits.yaml").write_text(LIMITS)
    (tmp_path / "artifacts" / "fit").mkdir(parents=True)
    write(tmp_path, GOOD)
    git(tmp_path, "init", "-q")
    commit(tmp_path)
    return tmp_path


def write(project, metrics):
    (project / "artifacts" / "fit" / "metrics.json").write_text(json.dumps(metrics))


def git(project, *arguments):
    identity = ["-c", "user.name=test", "-c", "user.email=test@localhost"]
    subprocess.run(["git", *identity, *arguments], cwd=project, check=True)


def commit(project):
    git(project, "add", "-A")
    git(project, "commit", "-qm", "metrics")


def found(project):
    return gate.failures(gate.read_limits(project / "tests" / "limits.yaml"), project)


def changed(**changes):
    metrics = json.loads(json.dumps(GOOD))
    for key, value in changes.items():
        holder = metrics["error"] if key in metrics["error"] else metrics
        holder[key] = value
    return metrics


def test_good_metrics_pass(project, capsys):
    assert found(project) == []
    assert gate.main(project) == 0
    assert "4 metrics in 1 stages, 0 problems" in capsys.readouterr().out


def test_missing_file_fails_every_key_by_name(project, capsys):
    (project / "artifacts" / "fit" / "metrics.json").unlink()
    problems = found(project)
    assert len(problems) == 4
    assert problems[0] == "fit: error.validate: artifacts/fit/metrics.json is missing"
    assert gate.main(project) == 1
    assert "gate: FAIL fit: accuracy" in capsys.readouterr().out


def test_file_that_is_not_json_fails(project):
    (project / "artifacts" / "fit" / "metrics.json").write_text('{"accuracy": 0.9')
    assert len(found(project)) == 4
    assert "not JSON" in found(project)[0]


@pytest.mark.parametrize(
    ("metrics", "problem"),
    [
        ({k: v for k, v in GOOD.items() if k != "accuracy"}, "accuracy: missing, expected a value"),
        ({**GOOD, "error": 3.0}, "error.validate: missing, expected a value"),
        ([1, 2], "error.validate: missing, expected a value"),
        (changed(accuracy=None), "accuracy: null, expected a value"),
        (changed(accuracy=float("nan")), "accuracy: found nan, expected a finite number"),
        (changed(validate=float("-inf")), "error.validate: found -inf, expected a finite number"),
        (changed(accuracy="0.95"), "accuracy: found '0.95', expected a finite number"),
        (changed(accuracy=True), "accuracy: found True, expected a finite number"),
        (changed(validate=2.5, cad=20.0), "error.validate: found 2.5, expected at most 2"),
        (changed(accuracy=0.85), "accuracy: found 0.85, expected at least 0.9"),
        (changed(watertight=False), "watertight: found False, expected True"),
        (changed(watertight=1), "watertight: found 1, expected True"),
        (changed(opset=16), "opset: found 16, expected 15"),
        (changed(cad=4.9), "error.validate: found 1, expected 5 times below error.cad, 4.9"),
        (changed(cad=float("nan")), "error.cad: found nan"),
        (changed(cad=None), "error.cad: found None"),
        (changed(validate=1.15), "error.validate: found 1.15, earlier 1, expected at most 0.1 worse"),
        (changed(accuracy=0.901), "accuracy: found 0.901, earlier 0.95, expected at most 0.0475 worse"),
    ],
)
def test_each_bad_value_fails_by_name(project, metrics, problem):
    write(project, metrics)
    assert any(problem in line for line in found(project)), found(project)
    assert gate.main(project) == 1


def test_small_regression_and_improvement_pass(project):
    write(project, changed(validate=1.05, accuracy=0.94))
    assert found(project) == []
    write(project, changed(validate=0.2, accuracy=1.0))
    assert found(project) == []


def test_slack_counts_near_zero(project):
    write(project, changed(validate=0.001))
    commit(project)
    write(project, changed(validate=0.009))
    assert found(project) == []
    write(project, changed(validate=0.02))
    assert len(found(project)) == 1


def test_a_committed_regression_still_fails(project):
    """CI sees a clean clone: the comparison is then with the version before the last change of the file."""
    write(project, changed(validate=1.15))
    commit(project)
    (project / "unrelated").touch()
    commit(project)
    assert found(project) == ["fit: error.validate: found 1.15, earlier 1, expected at most 0.1 worse"]


def test_first_metrics_are_held_to_the_absolute_bounds(project):
    (project / "artifacts" / "new").mkdir()
    (project / "artifacts" / "new" / "metrics.json").write_text('{"a": 3}')
    (project / "tests" / "limits.yaml").write_text("new:\n  a: {max: 2, regression: 0.1}\n")
    assert found(project) == ["new: a: found 3, expected at most 2"]


def test_a_second_version_is_found_behind_a_deletion(project):
    (project / "artifacts" / "fit" / "metrics.json").unlink()
    commit(project)
    write(project, changed(validate=1.15))
    commit(project)
    assert found(project) == ["fit: error.validate: found 1.15, earlier 1, expected at most 0.1 worse"]


def test_no_history_fails(project, monkeypatch):
    shutil.rmtree(project / ".git")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(project.parent))
    (problem,) = found(project)
    assert problem.startswith("fit: artifacts/fit/metrics.json: no earlier version, `git log` says: fatal: not a git")
    assert "\n" not in problem
    monkeypatch.setenv("PATH", "")
    assert found(project) == ["fit: artifacts/fit/metrics.json: no earlier version without Git, found no `git` command"]
    assert gate.main(project) == 1


def test_a_shallow_clone_fails_unless_it_holds_an_earlier_version(project, tmp_path_factory):
    clone, deep = (tmp_path_factory.mktemp("clones") / name for name in ("shallow", "deep"))
    (project / "unrelated").touch()
    commit(project)
    git(project, "clone", "-q", "--depth", "1", project.as_uri(), str(clone))
    (problem,) = found(clone)
    assert "artifacts/fit/metrics.json: no earlier version in a shallow clone" in problem
    git(project, "clone", "-q", project.as_uri(), str(deep))
    assert found(deep) == []
    write(clone, changed(validate=1.15))
    assert found(clone) == ["fit: error.validate: found 1.15, earlier 1, expected at most 0.1 worse"]


@pytest.mark.parametrize(
    ("earlier", "problem"),
    [
        ('{"accuracy": ', "fit: artifacts/fit/metrics.json: the version of"),
        ('{"accuracy": 0.95}', "fit: error.validate: earlier None, expected a finite number to compare with"),
        ("null", "fit: error.validate: earlier None, expected a finite number to compare with"),
        (json.dumps(changed(accuracy=float("nan"))), "fit: accuracy: earlier nan, expected a finite number"),
    ],
)
def test_an_earlier_version_that_holds_no_value_fails(project, earlier, problem):
    (project / "artifacts" / "fit" / "metrics.json").write_text(earlier)
    commit(project)
    write(project, GOOD)
    assert any(line.startswith(problem) for line in found(project)), found(project)


@pytest.mark.parametrize(
    "limits",
    ["", "fit: {}", "fit:\n  a: {}", "fit:\n  a: {maximum: 1}", "fit:\n  a: {equals: 1, regression: 0.1}", "- a"],
)
def test_limits_that_hold_nothing_are_refused(project, limits):
    (project / "tests" / "limits.yaml").write_text(limits)
    with pytest.raises(InputError, match="limits.yaml"):
        found(project)
    assert gate.main(project) == 1


def test_missing_limits_are_refused(project):
    (project / "tests" / "limits.yaml").unlink()
    assert gate.main(project) == 1
