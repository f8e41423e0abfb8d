"""The study of families: the project's settings, sealed arms that follow the code, and a table of mean and worst."""

import json
from contextlib import nullcontext

import pytest

from demo.families import families
from demo.record import Config
from studies.families import PIPELINE, arms, cells, family_table, record, set_up
from studies.recovery import run
from tests.support.folders import TABLE_OF_NOTHING
from trunkline.errors import InputError
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import check_settings, load_config, settings_of
from trunkline.pipeline.stage import write_json
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import TEST
from upkeep.readme import headline
from upkeep.truth_table import TRUTH


def test_an_arm_is_identified_by_the_project_s_settings_and_scored_on_every_kind(tmp_path):
    set_up(tmp_path, "oval", 1)
    assert set(check_settings(tmp_path)) == set(PIPELINE)
    for stage in PIPELINE:
        ours, committed = settings_of(stage, tmp_path), settings_of(stage)
        if stage == STAGES[-1]:
            assert set(ours.reported) == set(EXPERIMENTS)
            ours.reported = committed.reported
        assert repr(ours) == repr(committed), "classes of a stage are made anew"
    lab = load_config(Config, "record", tmp_path / "demo")
    assert all([lab.experiments.pulls, lab.experiments.motions, lab.experiments.loads])


@pytest.mark.parametrize("diverged", [0, 2, 3])
def test_a_simulation_that_diverges_is_repeated_with_finer_steps(tmp_path, monkeypatch, diverged):
    steps = []

    def recorded(module, folder):
        steps.append(load_config(Config, "record", folder / "demo").plant.substeps)
        if len(steps) <= diverged:
            raise InputError("diverged")

    monkeypatch.setattr("studies.families.run", recorded)
    with pytest.raises(InputError) if diverged == 3 else nullcontext():
        record(tmp_path, "oval", 1)
    assert steps == [4, 8, 16][: diverged + 1]


def test_sealed_arms_follow_the_code_and_open_ones_do_not():
    some, same, other = (arms(code, 2, 5) for code in ("a", "a", "b"))
    assert some == same
    assert list(some) == list(other)
    for name, (family, seed) in some.items():
        assert (other[name] == (family, seed)) == ("sealed" not in name)
    assert sum("sealed" in name for name in some) == 5
    assert {family for family, _ in some.values()} == set(families())
    assert {family for name, (family, _) in some.items() if "sealed" in name} == set(families())


def written(folder, position: float, tip: float):
    """What stages leave of an arm: errors of the last model, a null model, and three intervals."""
    kinds = {"curl": {"e_position_pct": position, "e_tip_pct": tip}}
    of = {"e_position_pct": position / 2, "e_tip_pct": tip / 2, "by_experiment": kinds}
    write = {"artifacts/score/metrics.json": {STAGES[-1]: dict.fromkeys(("identified", "null"), {TEST: of})}}
    row = {"undetermined": False, "unit": ""}
    intervals = {"kp": [1.0, 3.0], "kv": [1.0, 3.0], "hardening": [1.0, 3.0]}
    tables = {name: row | {"value": 2.0, "interval_95_given_model": span} for name, span in intervals.items()}
    write |= {f"artifacts/{stage}/parameters.json": TABLE_OF_NOTHING | {"parameters": tables} for stage in STAGES}
    truth = {"kp": 2.0, "kv": 4.0, "hardening": None}
    write[str(TRUTH)] = {"parameters": truth, "forces": [], "mass_factor": 1.0}
    for name, content in write.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(json.dumps(content))


def test_a_row_has_the_last_model_s_errors_and_counts_intervals_that_have_a_truth(tmp_path):
    written(tmp_path, 0.5, 2.0)
    row = cells(tmp_path)
    assert (row["curl_position"], row["curl_tip"], row["curl_null_tip"]) == (0.5, 2.0, 2.0)
    assert (row["every_position"], row["every_tip"]) == (0.25, 1.0)
    assert (row["held"], row["intervals"]) == (1, 2)
    path = tmp_path / f"artifacts/{STAGES[-1]}/parameters.json"
    table = json.loads(path.read_text())
    table["parameters"]["kv"]["interval_95"] = [1.0, 5.0]
    path.write_text(json.dumps(table))
    assert cells(tmp_path)["held"] == 2, "with what the model fixes"


@pytest.mark.parametrize("with_rows", [False, True])
def test_the_table_has_mean_and_worst_and_the_readme_shows_its_last_row(tmp_path, with_rows):
    rows = []
    for arm, family, error in (("oval 1", "oval", 1.0), ("oval sealed 1", "oval", 3.0), ("helix 1", "helix", 8.0)):
        written(tmp_path, error, 2 * error)
        sealed = "yes" if "sealed" in arm else "no"
        rows.append({"arm": arm, "family": family, "sealed": sealed} | cells(tmp_path) | {"seconds": 60.0})
    refused = {"arm": "oval 2", "family": "oval", "sealed": "no", "held": 0, "intervals": 0, "refused": "filter"}
    rows.append(refused | {"seconds": 60.0})
    lines = family_table(rows).splitlines()
    assert "| oval | 2 | curls | 2 | 3 | 4 | 6 | 4 |" in lines
    assert "| every | 3 | curls | 4 | 8 | 8 | 16 | 8 |" in lines
    assert "| every | 3 | all | 2 | 4 | 4 | 8 | 4 |" in lines
    assert any("3 of 6; worst arm 1 of 2" in line for line in lines)
    assert "Sessions that are refused, and shall not be: oval 2 by filter." in lines
    assert lines[-1] == "1 of 4 arms sealed; 1 min an arm."
    assert "hold the truth: 0 of 0." in family_table(rows[-1:])
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/limits.yaml").write_text("rehearse: {reach.rate: {min: 0.5}}\n")
    (tmp_path / "docs/results").mkdir(parents=True)
    if with_rows:
        result = {"command": "python -m studies.families", "commit": "abc", "code": {}, "lines": lines}
        write_json(tmp_path / "docs/results/families.json", result)
    text = headline(tmp_path)
    assert ("3 simulated arms" in text) == with_rows
    shown = "| **mean 2 / 4 %, worst arm 4 / 8 %**; **1 more refused** | baseline: mean rest shape, tip 4 % |"
    assert (shown in text) == with_rows


@pytest.mark.parametrize(
    ("code", "error"), [("sys.exit(1)", InputError), ("os.kill(os.getpid(), 9)", ChildProcessError)]
)
def test_a_stage_that_was_killed_is_no_refusal(tmp_path, monkeypatch, code, error):
    (tmp_path / "stage_of_a_test.py").write_text(f"import os, sys\n{code}\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(error):
        run("stage_of_a_test", tmp_path)
