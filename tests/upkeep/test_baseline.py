"""The gate's baseline: only its command changes it; what was edited or dropped shows, without Git and with it."""

import json
import shutil
import subprocess

import pytest
from pydantic import TypeAdapter

from tests.support.gated import changed, commit, git, made, renew, stored, write
from trunkline.errors import InputError
from trunkline.pipeline.stage import write_json
from upkeep import baseline, gate
from upkeep.baseline import MetricBaseline, Renewal, breaks, linked, root_hash
from upkeep.limits import Limit


@pytest.fixture
def project(tmp_path):
    return made(tmp_path / "project")


@pytest.fixture
def without_git(project, tmp_path, monkeypatch):
    """The project of an exported folder."""
    shutil.rmtree(project / ".git")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    return project


def chain():
    """Two renewals of before there was a chain, and three in it."""
    unchained = [Renewal(commit="a0", reason="the first", worse=[]), Renewal(commit="a1", reason="on", worse=["x"])]
    parent, changes = root_hash(unchained), []
    for number in range(3):
        metrics = {"fit": {"spread": 4.0 + number, "accuracy": 0.95}, "map": {"reach": 1.0}}
        changes.append(linked(parent, f"b{number}", f"reason {number}", [f"fit: spread: {number}"], metrics))
        parent = changes[-1].hash
    baseline = MetricBaseline(changes=changes, metrics=metrics, unchained=unchained)
    return json.loads(TypeAdapter(MetricBaseline).dump_json(baseline))


def set_to(value, *path):
    def edit(content):
        for part in path[:-1]:
            content = content[part]
        content[path[-1]] = value

    return edit


def drop(*path):
    def edit(content):
        for part in path[:-1]:
            content = content[part]
        del content[path[-1]]

    return edit


EDITS = {
    "a value": set_to(99.0, "metrics", "fit", "spread"),
    "a value by a little": set_to(6.00000001, "metrics", "fit", "spread"),
    "a value is gone": drop("metrics", "fit", "accuracy"),
    "a stage is gone": drop("metrics", "map"),
    "a value of another stage": set_to({"reach": 1.0, "spread": 4.0}, "metrics", "map"),
    "the last reason": set_to("another", "changes", 2, "reason"),
    "the first reason": set_to("another", "changes", 0, "reason"),
    "what got worse": set_to([], "changes", 1, "worse"),
    "a commit": set_to("b9", "changes", 1, "commit"),
    "a digest of values": set_to("0" * 64, "changes", 1, "values"),
    "a hash": set_to("0" * 64, "changes", 1, "hash"),
    "the first is gone": drop("changes", 0),
    "one between is gone": drop("changes", 1),
    "the last is gone": drop("changes", 2),
    "a reason of before": set_to("another", "unchained", 0, "reason"),
    "what got worse before": set_to([], "unchained", 1, "worse"),
    "a commit of before": set_to("a9", "unchained", 0, "commit"),
    "one of before is gone": drop("unchained", 0),
    "all of before are gone": drop("unchained"),
}


def read(content):
    return TypeAdapter(MetricBaseline).validate_json(json.dumps(content), strict=True)


def test_a_chain_that_nobody_touched_holds():
    assert breaks(read(chain())) == []


def test_order_and_layout_of_the_file_are_no_edit():
    assert breaks(read(json.loads(json.dumps(chain(), sort_keys=True)))) == []


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_what_is_edited_or_gone_shows_without_git(edit):
    content = chain()
    edit(content)
    assert breaks(read(content)) != []


def test_two_changes_do_not_change_places():
    content = chain()
    content["changes"][:2] = reversed(content["changes"][:2])
    assert breaks(read(content)) != []


@pytest.mark.parametrize(
    ("edit", "problem"),
    [
        (set_to(9.0, "metrics", "fit", "spread"), "gate: FAIL baseline: values are not those of its last change"),
        (set_to("why not", "changes", 0, "reason"), "gate: FAIL baseline: change 0, of "),
    ],
)
def test_the_gate_needs_no_git_to_refuse_an_edited_baseline(without_git, capsys, edit, problem):
    assert gate.main(without_git) == 0
    assert "gate: no Git here: not checked whether" in capsys.readouterr().out
    content = stored(without_git)
    edit(content)
    write_json(without_git / "tests" / "baseline.json", content)
    assert gate.main(without_git) == 1
    assert problem in capsys.readouterr().out


def forged(project, commit_name=None, **values):
    """A baseline whose chain holds and whose last change has other values, or another commit."""
    content = stored(project)
    content["metrics"]["fit"] |= values
    last, parent = content["changes"][-1], root_hash([])
    link = linked(parent, commit_name or last["commit"], last["reason"], last["worse"], content["metrics"])
    content["changes"][-1] = json.loads(TypeAdapter(baseline.Chained).dump_json(link))
    write_json(project / "tests" / "baseline.json", content)
    commit(project)


def test_values_that_are_not_those_of_their_commit_fail(project, capsys):
    forged(project, spread=9.0)
    assert gate.main(project) == 1
    out = capsys.readouterr().out
    assert "gate: FAIL fit: spread: baseline 9, expected that of" in out
    assert "1 problems" in out


def test_a_commit_that_is_not_there_fails_and_the_command_mends_it(project, capsys):
    forged(project, "0123456789")
    assert gate.main(project) == 1
    assert "gate: FAIL baseline: commit 0123456789 is not in the history" in capsys.readouterr().out
    assert renew(project, "joined commits") == 0
    commit(project)
    assert gate.main(project) == 0


def test_a_commit_that_is_somewhere_and_not_in_the_history_fails(project, capsys):
    """As after commits were joined to one: Git keeps the old ones a while, where they were made."""
    write(project, changed(spread=3.0))
    commit(project)
    assert renew(project, "better") == 0
    git(project, "reset", "-q", "--soft", "HEAD~1")
    commit(project)
    assert gate.main(project) == 1
    assert "is not in the history" in capsys.readouterr().out


def test_a_shallow_clone_says_what_it_cannot_check(project, tmp_path, capsys):
    clone = tmp_path / "clone"
    forged(project, "0123456789")
    git(project, "clone", "-q", "--depth", "1", project.as_uri(), str(clone))
    assert gate.main(clone) == 0
    assert "gate: a shallow clone: not checked whether the commits of baselines are in" in capsys.readouterr().out
    write(clone, changed(validate=1.31))
    assert gate.main(clone) == 1
    assert "error.validate: found 1.31, baseline 1" in capsys.readouterr().out


def test_the_gate_needs_no_git_for_metrics(without_git, monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    assert gate.main(without_git) == 0
    write(without_git, changed(validate=1.31))
    assert gate.main(without_git) == 1
    assert "error.validate: found 1.31, baseline 1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "alone"),
    [
        ("trunkline/code.py", False),
        ("artifacts/fit/metrics.json", False),
        ("Makefile", False),
        ("README.md", True),
        ("docs/distances.png", True),
        ("tests/limits.yaml", True),
    ],
)
def test_a_baseline_has_a_commit_of_its_own(project, capsys, name, alone):
    """With what `make readme` writes, and the rows that ask for it; a commit with more is refused until there is one
    without."""
    write(project, changed(spread=3.0))
    commit(project)
    assert renew(project, "better") == 0
    path = project / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text((path.read_text() if path.exists() else "") + "\n")
    commit(project)
    assert gate.main(project) == (0 if alone else 1)
    assert (f"changed {name} too, expected a commit of its own" in capsys.readouterr().out) != alone
    assert renew(project, "alone") == 0
    if not alone:
        commit(project)
        assert gate.main(project) == 0


def test_a_merge_may_bring_a_baseline_with_other_files(project):
    git(project, "checkout", "-q", "-b", "branch")
    write(project, changed(spread=3.0))
    commit(project)
    assert renew(project, "better") == 0
    commit(project)
    git(project, "checkout", "-q", "-")
    (project / "code.py").touch()
    commit(project)
    git(project, "merge", "-q", "--no-ff", "-m", "both", "branch")
    assert gate.main(project) == 0


def test_a_broken_chain_is_not_mended_by_another_baseline(project, capsys):
    content = stored(project)
    content["changes"][0]["reason"] = "another"
    write_json(project / "tests" / "baseline.json", content)
    write(project, changed(spread=3.0))
    commit(project)
    before = stored(project)
    assert renew(project, "why") == 1
    assert "baseline.json: baseline: change 0" in capsys.readouterr().err
    assert stored(project) == before


@pytest.mark.parametrize(("stage", "key"), [("fit", "identified.test.a"), ("score", "a")])
def test_no_baseline_of_the_split_test(tmp_path, stage, key):
    (tmp_path / "artifacts" / stage).mkdir(parents=True)
    (tmp_path / "artifacts" / stage / "metrics.json").write_text('{"a": 1.0, "identified": {"test": {"a": 1.0}}}')
    with pytest.raises(InputError, match="found a metric of `test`, expected one of a split that decides"):
        baseline.renewed(None, {stage: {key: Limit(max=2.0)}}, tmp_path, "abc", "why")


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
