"""Results of studies, benchmarks and qualification: what they printed, of what commit, as the pages show it."""

import ast
import csv
import hashlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from trunkline.errors import InputError
from trunkline.unity.upm_package import write_tarball
from upkeep.origin import READS, code_of, reads_of
from upkeep.results import (
    ARCHIVES,
    COMMANDS,
    KeptResult,
    block,
    kept_results,
    modules_of,
    names_recorded,
    not_in_history,
    recorded,
    results_index,
)

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "docs/results").glob("*.json"))
PAGES = sorted(page for name in ("results/*", "measurements/*", "speed") for page in (ROOT / "docs").glob(f"{name}.md"))
CURRENT = [file for file in FILES if not KeptResult.read(file).archived]
FIGURE = re.compile(r"\d\.\d|\d ?(?:%|mm|cm|s|ms|µs|N|°)(?!\w)|\d times|\d of \d")


# Kept results of which nobody can name the code, and why: docs/results says so under each. A new result has no place
# here: it is recorded of a commit. A name goes when its study is run anew or deleted.
UNPROVEN = {
    "certificate": "with changes",
    "effects": "history",
    "experiments": "name no commit",
    "identification_physics": "history",
    "identification_sysid": "history",
    "loaded_releases": "history",
    "motors": "history",
    "payload": "name no commit",
    "suggest": "with changes",
}

FILES_OF_A_PROJECT = {
    "dvc.yaml": "",
    "studies/some.py": "from trunkline.ar.teleop.core import step\n",
    "studies/some.yaml": "runs: 20\n",
    "studies/other.yaml": "runs: 20\n",
    "trunkline/ar/teleop/core.py": "from trunkline.model.arm import unit\n\n\ndef step():\n"
    "    import trunkline.frames\n",
    "trunkline/ar/teleop/unused.py": "",
    **dict.fromkeys(("trunkline/ar/teleop/__init__.py", "trunkline/model/arm/__init__.py"), ""),
    "trunkline/ar/hybrid/__init__.py": "",
    "trunkline/ar/teleop/core.csv": "1\n",
    "trunkline/model/arm/unit.py": "LENGTH = 1\n",
    "trunkline/frames.py": "UP = 1\n",
    "trunkline/ar/hybrid/trials.py": "FORCE = 1\n",
    "upkeep/gate.py": "FORCE = 1\n",
    "stages/filter.py": "RATE = 1\n",
    "conf/teleop/config.yaml": "speed: 1\n",
    "conf/live/config.yaml": "speed: 1\n",
    "params.yaml": "filter: {rate: 1}\nreport: {arms: 1}\n",
    "dvc.lock": "stages: {build: {outs: [{path: artifacts/arm.xml, md5: 0123456789abcdef}]}}\n",
    "artifacts/package_unity/manifest.json": "{}\n",
    "docs/results/reads.yaml": (
        "study: [package, stages/filter.py, [conf/teleop, params.yaml:filter], artifacts/arm.xml, conf/none]\n"
    ),
}


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A committed checkout in which `python -m studies.some` is run."""
    monkeypatch.setattr(sys, "orig_argv", ["/usr/bin/python3.11", "-m", "studies.some", "--only", "a b"])
    for name, text in FILES_OF_A_PROJECT.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    git(tmp_path, "init", "-q")
    commit(tmp_path)
    return tmp_path


def git(folder, *words):
    command = ["git", "-c", "user.name=test", "-c", "user.email=test@localhost", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


def commit(folder):
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "code")


def stored(project, name="study"):
    return json.loads((project / "docs/results" / f"{name}.json").read_text())


def page_block(project):
    return block(project / "docs/results/study.json")


def record(project, text="1", **keywords):
    with recorded("study", root=project, **keywords):
        print(text)


def test_what_is_printed_is_kept_with_its_command_and_its_origin(project, capsys):
    with recorded("study", root=project):
        print("two threads\n\n| a | b |\n|---|---|\n| 1 | 2 |  ")
        print("progress", file=sys.stderr)
    assert capsys.readouterr().out.startswith("two threads\n")
    result, of, day = stored(project), *git(project, "log", "-1", "--format=%h %cs", "--abbrev=7").split()
    assert result["lines"] == ["two threads", "| a | b |", "|---|---|", "| 1 | 2 |"]
    assert (result["command"], result["commit"], result["date"]) == ("python -m studies.some --only 'a b'", of, day)
    code = ["artifacts/arm.xml", "conf/teleop", "package", "params.yaml:filter", "stages/filter.py", "studies/some.py"]
    code.append("studies/some.yaml")
    assert list(result["code"]) == [*code, "trunkline/ar/teleop", "trunkline/frames.py", "trunkline/model/arm"]
    assert all(re.fullmatch("[0-9a-f]{12}", digest) for digest in result["code"].values())
    table = "```\ntwo threads\n```\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n`python -m studies.some --only 'a b'`\n"
    assert page_block(project) == f"{table}(commit {of} of {day}; nothing that it goes through has changed since)"


@pytest.mark.parametrize(
    ("name", "text", "since"),
    [
        ("studies/some.py", "from trunkline.ar.teleop.core import step  # edited\n", "studies/some.py"),
        ("studies/some.yaml", "runs: 21\n", "studies/some.yaml"),
        (
            "trunkline/ar/teleop/core.py",
            "from trunkline.model.arm import unit\n",
            "trunkline/ar/teleop, 1 that it no longer goes through",
        ),
        ("trunkline/ar/teleop/core.csv", "2\n", "trunkline/ar/teleop"),
        ("trunkline/model/arm/unit.py", "LENGTH = 2\n", "trunkline/model/arm"),
        ("trunkline/frames.py", "import trunkline.ar.hybrid.trials\n", "trunkline/ar/hybrid, trunkline/frames.py"),
        ("stages/filter.py", "RATE = 2\n", "stages/filter.py"),
        ("conf/teleop/config.yaml", "speed: 2\n", "conf/teleop"),
        ("conf/teleop/added.yaml", "speed: 2\n", "conf/teleop"),
        ("conf/none/config.yaml", "speed: 2\n", "conf/none"),
        ("params.yaml", "filter: {rate: 2}\n", "params.yaml:filter"),
        ("dvc.lock", FILES_OF_A_PROJECT["dvc.lock"].replace("0123", "3210"), "artifacts/arm.xml"),
        ("artifacts/package_unity/manifest.json", "{1}\n", "package"),
    ],
)
def test_an_edit_of_what_a_result_goes_through_makes_it_stale_and_is_named(project, name, text, since):
    record(project)
    (project / name).parent.mkdir(exist_ok=True)
    (project / name).write_text(text)
    assert page_block(project).endswith(f"; **STALE**, changed since: {since})")
    commit(project)
    assert page_block(project).endswith(f"; **STALE**, changed since: {since})"), "committed or not"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("trunkline/ar/hybrid/trials.py", "FORCE = 2\n"),
        ("upkeep/gate.py", "FORCE = 2\n"),
        ("trunkline/ar/teleop/unused.py", "FORCE = 2\n"),
        ("trunkline/ar/teleop/README.md", "words\n"),
        ("studies/other.yaml", "runs: 21\n"),
        ("conf/live/config.yaml", "speed: 2\n"),
        ("params.yaml", "report: {arms: 2}\nfilter: {rate: 1}  # a comment\n"),
        ("docs/page.md", "words\n"),
    ],
)
def test_an_edit_of_anything_else_leaves_a_result_as_it_is(project, name, text):
    record(project)
    before = page_block(project)
    (project / name).write_text(text)
    assert page_block(project) == before
    commit(project)
    assert page_block(project) == before, "and however many commits later"


def test_a_module_that_is_gone_makes_its_result_stale(project):
    record(project)
    (project / "studies/some.py").unlink()
    (project / "studies/some.yaml").unlink()
    words = " ".join(page_block(project).split())
    assert "**STALE**, changed since: 5 that it no longer goes through)" in words


@pytest.mark.parametrize("name", ["trunkline/ar/hybrid/trials.py", "params.yaml", "added.py"])
def test_nothing_is_recorded_of_code_that_is_not_committed(project, name):
    """Before any work: the numbers could not be made again."""
    (project / name).write_text("changed: 1\n")
    with pytest.raises(InputError, match=rf"^{name}: found changes, expected them committed.*\Z"):
        record_in_vain(project)
    record(project, keep=False)
    assert not (project / "docs/results/study.json").exists()
    commit(project)
    record(project)
    assert stored(project)["commit"] == git(project, "rev-parse", "--short=7", "HEAD")


def record_in_vain(project):
    with recorded("study", root=project):
        pytest.fail("it works all the same")


def test_results_themselves_may_differ(project):
    (project / "docs/results/another.json").write_text("{}")
    (project / "docs/page.md").write_text("words\n")
    record(project)


def test_nothing_is_recorded_without_a_commit_or_a_module(project, monkeypatch):
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "studies.gone"])
    with pytest.raises(InputError, match="^studies.gone: found no such module"):
        record_in_vain(project)
    monkeypatch.setattr(sys, "orig_argv", ["python", "some.py"])
    with pytest.raises(InputError, match="some.py: found no module, expected `python -m"):
        record_in_vain(project)
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "studies.some"])
    shutil.rmtree(project / ".git")
    with pytest.raises(InputError, match="found no commit, expected one"):
        record_in_vain(project)


def test_a_package_that_the_command_names_is_the_result_s(project, tmp_path, monkeypatch):
    record(project)
    before = stored(project)["code"]["package"]
    assert before == hashlib.sha256(b"{}\n").hexdigest()[:12]
    write_tarball(tmp_path / "another.tgz", {"Runtime/manifest.json": b"{2}"})
    commit(project)
    monkeypatch.setattr(sys, "orig_argv", [*sys.orig_argv, str(tmp_path / "another.tgz")])
    record(project)
    assert stored(project)["code"]["package"] == hashlib.sha256(b"{2}").hexdigest()[:12]
    assert page_block(project).endswith("; **STALE**, changed since: package)")


def test_a_commit_that_is_not_in_the_history_is_named(project):
    record(project)
    commit(project)
    assert not_in_history(project) == []
    (project / "trunkline/frames.py").write_text("UP = 2\n")
    commit(project)
    record(project)
    (project / "docs/results/study.csv").write_text("seed,commit\n0,fffffff with changes\n1,\n")
    gone = stored(project)["commit"]
    git(project, "reset", "-q", "--hard", "HEAD~1")
    assert not_in_history(project) == ["study: commit fffffff"], "the file was taken back with its commit"
    (project / "docs/results/study.json").write_text(json.dumps({"commit": gone}))
    assert not_in_history(project) == [f"study: commit {name}" for name in sorted((gone, "fffffff"))]


def test_a_shallow_clone_says_that_it_cannot_check(project, tmp_path):
    record(project)
    commit(project)
    git(project, "clone", "-q", "--depth", "1", f"file://{project}", str(tmp_path / "clone"))
    with pytest.raises(InputError, match="found a shallow clone, expected the whole history"):
        not_in_history(tmp_path / "clone")


def test_two_tables_one_after_the_other_stay_two(project):
    with recorded("study", root=project):
        print("| a |\n|---|\n| 1 |\n\n| b |\n|---|\n| 2 |")
    assert page_block(project).startswith("| a |\n|---|\n| 1 |\n\n| b |\n|---|\n| 2 |\n\n`python")


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


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"command": "", "lines": []}'])
def test_a_file_that_is_none_is_one_line(project, text):
    (project / "docs/results/study.json").write_text(text)
    with pytest.raises(InputError, match="study.json: .*expected JSON with command, commit and lines"):
        page_block(project)
    assert block(project / "docs/results/another.json") == "(no run is kept yet)"


def archived(project, **fields):
    """The kept result of `project`, archived."""
    path = project / "docs/results/study.json"
    path.write_text(json.dumps(stored(project) | {"archived": "results-1"} | fields))
    return KeptResult.read(path)


def test_an_archived_result_names_its_tag_and_commit_and_is_never_stale(project):
    record(project)
    (project / "studies/some.py").unlink()
    (project / "trunkline/frames.py").write_text("UP = 2\n")
    assert KeptResult.read(project / "docs/results/study.json").state(project) == "STALE"
    assert archived(project).state(project) == "archived (results-1)"
    of = stored(project)["commit"]
    words = " ".join(page_block(project).split())
    assert f"(commit {of} of " in words
    assert words.endswith("; archived (results-1): its code stands last in commit f922469a)")
    archived(project, stale="its rows name no commit")
    assert " ".join(page_block(project).split()).endswith("in commit f922469a; its rows name no commit)")


def test_an_archived_result_whose_code_is_there_and_one_of_no_code_are_wrong(project):
    record(project)
    (project / "studies/some.py").write_text('@recorded("study")\ndef main():\n    pass\n')
    result = KeptResult.read(project / "docs/results/study.json")
    assert result.problem(project) == ""
    assert archived(project).problem(project).startswith("study: archived, and the tree has its code")
    (project / "studies/some.py").write_text('if __name__ == "__main__":\n    qualify("study", __doc__, main)\n')
    assert archived(project).problem(project).startswith("study: archived, and the tree has its code")
    (project / "studies/some.py").write_text("")
    assert archived(project).problem(project) == ""
    assert result.problem(project) == "study: the tree has no code of it, expected it archived"
    assert archived(project, archived="results-0").problem(project).startswith("study: archived by results-0, expected")


def test_a_command_that_has_another_name_today_is_shown_with_both(project):
    record(project)
    content = stored(project) | {"ran_as": "benchmarks.some"}
    (project / "docs/results/study.json").write_text(json.dumps(content))
    assert "`python -m studies.some --only 'a b'`\n(as `benchmarks.some`, commit " in page_block(project)


def test_the_index_has_every_result_and_the_archive_by_itself(project):
    record(project)
    (project / "docs/page.md").write_text("<!-- results/study -->\n<!-- /results/study -->\n")
    of = stored(project)["commit"]
    rows = results_index(project).partition("\n\n")
    assert f"| `study` | [page.md](../page.md) | `studies.some` | {of} |" in rows[0]
    assert rows[0].endswith("| of this code |")
    archived(project)
    rows = results_index(project).partition("\n\n")
    assert "study" not in rows[0]
    assert rows[2].endswith("| archived (results-1) |")


def test_every_kept_result_has_the_right_state():
    assert [problem for result in kept_results(ROOT) if (problem := result.problem(ROOT))] == []


def test_the_archive_s_commits_have_the_code_of_what_is_archived():
    try:
        not_in_history(ROOT)
    except InputError as error:
        pytest.skip(f"commits of results cannot be checked: {error}")
    for result in kept_results(ROOT):
        for module in modules_of(result.command) if result.archived else ():
            at, place = ARCHIVES[result.archived], module.replace(".", "/")
            assert git(ROOT, "ls-tree", "--name-only", at, f"{place}.py", f"{place}/__main__.py"), result.name


def test_every_command_keeps_its_results_and_every_kept_one_is_shown():
    named = names_recorded(ROOT) | {result.name for result in kept_results(ROOT) if result.archived}
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md"))
    blocks = re.findall(r"^<!-- results/(\w+) -->$", pages, re.MULTILINE)
    assert sorted(blocks) == sorted(named)
    assert {file.stem for file in FILES} <= named
    runs = [file for name in COMMANDS for file in modules(name) if '"__main__"' in file.read_text()]
    assert len(runs) >= 15
    assert [file for file in runs if not re.search(r"\b(recorded|qualify)\(", file.read_text())] == []


def modules(name):
    return (ROOT / name).rglob("*.py")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_result_is_of_a_command_and_of_code(file):
    content = json.loads(file.read_text(encoding="utf-8"))
    modules = re.findall(r"python -m ((?:studies|benchmarks|qualification)\.[\w.]+)", content["command"])
    assert modules
    for module in modules if file in CURRENT else ():
        place = ROOT / module.replace(".", "/")
        assert place.with_suffix(".py").is_file() or (place / "__main__.py").is_file()
    assert re.fullmatch(r"[0-9a-f]{7}", content["commit"])
    if file.stem in UNPROVEN:
        assert UNPROVEN[file.stem] in content["stale"]
        assert "code" not in content
        words = "**STALE**: " if file in CURRENT else f"in commit {ARCHIVES[content['archived']]}; "
        assert words + content["stale"] in " ".join(block(file).split())
    else:
        assert "stale" not in content
        assert content["code"]
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", content["date"])


def test_the_list_of_results_without_code_holds_no_other_name():
    assert {file.stem for file in FILES if "code" not in json.loads(file.read_text())} == set(UNPROVEN)


def test_the_commits_of_results_are_in_the_history():
    try:
        lines = not_in_history(ROOT)
    except InputError as error:
        pytest.skip(f"commits of results cannot be checked: {error}")
    assert {line.partition(":")[0] for line in lines} == {name for name, why in UNPROVEN.items() if why == "history"}


def test_rows_that_were_made_with_changes_or_name_no_commit_are_in_the_list():
    for table in (ROOT / "docs/results").glob("*.csv"):
        with table.open(newline="", encoding="utf-8") as file:
            commits = {row.get("commit", "") for row in csv.DictReader(file) if not row.get("code") or "commit" in row}
        is_proven = all(re.fullmatch("[0-9a-f]{7}", commit) for commit in commits)
        assert is_proven or table.stem in UNPROVEN, table


def test_the_code_of_a_qualification_is_that_of_server_robot_and_its_own():
    code = code_of(ROOT, ["qualification.faults"], reads_of(ROOT, "faults"))
    own = {"qualification/faults.py", "qualification/scene.py", "qualification/witness.py", "qualification/guests.py"}
    assert own | {"trunkline/ar/session", "trunkline/ar/drivers", "conf/live", "package"} <= set(code)


def test_what_results_read_is_named_and_is_there():
    named = yaml.safe_load((ROOT / READS).read_text())
    current = {file.stem for file in CURRENT}
    assert current <= set(named)
    assert set(named) - current <= names_recorded(ROOT), "a study names what it reads before its first run"
    entries = {entry for name in named for entry in reads_of(ROOT, name)}
    modules = {entry for entry in entries if entry.endswith(".py")}
    assert set(code_of(ROOT, [], entries - modules)) == entries - modules
    assert [module for module in modules if not (ROOT / module).is_file()] == []


SETTINGS = re.compile(r"(?:conf|artifacts|data/processed)/[\w/.]+")


@pytest.mark.parametrize("file", CURRENT, ids=lambda file: file.stem)
def test_settings_and_outputs_that_a_module_names_are_declared(file):
    """Paths and the package, in the module of the command or its folder; not what stages write that it runs itself."""
    (module,) = modules_of(json.loads(file.read_text())["command"])
    place = ROOT / module.replace(".", "/")
    files = sorted(place.glob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in files]
    texts = {node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    paths = {text for text in texts if isinstance(text, str) and SETTINGS.fullmatch(text)}
    paths |= {"package"} if any("qualify(" in file.read_text() for file in files) else set()
    paths = {"package" if path.startswith("artifacts/package_unity") else path for path in paths}
    reads = reads_of(ROOT, file.stem)
    paths = {path for path in paths if f"stages/{Path(path).parent.name}.py" not in reads}
    assert [path for path in paths if not any(path in entry or entry in path for entry in reads)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_a_page_of_results_has_no_figure_that_was_typed(page):
    """All stand in blocks that `make readme` writes; test_readme.py compares those with their files."""
    text = re.sub(r"<!-- ([\w/]+) -->.*?<!-- /\1 -->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = re.sub(r"`[^`]*`|\]\([^)]*\)", "", text)
    assert [line for line in text.splitlines() if FIGURE.search(line)] == []


def test_such_figures_would_be_found():
    for line in ("by up to 13 mm", "0.507 against", "in 17 s", "92 % of", "17 times as long", "11 of 15"):
        assert FIGURE.search(line), line
    for line in ("three of eleven curls", "gravity from 2026 on", "tendons 2 and 3", "the 24 markers"):
        assert not FIGURE.search(line), line
