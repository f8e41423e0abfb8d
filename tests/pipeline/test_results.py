"""Results of studies and benchmarks: what they printed, of what commit, as the pages show it."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.identification.__main__ import PARTS
from trunkline.errors import InputError
from trunkline.pipeline.results import block, commit_of, recorded

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "docs/results").glob("*.json"))
PAGES = sorted([*(ROOT / "docs/results").glob("*.md"), ROOT / "docs/speed.md"])
FIGURE = re.compile(r"\d\.\d|\d ?(?:%|mm|cm|s|ms|µs|N|°)(?!\w)|\d times|\d of \d")


@pytest.fixture
def project(tmp_path):
    (tmp_path / "dvc.yaml").touch()
    (tmp_path / "code.py").write_text("1\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "-A")
    git(tmp_path, "-c", "user.name=test", "-c", "user.email=test@localhost", "commit", "-qm", "code")
    return tmp_path


def git(folder, *words):
    return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


def stored(project, name="study"):
    return json.loads((project / "docs/results" / f"{name}.json").read_text())


def test_what_is_printed_is_kept_with_its_command_and_commit(project, monkeypatch, capsys):
    monkeypatch.setattr(sys, "orig_argv", ["/usr/bin/python3.11", "-m", "studies.choices", "--only", "a b"])
    with recorded("study", root=project):
        print("two threads\n\n| a | b |\n|---|---|\n| 1 | 2 |  ")
        print("progress", file=sys.stderr)
    assert capsys.readouterr().out.startswith("two threads\n")
    lines = ["two threads", "| a | b |", "|---|---|", "| 1 | 2 |"]
    commit = git(project, "rev-parse", "--short=7", "HEAD")
    assert stored(project) == {"command": "python -m studies.choices --only 'a b'", "commit": commit, "lines": lines}
    shown = "```\ntwo threads\n```\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n`python -m studies.choices --only 'a b'`\n"
    assert block(project / "docs/results/study.json") == f"{shown}(commit {commit})"


def test_two_tables_one_after_the_other_stay_two(project):
    with recorded("study", root=project):
        print("| a |\n|---|\n| 1 |\n\n| b |\n|---|\n| 2 |")
    shown = block(project / "docs/results/study.json")
    assert shown.startswith("| a |\n|---|\n| 1 |\n\n| b |\n|---|\n| 2 |\n\n`python")


def test_a_run_that_fails_or_is_not_to_be_kept_leaves_the_file_alone(project):
    with recorded("study", root=project):
        print("whole")
    with recorded("study", keep=False, root=project):
        print("quick")
    with pytest.raises(InputError, match="no data"):
        fail(project)
    assert stored(project)["lines"] == ["whole"]


def fail(project):
    with recorded("study", root=project):
        print("half")
        raise InputError("no data")


def test_results_of_code_that_is_not_committed_say_so(project):
    assert "changes" not in commit_of(project)
    (project / "docs").mkdir()
    (project / "docs/page.md").write_text("results themselves do not count\n")
    assert "changes" not in commit_of(project)
    (project / "code.py").write_text("2\n")
    assert commit_of(project).endswith(" with changes")


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"command": "", "lines": []}'])
def test_a_file_that_is_none_is_one_line(tmp_path, text):
    (tmp_path / "study.json").write_text(text)
    with pytest.raises(InputError, match="study.json: .*expected JSON with command, commit and lines"):
        block(tmp_path / "study.json")
    assert block(tmp_path / "another.json") == "(no run is kept yet)"


def test_every_study_and_benchmark_keeps_its_results_and_every_kept_one_is_shown():
    code = "".join(file.read_text(encoding="utf-8") for name in ("studies", "benchmarks") for file in modules(name))
    named = set(re.findall(r'recorded\("(\w+)"', code))
    named |= {f"identification_{part}" for part in PARTS}
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md"))
    shown = re.findall(r"^<!-- results/(\w+) -->$", pages, re.MULTILINE)
    assert sorted(shown) == sorted(named)
    assert {file.stem for file in FILES} <= named
    runs = [file for name in ("studies", "benchmarks") for file in modules(name) if "__main__" in file.read_text()]
    assert len(runs) >= 15
    assert [file for file in runs if "recorded(" not in file.read_text()] == []


def modules(name):
    return (ROOT / name).rglob("*.py")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_result_is_of_a_command_and_a_commit(file):
    found = json.loads(file.read_text(encoding="utf-8"))
    modules = re.findall(r"python -m ((?:studies|benchmarks)\.[\w.]+)", found["command"])
    assert modules or found["command"] == "dvc repro"
    for module in modules:
        place = ROOT / module.replace(".", "/")
        assert place.with_suffix(".py").is_file() or (place / "__main__.py").is_file()
    assert re.fullmatch(r"[0-9a-f]{7}(, [0-9a-f]{7})*", found["commit"]), "made with changes that are not committed"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_of_results_has_no_figure_that_was_typed(page):
    """All stand in blocks that `make readme` writes; test_readme.py compares those with their files."""
    text = re.sub(r"<!-- ([\w/]+) -->.*?<!-- /\1 -->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = re.sub(r"`[^`]*`|\]\([^)]*\)", "", text)
    assert [line for line in text.splitlines() if FIGURE.search(line)] == []


def test_such_figures_would_be_found():
    for line in ("by up to 13 mm", "0.507 against", "in 17 s", "92 % of", "17 times as long", "11 of 15"):
        assert FIGURE.search(line), line
    for line in ("three of eleven curls", "gravity from 2026 on", "tendons 2 and 3", "the 24 segments"):
        assert not FIGURE.search(line), line
