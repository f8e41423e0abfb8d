"""The command `trunkline`: it lists its verbs at once, calls each, and says in one line what it cannot."""

import os
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from trunkline.__main__ import RENAMED, VERBS, Verb, main

ROOT = Path(__file__).parents[1]
HEAVY = ("numpy", "mujoco", "torch", "pandas", "dvc", "rich")


def test_help_lists_every_verb_with_a_line_each(capsys):
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name, verb in VERBS.items():
        assert [line for line in lines if line.split()[:1] == [name] and line.endswith(f"  {verb.line}")], name
    assert max(map(len, lines)) <= 100
    assert {"inspect", "check", "evaluate", "suggest", "monitor", "report"} <= set(VERBS)
    assert not [line for line in lines if line.split()[:1] and line.split()[0] in RENAMED], "new names alone"


def test_without_a_verb_it_says_which_there_are_and_fails(capsys):
    assert main([]) == 2
    assert "inspect" in capsys.readouterr().out


def test_help_imports_nothing_heavy():
    code = (
        f"from trunkline.__main__ import main; main(['-h']); import sys; print(sorted(set({HEAVY}) & set(sys.modules)))"
    )
    output = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert output.splitlines()[-1] == "[]"


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_s_own_help_names_it(name, capsys):
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: trunkline {name} ")


@pytest.mark.parametrize("name", ["describe", "worker"])
def test_run_as_a_module_a_verb_has_the_same_help(name, capsys):
    with pytest.raises(SystemExit):
        import_module(VERBS[name].module).main(["--help"])
    assert capsys.readouterr().out.startswith(f"usage: trunkline {name} ")


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_name_still_works_and_names_the_new_one(old, new, capsys):
    with pytest.raises(SystemExit):
        main([old, "--help"])
    printed = capsys.readouterr()
    assert printed.out.startswith(f"usage: trunkline {new} ")
    (line,) = printed.err.splitlines()
    assert line.startswith(f"trunkline {old} is now `trunkline {new}`")


@pytest.mark.parametrize(("script", "verb"), [("inspect", "inspect"), ("motive", "import-motive")])
def test_an_old_script_still_works_and_names_the_verb(script, verb, monkeypatch, capsys):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    module, _, function = project["scripts"][f"trunkline-{script}"].partition(":")
    monkeypatch.setattr(sys, "argv", [f"trunkline-{script}", "--help"])
    with pytest.raises(SystemExit):
        getattr(import_module(module), function)()
    printed = capsys.readouterr()
    assert printed.out.startswith(f"usage: trunkline {verb} ")
    assert printed.err.startswith(f"trunkline-{script} is now `trunkline {verb}`")


@pytest.mark.parametrize(("typed", "nearest"), [("chek", "check"), ("sugest", "suggest"), ("randomiz", "randomize")])
def test_a_mistyped_verb_names_the_nearest(typed, nearest, capsys):
    assert main([typed]) == 1
    assert capsys.readouterr().err == f"error: trunkline: found {typed!r}, no such verb, did you mean {nearest!r}?\n"


def test_a_verb_that_is_like_none_names_all(capsys):
    assert main(["xyzzy"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(", ".join(VERBS))


def test_a_missing_library_is_one_line_that_names_the_extra(monkeypatch, tmp_path, capsys):
    (tmp_path / "wants.py").write_text("import a_library_that_nobody_has")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(VERBS, "wants", Verb("wants", "", "live"))
    assert main(["wants"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "'a_library_that_nobody_has'" in line
    assert "pip install 'trunkline[pipeline,live]'" in line


def test_extras_that_verbs_name_exist_and_scripts_lead_to_what_is_there():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = {extra for verb in VERBS.values() for extra in verb.extra.split(",") if extra}
    assert named <= set(project["optional-dependencies"])
    assert {"trunkline", "trunkline-inspect", "trunkline-motive"} <= set(project["scripts"])
    for script in project["scripts"].values():
        module, _, function = script.partition(":")
        assert callable(getattr(__import__(module, fromlist=["main"]), function))


# --- report


def project(folder: Path, works: bool = True) -> None:
    """One in `folder` whose stage `report` writes a page, or fails, with the Python that runs it."""
    run = "import sys,pathlib; p=pathlib.Path('artifacts/report'); p.mkdir(parents=True); "
    run += "(p/'certificate.html').write_text(sys.executable)" if works else "sys.exit(3)"
    (folder / "run.py").write_text(run)
    (folder / "dvc.yaml").write_text(
        "stages:\n  report: {cmd: python run.py, outs: [artifacts/report/certificate.html]}\n"
    )
    subprocess.run([sys.executable, "-m", "dvc", "init", "-q", "--no-scm"], cwd=folder, check=True)


@pytest.fixture
def elsewhere(monkeypatch):
    """A shell in which no environment is activated."""
    monkeypatch.setenv("PATH", os.pathsep.join(["/usr/bin", "/bin"]))


def test_report_brings_the_page_up_to_date_with_this_python(tmp_path, elsewhere, capfd):
    project(tmp_path)
    page = tmp_path / "artifacts/report/certificate.html"
    assert main(["report", "--project", str(tmp_path), "--dry-run"]) == 0
    assert "report" in capfd.readouterr().out
    assert not page.exists()
    assert main(["report", "--project", str(tmp_path)]) == 0
    assert Path(page.read_text()).resolve() == Path(sys.executable).resolve()
    assert f"report: {page}" in capfd.readouterr().out


def test_a_mistake_in_the_settings_is_told_before_anything_runs(tmp_path, elsewhere, capfd):
    project(tmp_path)
    (tmp_path / "params.yaml").write_text("filter: {cutof: 20.0}\n")
    for words in ([], ["--dry-run"]):
        assert main(["report", "--project", str(tmp_path), *words]) == 1
        assert "filter" in capfd.readouterr().err
    assert not (tmp_path / "artifacts").exists()


def test_a_report_that_fails_or_has_no_pipeline_says_so(tmp_path, elsewhere, capfd):
    assert main(["report", "--project", str(tmp_path)]) == 1
    assert "found no dvc.yaml" in capfd.readouterr().err
    project(tmp_path, works=False)
    assert main(["report", "--project", str(tmp_path)]) != 0
    assert "certificate.html\n" not in capfd.readouterr().out
