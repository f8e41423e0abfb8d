"""Whether the README's rehearsal is of the tree's code and package: a small checkout, one edit at a time."""

import contextlib
import json
import shutil
import subprocess

import pytest
from dvc.repo import Repo

from upkeep.provenance import METRICS, REHEARSAL, package_of, stage_code, stale
from upkeep.rehearsal_table import source_words

FILES = {
    "dvc.yaml": "stages: {build: {cmd: build, deps: [trunkline/model/arm], outs: [artifacts/arm.xml]}}\n",
    "rehearsal/dvc.yaml": """
stages:
  rehearse:
    meta: {on_demand: true, apart: [artifacts/package, rehearsal/params.yaml]}
    wdir: ..
    cmd: rehearse
    deps: [artifacts/arm.xml, artifacts/package/twin.tgz, rehearsal/robot, trunkline/ar/teleop]
    params: [{rehearsal/params.yaml: [rehearse]}, {conf/robot.yaml: }]
    metrics: [artifacts/rehearse/metrics.json: {cache: false}]
""",
    "rehearsal/params.yaml": "rehearse: {runs: 200}\n",
    "rehearsal/robot/touch.py": "HARD = 1\n",
    "rehearsal/report.py": "\n",
    "trunkline/ar/teleop/core.py": "STEP = 1\n",
    "trunkline/model/arm/unit.py": "\n",
    "conf/robot.yaml": "mass: 1.0\n",
    "artifacts/arm.xml": "<arm/>",
    "artifacts/package/twin.tgz": "packed",
    "artifacts/package_unity/manifest.json": "{}",
    "artifacts/rehearse/metrics.json": "{}",
    ".gitignore": "/artifacts/arm.xml\n/artifacts/package\n",
    ".dvc/config": "[core]\n    analytics = false\n",
}


def git(folder, *words):
    subprocess.run(["git", "-c", "user.name=test", "-c", "user.email=test@localhost", *words], cwd=folder, check=True)


def ran(folder, *files):
    """As if the stages of these dvc.yaml had run: their lock files say what is there."""
    with contextlib.chdir(folder), Repo() as repo:
        for file in files:
            repo.commit(file, force=True)


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory):
    """A checkout whose rehearsal ran with what it has."""
    folder = tmp_path_factory.mktemp("checkout") / "own"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    git(folder, "init", "-q")
    ran(folder, "dvc.yaml", "rehearsal/dvc.yaml")
    metrics = {"code": stage_code(folder, *REHEARSAL), "package": package_of(folder), "reach": {}}
    (folder / METRICS).write_text(json.dumps(metrics))
    ran(folder, "rehearsal/dvc.yaml")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "rehearsed")
    return folder


@pytest.fixture
def checkout(rehearsed, tmp_path):
    shutil.copytree(rehearsed, tmp_path / "checkout")
    return tmp_path / "checkout"


def edited(checkout, name, text):
    (checkout / name).write_text(text)
    return stale(checkout)


def test_a_rehearsal_of_the_tree_is_not_stale_nor_in_a_fresh_clone(checkout, tmp_path):
    assert stale(checkout) == []
    git(checkout, "clone", "-q", ".", str(tmp_path / "clone"))
    assert not (tmp_path / "clone/artifacts/arm.xml").exists()
    assert stage_code(tmp_path / "clone", *REHEARSAL) == stage_code(checkout, *REHEARSAL)
    assert stale(tmp_path / "clone") == []
    metrics = json.loads((checkout / METRICS).read_text())
    assert source_words(checkout, metrics) == f"with this code, `{metrics['code']}`, and this package, `44136fa355b3`"


@pytest.mark.parametrize(
    ("name", "text", "since"),
    [
        ("trunkline/ar/teleop/core.py", "STEP = 2\n", "trunkline/ar/teleop"),
        ("trunkline/ar/teleop/added.py", "", "trunkline/ar/teleop"),
        ("rehearsal/robot/touch.py", "HARD = 2\n", "rehearsal/robot"),
        ("conf/robot.yaml", "mass: 1.1\n", "conf/robot.yaml"),
        ("artifacts/arm.xml", "<arm softer='1'/>", "artifacts/arm.xml"),
        ("artifacts/package_unity/manifest.json", "{1}", "the package"),
    ],
)
def test_what_it_goes_through_makes_it_stale_and_is_named(checkout, name, text, since):
    (line,) = edited(checkout, name, text)
    metrics = json.loads((checkout / METRICS).read_text())
    assert line.startswith(f"README: rehearsal: of code {metrics['code']}, package {metrics['package']}; the tree has")
    assert line.endswith(f"changed since: {since}")
    assert source_words(checkout, metrics).startswith(f"**STALE**: of code {metrics['code']}, package")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("trunkline/model/arm/unit.py", "edited = 1\n"),
        ("rehearsal/report.py", "edited = 1\n"),
        ("rehearsal/params.yaml", "rehearse: {runs: 400}\n"),
        ("conf/robot.yaml", "# a comment\nmass: 1.0\n"),
    ],
)
def test_what_it_does_not_go_through_leaves_it(checkout, name, text):
    assert edited(checkout, name, text) == []


def test_another_model_of_another_stage_is_known_in_a_clone(checkout, tmp_path):
    """The pipeline ran on and wrote another arm, which Git has by its lock file alone."""
    (checkout / "artifacts/arm.xml").write_text("<arm softer='1'/>")
    ran(checkout, "dvc.yaml")
    git(checkout, "add", "-A")
    git(checkout, "commit", "-qm", "another arm")
    git(checkout, "clone", "-q", ".", str(tmp_path / "clone"))
    (line,) = stale(tmp_path / "clone")
    assert line.endswith("changed since: artifacts/arm.xml")


def test_metrics_that_name_no_code_are_stale_and_none_are_not(checkout):
    (line,) = edited(checkout, METRICS, '{"package": "44136fa355b3"}')
    assert "of code that is not named, package 44136fa355b3; " in line
    assert line.endswith("changed since: what the lock file does not tell")
    (checkout / METRICS).unlink()
    assert stale(checkout) == []
