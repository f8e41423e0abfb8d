"""Which stages have never run, and what a commit says that lacks their metrics."""

from types import SimpleNamespace

import pytest

from upkeep import baseline
from upkeep.baseline import disagreements, unrun


@pytest.mark.parametrize(
    ("rows", "metrics", "never"),
    [(False, False, True), (True, False, False), (False, True, False), (True, True, False)],
)
def test_a_stage_has_never_run_that_has_neither_metrics_nor_a_row(tmp_path, rows, metrics, never):
    if metrics:
        (tmp_path / "artifacts" / "rare").mkdir(parents=True)
        (tmp_path / "artifacts" / "rare" / "metrics.json").write_text("{}")
    before = SimpleNamespace(metrics={"rare": {}} if rows else {"fit": {}})
    assert unrun({"rare": {}}, before, tmp_path) == (["rare"] if never else [])


def test_what_the_commit_of_a_baseline_lacks_is_not_its_own(monkeypatch, tmp_path):
    printed = {"rev-parse": "false\n", "merge-base": "", "show": None}
    monkeypatch.setattr(baseline, "_output", lambda folder, command, *_: printed[command])
    before = SimpleNamespace(changes=[SimpleNamespace(commit="0123abc")], metrics={"fit": {"spread": 2.0}})
    assert disagreements(before, tmp_path) == ["fit: spread: baseline 2, expected that of 0123abc: None"]
