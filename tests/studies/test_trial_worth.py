"""The study of what kinds of trial are worth: what is left out is what its name says, and `test` stays whole."""

import pytest
from omegaconf import OmegaConf

from studies.families import PIPELINE, write_settings
from studies.trial_worth import ARMS, BY_PULLS, LEFT_OUT, SESSION, leave_out, record_arm, worth_table
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import check_settings, settings_of
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE
from trunkline.settings import read_yaml

KINDS = ("static_tilt", "release", "curl", "static_pull", "motion")


def recorded(folder):
    """A session with a trial of each kind and split, each with and without a load."""
    write_settings(folder, {"plant": "cousin"})
    (folder / SESSION).mkdir(parents=True)
    trials = []
    for kind in KINDS:
        for split in (IDENTIFY, VALIDATE, TEST):
            for load in ({}, {"load": 0.02}):
                name = f"{kind}_{split}_{len(load)}.mcap"
                (folder / SESSION / name).touch()
                trials.append({"file": name, "experiment": kind, "split": split} | load)
    OmegaConf.save({"trials": trials}, folder / SESSION / "session.yaml")


@pytest.mark.parametrize("left", LEFT_OUT)
def test_what_is_left_out_is_gone_but_for_test_and_the_stages_settings_fit(tmp_path, left):
    recorded(tmp_path)
    leave_out(tmp_path, LEFT_OUT[left])
    trials = read_yaml(tmp_path / SESSION / "session.yaml").trials
    assert {trial.file for trial in trials} == {path.name for path in (tmp_path / SESSION).glob("*.mcap")}
    assert sum(trial.split == TEST for trial in trials) == 2 * len(KINDS)
    learnt = [trial for trial in trials if trial.split != TEST]
    gone = {kind for kind in KINDS if kind not in {trial.experiment for trial in learnt}}
    assert gone == set(LEFT_OUT[left]) - {"loaded"}
    assert any("load" in trial for trial in learnt) == ("loaded" not in LEFT_OUT[left])
    assert set(check_settings(tmp_path)) == set(PIPELINE)
    for stage in STAGES:
        used, committed = (settings_of(stage, *folder).experiments for folder in ([tmp_path], []))
        assert set(used) == set(committed) - gone
    stiffness = read_yaml(tmp_path / "params.yaml").identify_stiffness
    by_pulls = "static_pull" not in gone
    assert (stiffness.source == "statics", "kp" in stiffness.parameters) == (by_pulls, by_pulls)


def test_what_is_set_without_pulls_is_what_the_stage_says():
    words = EXPERIMENTS["static_pull"].without
    assert "`source: tilts` under identify_stiffness" in words
    assert all(f"`{name}`" in words for name in BY_PULLS)


@pytest.mark.parametrize(("plant", "by"), [("cousin", "run"), ("helix", "record")])
def test_a_plant_of_the_lab_is_recorded_as_it_is_and_another_is_drawn(tmp_path, monkeypatch, plant, by):
    calls = []
    monkeypatch.setattr("studies.trial_worth.run", lambda *args: calls.append("run"))
    monkeypatch.setattr("studies.trial_worth.record", lambda *args: calls.append("record"))
    record_arm(tmp_path, plant, 7)
    assert calls == [by]
    assert (tmp_path / "params.yaml").is_file() == (by == "run"), "`record` writes its settings itself"
    assert plant in dict(ARMS.values())


def test_the_table_has_errors_by_kind_and_names_what_was_refused():
    errors = {f"{of}_{error}": size for of in ("every", *KINDS) for error, size in (("position", 0.5), ("tip", 1.25))}
    counts = {"held": 3, "intervals": 4, "seconds": 60.0}
    rows = {"an arm: none": errors | counts | {"refused": "no"}, "an arm: curls": counts | {"refused": "filter"}}
    lines = worth_table(rows).splitlines()
    assert lines[2] == f"| an arm | none |{' 0.5 / 1.25 |' * 6} 3 of 4 |"
    assert lines[3].startswith("| an arm | curls | refused by filter |")
    assert len({line.count("|") for line in lines[:4]}) == 1
    assert lines[-1].endswith("1 min a row.")
