"""The pipeline: dvc.yaml agrees with the stages, their settings and their imports, and reruns what it must."""

import ast
import json
import os
import re
import subprocess
import sys
from dataclasses import fields
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import yaml
from dvc.repo import Repo
from omegaconf import OmegaConf

from demo.plants.choice import Choice
from tests.support.bucket import bucket
from tests.support.folders import ROOT
from tests.support.stub_pipeline import StubPipeline
from trunkline.pipeline.config import SHARED, check_settings, group_options
from upkeep import lock, versions
from upkeep.origin import imported
from upkeep.versions import LIBRARIES

OF_NO_STAGE = ["execution", "hybrid", "live", "suggest", "teleop"]  # rooms whose settings no stage reads
STAGES = list(yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"])
EXAMPLES = sorted(
    f"{file.parent.relative_to(ROOT)}/dvc.yaml:{stage}"
    for file in ROOT.glob("examples/*/dvc.yaml")
    for stage in yaml.safe_load(file.read_text())["stages"]
)

REHEARSE = "rehearsal/dvc.yaml:rehearse"  # takes hours: runs when it is asked for

LONG = ("distances.csv", "errors.csv", "deviation.csv")  # plot data of thousands of rows: in the cache
POSES = "examples/helix/artifacts/identify_stiffness/shapes.csv"  # of a recording without a licence: likewise


@pytest.fixture(scope="module")
def repo():
    with Repo(str(ROOT)) as repo:
        yield repo


@pytest.fixture(scope="module")
def stages(repo):
    return {stage.addressing: stage for stage in repo.index.stages}


def test_one_name_everywhere():
    written = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]
    assert len(written) >= 10
    assert list(OmegaConf.load(ROOT / "params.yaml")) == STAGES
    assert sorted(file.stem for file in (ROOT / "stages").glob("[!_]*.py")) == sorted(STAGES)
    assert sorted(folder.name for folder in (ROOT / "conf").iterdir()) == sorted([*STAGES, SHARED, *OF_NO_STAGE])
    for name, stage in written.items():
        assert stage["cmd"] == f"python -m stages.{name}"
        assert stage["desc"]


@pytest.mark.parametrize(
    "file", ["dvc.yaml", "demo/dvc.yaml", "rehearsal/dvc.yaml", *sorted({e.partition(":")[0] for e in EXAMPLES})]
)
def test_a_pipeline_can_be_read_like_a_table_of_contents(file):
    text = (ROOT / file).read_text()
    lines, most = text.splitlines(), max(40, 22 * len(yaml.safe_load(text)["stages"]))
    assert [line for line in lines if len(line) > 120] == []
    assert len(lines) <= most, f"too long for a table of contents, expected {most} lines at most: fill them up"


@pytest.mark.parametrize("address", [*STAGES, *EXAMPLES])
def test_a_stage_lists_its_settings(stages, address):
    folder, name = _folder_and_name(address)
    section = OmegaConf.to_container(OmegaConf.load(ROOT / folder / "params.yaml"))[name] or {}
    expected = {f"{folder}params.yaml": [name], **_settings("conf", name, section)}
    if section.get("rig") == "demo.rig":
        expected |= _settings_of_the_rig() | (_settings_of_slow_pulls() if name == "report" else {})
    assert _listed(stages[address]) == expected


def _listed(stage) -> dict[str, list]:
    """Settings that a stage lists, by file, but for its libraries."""
    params = {_relative(dep): dep.params for dep in stage.deps if hasattr(dep, "params")}
    return {file: keys for file, keys in params.items() if file != "versions.yaml"}


def _settings(conf: str, name: str, section: dict) -> dict[str, list]:
    """The files of a stage's settings, with those of the groups' options that its section of params.yaml names, and of
    the options on which these build."""
    chosen = []
    for group, options in group_options(ROOT / conf / name).items():
        if group not in section:  # of which config.yaml chooses one
            continue
        bases = OmegaConf.load(options[section[group]]).get("defaults", [])
        chosen += [options[option] for option in (section[group], *bases) if option != "_self_"]
    return {f"{conf}/{name}/config.yaml": []} | {file.relative_to(ROOT).as_posix(): [] for file in chosen}


LAB_S_SETTINGS = {
    "demo/params.yaml": ["record"],
    **_settings("demo/conf", "record", OmegaConf.to_container(OmegaConf.load(ROOT / "demo/params.yaml"))["record"]),
}


def _settings_of_the_rig() -> dict[str, list]:
    """Those of the lab's that choose its plant, and no more."""
    params = OmegaConf.load(ROOT / "demo/params.yaml").record
    drawing = OmegaConf.load(ROOT / "demo/conf/record/config.yaml")
    keys = [field.name for field in fields(Choice)]
    groups = [key for key in keys if (ROOT / "demo/conf/record" / key).is_dir()]
    return {
        "demo/params.yaml": [f"record.{key}" for key in keys if key in params],
        "demo/conf/record/config.yaml": [key for key in keys if key in drawing and key not in params],
        **{f"demo/conf/record/{key}/{params[key]}.yaml": [] for key in groups},
    }


def _settings_of_slow_pulls() -> dict[str, list]:
    """Those by which the lab's arm is brought to a pose as slowly as in the session."""
    files = {file: keys for file, keys in LAB_S_SETTINGS.items() if "/experiments/" in file}
    return {"demo/params.yaml": [*_settings_of_the_rig()["demo/params.yaml"], "record.experiments"]} | files


def test_the_lab_lists_its_settings(stages):
    assert _listed(stages["demo/dvc.yaml:record"]) == LAB_S_SETTINGS


def test_the_rehearsal_lists_its_settings(stages):
    """Those of its own, of teleoperation, and of the robot's arm, which is the lab's."""
    rehearsal_files = {file.relative_to(ROOT).as_posix(): [] for file in (ROOT / "rehearsal/conf").rglob("*.yaml")}
    rehearsal_files |= {"rehearsal/params.yaml": ["rehearse"], "conf/teleop/config.yaml": []}
    assert _listed(stages[REHEARSE]) == rehearsal_files | _settings_of_the_rig()


# Live sessions take the names of tracked bodies from where logs are read; a rehearsal reads no log.
NO_LOGS = {REHEARSE: {"lz4", "mcap-protobuf-support", "rosbags", "zstandard"}}


@pytest.mark.parametrize("address", [*STAGES, *EXAMPLES, "demo/dvc.yaml:record", REHEARSE])
def test_a_stage_lists_the_libraries_that_its_numbers_go_through(stages, address):
    """Those that it imports, directly or through its rooms, so that another version of one runs it again."""
    (listed,) = (dep.params for dep in stages[address].deps if _relative(dep) == "versions.yaml")
    distributions, imported = _distributions(), set()
    for file in _code(stages[address]):
        for node in ast.walk(_tree(file)):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            names = {name for module in modules for name in distributions.get(module.partition(".")[0], [])}
            imported |= {re.sub(r"[-_.]+", "-", name).lower() for name in names}
    assert list(listed) == [name for name in LIBRARIES if name in imported - NO_LOGS.get(address, set())]


@pytest.mark.parametrize("address", EXAMPLES)
def test_an_example_is_the_pipeline_s_own_stages(stages, address):
    """The same module, read, written and shown the same; beside its data no input that the other has not.

    One that identifies from motions alone is shown as `identify_control` is.
    """
    folder, name = _folder_and_name(address)
    example, stage = stages[address], stages[name]
    assert (example.cmd, example.desc) == (stage.cmd, stage.desc)
    params = yaml.safe_load((ROOT / folder / "params.yaml").read_text())
    if params.get(name, {}).get("source") == "motions":
        expected = {_relative(out).replace("identify_control", name) for out in stages["identify_control"].outs}
        assert {_relative(out).removeprefix(folder) for out in example.outs} == expected
        outs = []
    else:
        outs = [(example.outs, stage.outs)]
    for mine, others in (*outs, (example.deps, stage.deps)):
        paths, expected = ({_relative(entry).removeprefix(folder) for entry in entries} for entries in (mine, others))
        chosen = {entry for entry in paths | expected if entry.startswith(("data/raw/", "conf/"))}
        lacking = set(STAGES) - {other.partition(":")[2] for other in EXAMPLES if other.startswith(folder)}
        chosen |= {entry for entry in expected if entry.startswith(tuple(f"artifacts/{other}/" for other in lacking))}
        chosen |= {params.get(name, {}).get("model")}
        if name == "train_ik" and params[name]["rig"] is None:
            chosen |= {"demo/plants", "demo/rig.py", "trunkline/model/arm", *_settings_of_the_rig()}
        assert paths - chosen == expected - chosen


@pytest.mark.parametrize("address", [stage for stage in EXAMPLES if not stage.endswith(":ingest")])
def test_an_example_s_settings_are_checked(address):
    folder, _ = _folder_and_name(address)
    assert check_settings(ROOT / folder) == sorted(s.partition(":")[2] for s in EXAMPLES if s.startswith(folder))


@pytest.mark.parametrize("name", [*STAGES, *EXAMPLES, "demo/dvc.yaml:record", REHEARSE])
def test_a_stage_depends_on_the_code_it_imports_and_no_other(stages, name):
    rooms = ("stages", "trunkline", "demo", "rehearsal")
    deps = {dep for dep in map(_relative, stages[name].deps) if dep.startswith(rooms)}
    deps = {dep for dep in deps if not dep.endswith(".yaml")}
    modules = _code(stages[name])
    covers = {dep: {m for m in modules if m == dep or m.startswith(f"{dep}/")} for dep in deps}
    assert modules - set().union(*covers.values()) == set()
    assert [dep for dep, covered in covers.items() if not covered] == []


def test_what_a_stage_reads_another_writes_whole(repo):
    """No dependency lies inside or around an output, where the lock could not be checked for consistency."""
    outs = {_relative(out) for out in repo.index.outs}
    for stage in repo.index.stages:
        for dep in map(_relative, stage.deps):
            nested = [out for out in outs if out.startswith(f"{dep}/") or dep.startswith(f"{out}/")]
            assert not nested, f"{stage.addressing}: {dep} beside {nested}"
            data = dep.startswith(("data/", "artifacts/", "examples/")) and "/raw/" not in f"{dep}/"
            data = data and not dep.endswith(".yaml")
            assert not data or dep in outs, f"{stage.addressing}: nothing writes {dep}"


def test_git_holds_numbers_and_the_cache_holds_the_rest(repo):
    for out in repo.index.outs:
        path = _relative(out)
        below = re.sub(r"^examples/\w+/", "", path)
        assert path == "data/raw/demo" or below.split("/")[0] in ("artifacts", "data"), path
        in_git = below.startswith("artifacts/") and path.endswith((".json", ".csv"))
        in_git &= not path.endswith((*LONG, POSES))
        in_git |= path == "data/raw/demo.truth.json"  # the generated tables of the docs are made from it
        assert out.use_cache != in_git, path
        ignored = subprocess.run(["git", "check-ignore", "-q", path], cwd=ROOT, check=False).returncode == 0
        assert ignored != in_git, path


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_has_metrics_and_plots(stages, name):
    outs = {_relative(out): out for out in stages[name].outs}
    assert outs[f"artifacts/{name}/metrics.json"].metric
    assert any(out.plot for out in outs.values())


@pytest.mark.parametrize("file", ["dvc.yaml", *sorted({e.partition(":")[0] for e in EXAMPLES})])
def test_every_curve_has_a_title_of_what_it_draws(file):
    curves = {
        path: plot
        for stage in yaml.safe_load((ROOT / file).read_text())["stages"].values()
        for plots in stage.get("plots", [])
        for path, plot in (plots.items() if isinstance(plots, dict) else {plots: {}}.items())
        if path.endswith(".csv")
    }
    assert [path for path, plot in curves.items() if "title" not in plot] == []
    density = curves.get("artifacts/fk_dataset/density.csv")
    if density is not None:  # it draws how unevenly the tips lie, before and after thinning, not their density
        assert density["template"] == "lines_by_thinning"
        assert "unevenness" in density["title"]
        assert density["y_label"] == "tips in a cell: standard deviation over mean"


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory):
    pipeline = StubPipeline(tmp_path_factory.mktemp("stub") / "project")
    ran = pipeline.ran("dvc", "repro", "-q")
    assert sorted(ran) == sorted(["demo.record", *(f"stages.{name}" for name in STAGES)])
    pipeline.commit()
    return pipeline


def test_the_rehearsal_runs_when_it_is_asked_for_and_lags_otherwise(pipeline):
    """Its results are to be those it wrote; that the pipeline went on since is no mismatch."""
    assert lock.mismatches(pipeline.folder) == []  # it never ran
    assert pipeline.ran("dvc", "repro", "-q", "rehearsal/dvc.yaml") == ["rehearsal.rehearse"]
    pipeline.commit()
    assert lock.mismatches(pipeline.folder) == []
    pipeline.edit("stages/package_unity.py", lambda text: f"{text}\n# edited\n")
    assert pipeline.ran("dvc", "repro", "-q") == ["stages.package_unity"]
    pipeline.commit()
    assert lock.mismatches(pipeline.folder) == []
    pipeline.edit("artifacts/rehearse/runs.csv", lambda text: f"{text}edited\n")
    (problem,) = lock.mismatches(pipeline.folder)
    assert problem.startswith("rehearse: changed outs: artifacts/rehearse/runs.csv")
    pipeline.restore()
    (pipeline.folder / "rehearsal/dvc.lock").unlink()
    assert "rehearse: never ran" in lock.mismatches(pipeline.folder)
    pipeline.run("git", "reset", "-q", "--hard", "HEAD~2")
    pipeline.run("dvc", "checkout", "-q")


def test_a_comment_reruns_nothing(pipeline):
    for file in ["params.yaml", "demo/params.yaml", *_relative_files(pipeline.folder, "conf")]:
        pipeline.edit(file, lambda text: f"# a comment\n{text}\n# another\n")
    assert pipeline.ran("dvc", "repro", "-q") == []
    pipeline.restore()


@pytest.mark.parametrize("name", ["filter", "identify_damping", "train_ik"])
def test_an_edit_reruns_exactly_what_depends_on_it(pipeline, stages, name):
    """And `dvc exp run -S` makes that edit without touching the comments of params.yaml."""
    before = (pipeline.folder / "params.yaml").read_text()
    key, value = pipeline.tunable(name)
    ran = pipeline.ran("dvc", "exp", "run", "-q", "-S", f"{key}={value + 1}")
    assert sorted(ran) == sorted(f"stages.{stage}" for stage in _and_below(stages, name))
    after = (pipeline.folder / "params.yaml").read_text()
    changed = [(a, b) for a, b in zip(before.splitlines(), after.splitlines(), strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0][0].partition("#")[2].split() == changed[0][1].partition("#")[2].split()
    pipeline.restore()


@pytest.mark.parametrize(
    ("file", "first"),
    [
        ("trunkline/recordings/preparation/motive.py", ["ingest"]),
        ("trunkline/report/figures/identification.py", []),
        ("upkeep/gate.py", []),
        ("docs/identification.md", []),
        ("trunkline/recordings/cleaning/label_swaps.py", ["ingest"]),
        ("trunkline/recordings/filtering/filter.py", ["ingest"]),
        ("trunkline/identification/fit/search.py", ["identify_stiffness", "identify_damping", "identify_control"]),
        ("trunkline/kinematics/dataset/sampling.py", ["report", "fk_dataset", "train_ik", "reachability"]),
        ("trunkline/kinematics/ik/network.py", ["train_ik"]),
        ("trunkline/kinematics/panda/inverse.py", ["report", "reachability"]),
        ("trunkline/report/certificate/budget.py", ["report"]),
        ("trunkline/unity/rules.py", ["package_unity"]),
    ],
)
def test_an_edit_of_code_reruns_the_stages_that_use_it(pipeline, stages, file, first):
    """Stubs write other outputs for other code, so that what is below them runs too; real ones seldom do."""
    pipeline.edit(file, lambda text: f"{text}\n# edited\n")
    expected = {f"stages.{stage}" for name in first for stage in _and_below(stages, name) if "/" not in stage}
    assert sorted(pipeline.ran("dvc", "repro", "-q")) == sorted(expected)
    pipeline.restore()


def test_a_conf_file_reruns_its_stage_and_no_other(pipeline):
    pipeline.edit("conf/package_unity/config.yaml", lambda text: f"{text}\nadded: 1\n")
    assert pipeline.ran("dvc", "repro", "-q") == ["stages.package_unity"]
    pipeline.restore()


def test_the_chosen_plant_s_file_reruns_the_lab_and_its_rig_and_another_s_nothing(pipeline):
    chosen = OmegaConf.load(pipeline.folder / "demo/params.yaml").record.plant
    (other,) = {"cousin", "stranger"} - {chosen}
    pipeline.edit(f"demo/conf/record/plant/{other}.yaml", lambda text: f"{text}\nadded: 1\n")
    assert pipeline.ran("dvc", "repro", "-q") == []
    pipeline.edit(f"demo/conf/record/plant/{chosen}.yaml", lambda text: f"{text}\nadded: 1\n")
    ran = pipeline.ran("dvc", "repro", "-q")
    assert ran[0] == "demo.record"
    assert {"stages.train_ik", "stages.report"} <= set(ran)
    pipeline.restore()


def test_another_torch_reruns_what_it_trains_and_no_other(pipeline, stages):
    pipeline.edit("versions.yaml", lambda text: text.replace('torch: "', 'torch: "1'))
    expected = [f"stages.{stage}" for stage in _and_below(stages, "train_ik")]
    assert sorted(pipeline.ran("dvc", "repro", "-q")) == sorted(expected)
    pipeline.restore()


def test_another_session_leaves_the_stand_in_lab_alone(pipeline):
    (pipeline.folder / "data" / "raw" / "mine").mkdir()
    (pipeline.folder / "data" / "raw" / "mine" / "session.yaml").write_text("trials: []\n")
    pipeline.edit("demo/params.yaml", lambda text: text.replace("record:", "record:\n  added: 1", 1))
    pipeline.edit("params.yaml", lambda text: text.replace("session: demo", "session: mine"))
    ran = pipeline.ran("dvc", "repro", "-q")
    assert "stages.ingest" in ran
    assert "demo.record" not in ran
    pipeline.restore()


def test_a_queued_sweep_runs_every_value(pipeline):
    key, value = pipeline.tunable("train_ik")
    before = (pipeline.folder / "params.yaml").read_text()
    pipeline.run("dvc", "exp", "run", "-q", "--queue", "-S", f"{key}={value + 1},{value + 2}")
    pipeline.run("dvc", "exp", "run", "-q", "--run-all")
    experiments = json.loads(pipeline.run("dvc", "exp", "show", "--json"))
    variants = [e["revs"][0]["data"]["params"]["params.yaml"]["data"] for e in experiments[1]["experiments"]]
    values = sorted(OmegaConf.select(OmegaConf.create(params), key) for params in variants)[-2:]
    assert values == [value + 1, value + 2]
    assert (pipeline.folder / "params.yaml").read_text() == before


@pytest.fixture(params=["folder", "bucket"])
def store(request, tmp_path):
    """A DVC remote: its `url`, and what else `dvc remote modify` is to be told."""
    if request.param == "folder":
        yield {"url": str(tmp_path / "store")}
    else:
        with bucket() as there:
            yield there


def _add_remote(pipeline: StubPipeline, store: dict[str, str]) -> None:
    """As in docs/speed.md, all of it in `.dvc/config.local`."""
    pipeline.run("dvc", "remote", "add", "--local", "-q", "-d", "store", store["url"])
    for option, value in store.items():
        if option != "url":
            pipeline.run("dvc", "remote", "modify", "--local", "-q", "store", option, value)


def test_what_was_pushed_is_pulled_elsewhere_and_not_run_again(pipeline, store, tmp_path):
    """docs/speed.md: the results, and then a session of one's own."""
    make = ("make", "--silent", "--assume-old=setup")  # the environment is there
    _add_remote(pipeline, store)
    pipeline.run(*make, "push")
    there = pipeline.clone(tmp_path / "there")
    missing = {name for name in _outputs(pipeline) if not (there.folder / name).exists()}
    assert {"data/raw/demo", "artifacts/identify_control/arm.xml", "data/processed/fk_dataset"} <= missing
    _add_remote(there, store)
    there.run(*make, "pull")
    assert all(_content(there, name) == _content(pipeline, name) for name in _outputs(pipeline))
    assert there.ran("dvc", "repro", "-q") == []

    session = "data/raw/july"
    (there.folder / session).mkdir()
    (there.folder / session / "release_1.mcap").write_text("poses")
    there.run("dvc", "add", "-q", session)
    there.run(*make, "push")
    there.commit()
    elsewhere = there.clone(tmp_path / "elsewhere")
    assert not (elsewhere.folder / session).exists()
    _add_remote(elsewhere, store)
    elsewhere.run(*make, "pull")
    assert _content(elsewhere, session) == {f"{session}/release_1.mcap": b"poses"}
    assert _content(elsewhere, "data/processed") == _content(pipeline, "data/processed")
    pipeline.run("dvc", "remote", "remove", "--local", "store")


def _outputs(pipeline: StubPipeline) -> list[str]:
    declared = json.loads((pipeline.folder / "stub.json").read_text())
    return [name for stage in declared.values() for name in stage["outs"] if (pipeline.folder / name).exists()]


def _content(pipeline: StubPipeline, name: str) -> dict[str, bytes]:
    """Of a file, or of those in a folder."""
    path = pipeline.folder / name
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    return {file.relative_to(pipeline.folder).as_posix(): file.read_bytes() for file in files}


@pytest.fixture
def clone(pipeline, tmp_path):
    """A fresh clone of the stub pipeline."""
    return pipeline.clone(tmp_path / "clone").folder


def test_lock_of_a_fresh_clone_is_in_order(clone):
    assert not (clone / ".dvc" / "cache").exists()
    assert lock.mismatches(clone) == []
    assert lock.main(clone) == 0


def _set(name, old, new):
    def change(clone):
        text = (clone / name).read_text()
        assert old in text
        (clone / name).write_text(text.replace(old, new, 1))

    return change


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (_set("stages/filter.py", "import stub", "import stub  # edited"), "filter: changed deps: stages/filter.py"),
        (_set("params.yaml", "fk_dataset:", "fk_dataset:\n  added: 1"), "fk_dataset: changed deps: params.yaml"),
        (_set("conf/train_ik/config.yaml", "", "added: 1\n"), "train_ik: changed deps: conf/train_ik/config.yaml"),
        (_set("artifacts/train_ik/metrics.json", "digest", "edited"), "train_ik: changed outs: artifacts/train_ik"),
        (_set("dvc.yaml", "stages/filter.py,", "LICENSE, stages/filter.py,"), "filter: not in the lock file"),
        (_set("dvc.yaml", "-m stages.filter", "-m stages.filter --fast"), "filter: changed command"),
        (lambda clone: (clone / "artifacts/fk_dataset/metrics.json").unlink(), "fk_dataset: changed outs: artifacts"),
        (lambda clone: (clone / "dvc.lock").unlink(), "filter: never ran"),
    ],
)
def test_lock_that_belongs_to_something_else_is_refused(clone, change, problem):
    change(clone)
    assert any(line.startswith(problem) for line in lock.mismatches(clone)), lock.mismatches(clone)
    assert lock.main(clone) == 1


def test_lock_whose_stages_disagree_is_refused(clone):
    locked = yaml.safe_load((clone / "dvc.lock").read_text())
    for out in locked["stages"]["build_mjcf"]["outs"]:
        if out["path"].endswith("arm.xml"):
            out["md5"] = "0" * 32
    (clone / "dvc.lock").write_text(yaml.safe_dump(locked))
    expected = "identify_stiffness: read another artifacts/build_mjcf/arm.xml than build_mjcf wrote"
    assert expected in lock.mismatches(clone)


@pytest.mark.parametrize(("name", "users"), [("torch", ["train_ik"]), ("scikit-image", ["reachability"])])
def test_another_version_in_the_requirements_is_refused_until_its_stages_ran(pipeline, clone, name, users):
    """By `make lock`, so by .ci/run: with versions.yaml left behind, and with it renewed and no new results."""
    file = "requirements-torch.txt" if name == "torch" else "requirements.lock"
    pinned = versions.locked_versions(clone)[name]
    _set(file, f"\n{name}=={pinned}", f"\n{name}==99.0")(clone)
    (problem,) = lock.mismatches(clone)
    assert problem.startswith(f"{name}: versions.yaml names {pinned}, ")
    assert "requirements.lock, requirements-torch.txt pin 99.0" in problem
    assert versions.main(clone) == 0
    problems = lock.mismatches(clone)
    for stage in users:
        assert f"{stage}: changed deps: versions.yaml: {{'{name}': 'modified'}}" in problems, problems
    assert f"{name}: installed {pinned}, versions.yaml names 99.0" in problems
    assert not any(line.startswith("filter: ") for line in problems)


def test_continuous_integration_fails_where_one_of_its_commands_does(clone):
    """.ci/run over the clone's own `make lock`; the other commands pass."""
    targets = {name: "true" for name in ("types", "test", "mutants_sample", "gate")}
    targets["lock"] = f"{sys.executable} -m upkeep.lock"
    (clone / "Makefile").write_text("".join(f"{name}:\n\t@{command}\n" for name, command in targets.items()))

    def ci():
        return subprocess.run([clone / ".ci/run"], capture_output=True, text=True, check=False)

    done = ci()
    assert done.returncode == 0, done.stdout + done.stderr
    pinned = versions.locked_versions(clone)["scipy"]
    _set("requirements.lock", f"\nscipy=={pinned}", "\nscipy==99.0")(clone)
    done = ci()
    assert done.returncode == 1
    assert "lock: FAIL scipy: versions.yaml names" in done.stdout
    assert "== make lock: failed" in done.stdout


def _folder_and_name(address: str) -> tuple[str, str]:
    """("examples/x/", "filter") of examples/x/dvc.yaml:filter, ("", "filter") of filter."""
    file, _, name = address.rpartition(":")
    return file.removesuffix("dvc.yaml"), name


def _relative(entry) -> str:
    return os.path.relpath(entry.fs_path, entry.repo.root_dir)


def _relative_files(folder: Path, below: str) -> list[str]:
    return [str(path.relative_to(folder)) for path in (folder / below).rglob("*.yaml")]


def _and_below(stages, name: str) -> set[str]:
    """The stage and all that read, directly or not, what it writes, of what `dvc repro` runs."""
    below, outs = {name}, {_relative(out) for out in stages[name].outs}
    for other in stages.values():
        if other.addressing not in (name, REHEARSE) and outs & {_relative(dep) for dep in other.deps}:
            below |= _and_below(stages, other.addressing)
    return below


_distributions = cache(packages_distributions)


@cache
def _tree(file: str) -> ast.Module:
    return ast.parse((ROOT / file).read_text())


def _code(stage) -> set[str]:
    """Files of this project that a stage's module imports, directly or not, and the rig that its settings name."""
    folder, name = _folder_and_name(stage.addressing)
    section = OmegaConf.load(ROOT / folder / "params.yaml")[name] or {}
    begins = [module for module in (stage.cmd.split()[-1], section.get("rig")) if module]
    return imported(ROOT, [f"{module.replace('.', '/')}.py" for module in begins])
