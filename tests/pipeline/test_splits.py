"""The split test is read by the stage `score` alone, and moves no number of any other."""

import ast
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml

from stages import filter as filter_stage
from stages import score as score_stage
from tests.identification.test_stage import settings
from tests.support.folders import ROOT, TABLE_OF_NOTHING
from tests.support.matched_plant import begin_project, curl, mjcf_of, release, small_model, tilt
from tests.support.sessions import all_truths, instruments, record, static_truth
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import run
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.filtering.filter import Filter
from trunkline.recordings.session.session import read_session
from trunkline.recordings.trials.raw_trial import write_raw_trials
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, SPLITS, TEST, VALIDATE
from trunkline.recordings.trials.trial import Trial, read_trials, write_trials

FOLDERS = ("trunkline", "stages", "studies", "benchmarks", "qualification", "examples", "demo")
READERS = {"filter", "identify_stiffness", "identify_damping", "identify_control", "score", "report", "train_ik"}
# who may name the split test, or all splits, and for what
MAY_NAME = {
    "demo/laboratory.py": {"TEST"},  # records it
    "stages/filter.py": {"SPLITS"},  # filters every trial for itself
    "stages/score.py": {"TEST"},  # reads it
    "trunkline/tools/evaluate/session.py": {"SPLITS"},  # the whole of any session, for a user who asks for it
    "trunkline/identification/evaluation/evaluation.py": {"SPLITS"},  # sorts what it is given
    "trunkline/recordings/cleaning/session_checks.py": {"SPLITS", "TEST"},  # says which of them a session lacks
    "trunkline/identification/results/scoring.py": {"TEST"},  # what the stage `score` calls
    "trunkline/recordings/trials/inventory.py": {"SPLITS"},  # counts its trials
    "examples/asl_motion/session.py": {"TEST"},  # writes it into session.yaml
    "examples/asl_trunk/session.py": {"TEST"},  # likewise
    "examples/ftdcr/session.py": {"TEST"},  # likewise
    "examples/pairs/session.py": {"TEST"},  # likewise
    "studies/families.py": {"TEST"},  # shows it, of arms by which nothing is chosen
    "studies/trial_worth.py": {"TEST"},  # likewise
    "trunkline/ar/session/measured_session.py": {"TEST"},  # deals a measured session's plans to the splits
    "trunkline/tools/batch/results.py": {"TEST"},  # shows its errors, as `score` wrote them
    "upkeep/limits.py": {"TEST"},  # refuses rows of it
    "upkeep/readme.py": {"TEST"},  # shows it
    "upkeep/truth_table.py": {"TEST"},  # shows it
}
# who says the same words of something else: the network's samples are split too; `identify` is also a function
OTHERWISE = ("trunkline/kinematics/dataset/", "trunkline/kinematics/ik/", "trunkline/report/figures/network.py")


def files() -> dict[str, ast.Module]:
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    return {path.relative_to(ROOT).as_posix(): ast.parse(path.read_text(encoding="utf-8")) for path in paths}


def test_the_splits_are_named_in_one_place():
    """No other module of the data's way types a split's name, and no other than these names the split test."""
    for name, tree in files().items():
        if name == "trunkline/recordings/trials/splits.py":
            continue
        imported = {
            alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module == "trunkline.recordings.trials.splits"
            for alias in node.names
        }
        assert imported & {"TEST", "SPLITS"} == MAY_NAME.get(name, set()), name
        typed = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)} & {IDENTIFY, VALIDATE, TEST}
        if not name.startswith(OTHERWISE):
            assert not typed, name


def test_whoever_reads_trials_says_which_and_of_the_stages_only_score_says_test():
    calls = [
        (name, ast.unparse(node.args[1]))
        for name, tree in files().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("read_trials", "read_raw_trials")
    ]
    assert {(name, splits) for name, splits in calls if splits != "DECIDING"} == {
        ("stages/filter.py", "SPLITS"),
        ("stages/score.py", "(IDENTIFY, TEST)"),
        ("trunkline/tools/evaluate/session.py", "SPLITS"),
    }
    assert len(calls) >= 4
    assert TEST not in DECIDING


def test_no_other_stage_depends_on_trials():
    for file in (ROOT / "dvc.yaml", *(ROOT / "examples").glob("*/dvc.yaml")):
        stages = yaml.safe_load(file.read_text())["stages"]
        folders = {"data/processed/ingest", "data/processed/filter"}
        others = {name for name, stage in stages.items() if folders & set(stage["deps"])} - READERS
        assert not others, f"{file.name}: {others} read trials; READERS names who does, and asks for no `test`"


def test_trials_come_only_for_the_splits_that_are_asked_for(tmp_path):
    model = small_model(4)
    write_trials(tmp_path, [tilt(model, 30, split) for split in SPLITS])
    for split in SPLITS:
        assert [trial.split for trial in read_trials(tmp_path, (split,))] == [split]
    with pytest.raises(TypeError):
        read_trials(tmp_path)  # type: ignore[call-arg]


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with a model; trials of all splits come from a model with other parameters."""
    monkeypatch.chdir(tmp_path)
    model = begin_project(tmp_path, 4)
    return tmp_path, model


def trials_of(model) -> list[Trial]:
    swings = [(0.2, IDENTIFY), (0.3, IDENTIFY), (0.25, VALIDATE), (0.35, TEST)]
    return [
        *(tilt(model, angle, split) for angle, split in ((30, IDENTIFY), (60, IDENTIFY), (45, VALIDATE), (75, TEST))),
        *(release(model, bend, split, frames=40) for bend, split in swings),
        *(curl(model, level, split, frames=40) for level, split in ((30, IDENTIFY), (40, VALIDATE), (50, TEST))),
    ]


def poisoned(trial: Trial) -> Trial:
    """What would wreck every mean, fit and figure that it got into."""
    broken = np.full_like(trial.positions, 1e6)
    return replace(trial, positions=broken, gravity=-9 * trial.gravity, start=-5.0, name=f"poison_{trial.name}")


def test_poison_in_the_split_test_moves_no_bit_of_an_identification_stage(project):
    root, model = project
    stages = {
        "identify_stiffness": settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.5, 8.0)}, ["stiffness"]),
        "identify_damping": settings(["release"], ["release"], {"damping": (0.01, 1.0)}),
        "identify_control": settings(["curl"], ["release", "curl"], {"kp": (500.0, 4000.0)}),
    }
    written = {}
    for poison in (False, True):
        trials = [poisoned(t) if poison and t.split == TEST else t for t in trials_of(model)]
        write_trials(root / "data/processed/filter", trials)
        before = root / "artifacts/build_mjcf/arm.xml"
        for stage, config in stages.items():
            config = replace(config, optimizer=config.fine, rest_shape="unchanged")
            run(stage, config, before)
            before = root / "artifacts" / stage / "arm.xml"
            written[stage, poison] = {file.name: file.read_bytes() for file in before.parent.iterdir()}
            assert TEST not in json.loads(written[stage, poison]["metrics.json"])["identified"]
    for stage in stages:
        assert written[stage, True] == written[stage, False], stage


def test_poison_in_the_split_test_moves_no_bit_of_the_other_filtered_trials(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = load_config(Filter, "filter", ROOT)
    record(tmp_path / "raw", [*all_truths(), replace(static_truth(30.0), split=TEST)], instruments())
    limits = load_config(__import__("stages.ingest").ingest.Config, "ingest", ROOT).limits
    raw_trials = [raw for _, raw, _ in load_raw_trials(tmp_path / "raw", read_session(tmp_path / "raw"), limits)]
    results = []
    for shift in (0.0, 1e3):
        moved = [
            replace(raw, positions=raw.positions + shift) if raw.split == TEST else raw
            for raw in raw_trials
        ]
        filter_stage.INGEST.mkdir(parents=True, exist_ok=True)
        write_raw_trials(filter_stage.INGEST, moved)
        filter_stage.main(config)
        results.append(read_trials(filter_stage.PROCESSED, DECIDING))
    assert len(results[0]) == 4
    for trial, other in zip(*results, strict=True):
        for key, value in vars(trial).items():
            np.testing.assert_array_equal(value, getattr(other, key), err_msg=key)


@pytest.fixture
def scored(project):
    """Models of two stages: the one of the trials, and another; and what `score` made of them."""
    root, truth = project
    wrong = truth.__copy__()
    wrong.jnt_stiffness[:] *= 0.5
    trials = [replace(t, repairs=int(t.split == TEST and t.experiment == "release")) for t in trials_of(truth)]
    write_trials(root / "data/processed/filter", trials)
    compared = {"identify_stiffness": ["static_tilt"], "identify_damping": ["release", "static_tilt"]}
    for stage, model in (("identify_stiffness", wrong), ("identify_damping", truth)):
        folder = root / "artifacts" / stage
        folder.mkdir()
        (folder / "arm.xml").write_text(mjcf_of(model))
        settings = {"experiments": compared[stage], "frames": 40, "command_delay": 0.0}
        table = TABLE_OF_NOTHING | {"compared": settings}
        (folder / "parameters.json").write_text(json.dumps(table))
    config = score_stage.Config(stages=list(compared), floor_poses=3)
    score_stage.main(config)
    return root, config, json.loads((root / "artifacts/score/metrics.json").read_text())


def test_score_tells_the_right_model_from_a_wrong_one_and_from_none(scored):
    _, _, metrics = scored
    damping = metrics["identify_damping"]
    right, wrong, null = (damping[name]["test"] for name in ("identified", "initial", "null"))
    for key in ("e_position_mm", "e_tip_mm", "e_tip_pct"):
        assert right[key] < 0.2 * wrong[key], key
        assert right[key] < 0.1 * null[key], key
    assert set(right["by_experiment"]) == {"release", "static_tilt"}
    assert right["trials"] == 2
    assert 0 < damping["noise_floor_mm"] < 0.5 < null["e_position_mm"]
    stiffness = metrics["identify_stiffness"]
    assert stiffness["identified"]["test"]["e_position_mm"] == wrong["by_experiment"]["static_tilt"]["e_position_mm"]
    assert list(stiffness["identified"]["test"]["by_experiment"]) == ["static_tilt"]


def test_errors_come_with_and_without_repaired_trials(scored):
    _, _, metrics = scored
    scores = metrics["identify_damping"]["identified"]["test"]
    assert scores["repaired"] == 1
    assert scores["without_repaired"]["e_position_mm"] == scores["by_experiment"]["static_tilt"]["e_position_mm"]
    only = metrics["identify_stiffness"]["identified"]["test"]
    assert only["repaired"] == 0
    assert "without_repaired" not in only


def test_a_row_of_an_intermediate_model_says_so(scored):
    root, _, _ = scored
    for name in ("trials", "markers"):
        stages = list(dict.fromkeys(pd.read_csv(root / f"artifacts/score/{name}.csv").stage))
        assert stages == ["identify_stiffness (intermediate model)", "identify_damping"]


def test_a_kind_on_which_the_shipped_model_is_not_scored_is_named(scored, capsys):
    """Whether an intermediate model was scored on it does not count."""
    _, config, _ = scored
    score_stage.main(replace(config, stages=config.stages[::-1]))
    assert "score: release: not in `reported` of identify_stiffness" in capsys.readouterr().out
    score_stage.main(config)
    assert [line for line in capsys.readouterr().out.splitlines() if "not in `reported`" in line] == [
        "score: curl: not in `reported` of identify_damping, so the shipped model is not scored on it"
    ]


def test_a_session_without_the_split_test_is_told_so(scored, capsys):
    root, config, _ = scored
    retained = read_trials(root / "data/processed/filter", DECIDING)
    write_trials(root / "data/processed/filter", retained)
    score_stage.main(config)
    assert "identify_stiffness: found no static_tilt with split test" in capsys.readouterr().out
    assert json.loads((root / "artifacts/score/metrics.json").read_text())["identify_stiffness"] == {}
