"""`trunkline evaluate`: any model against any session, and what it refuses in one line."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

from demo.recorder import write_log
from tests.identification.test_stage import settings
from tests.support.folders import ROOT
from tests.support.matched_plant import curl, mjcf_of, release, small_model, tilt
from tests.support.sessions import MARKERS, all_truths, instruments, record
from tests.support.workbench import workbench
from trunkline.errors import InputError
from trunkline.pipeline.identify import run
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import read_trials, write_trials
from trunkline.tools.evaluate.__main__ import main
from trunkline.tools.evaluate.session import trials_of
from trunkline.twin.twin import Twin


def write_model(path: Path, model: mujoco.MjModel) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(mjcf_of(model))


def softer() -> mujoco.MjModel:
    model = small_model(4)
    model.jnt_stiffness[:] *= 0.7
    return model


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A project with the right model, a softer one, and filtered trials of every kind and split."""
    root = tmp_path_factory.mktemp("made")
    (root / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    model = small_model(4)
    trials = [
        *(tilt(model, angle, split) for angle, split in ((30, "identify"), (60, "identify"), (45, "validate"))),
        *(release(model, bend, split, 40) for bend, split in ((0.2, "identify"), (0.3, "validate"), (0.25, "test"))),
        curl(model, 40, "test", frames=60),
    ]
    folder = root / "data/processed/filter"
    folder.mkdir(parents=True)
    write_trials(folder, trials)
    write_model(root / "artifacts/build_mjcf/arm.xml", softer())
    write_model(root / "right/arm.xml", model)
    return root


@pytest.fixture
def lab(made, tmp_path, monkeypatch):
    """A copy of it to work in, its right model, and its trials."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path, tmp_path / "right/arm.xml", tmp_path / "data/processed/filter"


def evaluate(*words) -> int:
    return main([str(word) for word in words])


def test_it_prints_and_writes_every_trial_beside_what_its_errors_stand_beside(lab, capsys):
    root, right, folder = lab
    assert evaluate(right, folder, "--cad", root / "artifacts/build_mjcf/arm.xml") == 0
    out = root / "evaluation/filter"
    assert {p.name for p in out.iterdir()} == {
        "metrics.json",
        "trials.csv",
        "markers.csv",
        "errors.png",
        "markers.png",
    }
    metrics = json.loads((out / "metrics.json").read_text())
    identified, cad, null = (metrics[name] for name in ("model", "cad", "null"))
    assert identified["trials"] == 7
    for kind in ("static_tilt", "release", "curl"):
        for error in ("e_position_mm", "e_tip_mm"):
            error_of_model = identified["by_experiment"][kind][error]
            assert error_of_model < 0.3 * cad["by_experiment"][kind][error]
            assert error_of_model < 0.1 * null["by_experiment"][kind][error]
    assert "static_tilt" not in metrics["null_held"]["by_experiment"]
    table = pd.read_csv(out / "trials.csv")
    assert set(table.split) == set(SPLITS)
    nulls = {"null: mean rest shape", "null: straight arm", "null: start held"}
    assert set(table.model) == {"model", "CAD", "noise floor"} | nulls
    printed = capsys.readouterr().out
    for name in table.trial.unique():
        assert f"\n{name} " in printed
    assert "the model was fitted to" not in printed  # nothing lies beside it that knows


def test_an_arm_that_aged_shows_against_a_reference(lab, capsys):
    root, right, folder = lab
    evaluate(right, folder, "--out", root / "july")
    old = read_trials(folder, SPLITS)
    aged = softer()
    new = [tilt(aged, trial.level, trial.split) if trial.experiment == "static_tilt" else trial for trial in old]
    write_trials(folder, new)
    capsys.readouterr()
    assert evaluate(right, folder, "--out", root / "august", "--reference", root / "july") == 0
    printed = capsys.readouterr().out
    changes = {line.split()[0]: line for line in printed.partition("change of")[2].splitlines() if "→" in line}
    before, now = (
        json.loads((root / month / "metrics.json").read_text())["model"]["by_experiment"]
        for month in ("july", "august")
    )
    assert now["static_tilt"]["e_tip_mm"] > 10 * before["static_tilt"]["e_tip_mm"]
    assert f"→ {now['static_tilt']['e_tip_mm']:.3g} mm" in changes["static_tilt"]
    assert changes["release"].count("(+0 %)") == 3
    assert "another model" not in printed
    evaluate(
        root / "artifacts/build_mjcf/arm.xml", folder, "--out", root / "x", "--reference", root / "july/metrics.json"
    )
    assert "the reference is of another model" in capsys.readouterr().out


def test_trials_that_the_model_was_fitted_to_are_marked_and_another_session_s_are_not(lab, capsys):
    root, _, folder = lab
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.5, 8.0)})
    run("identify_stiffness", replace(config, optimizer=config.fine), root / "artifacts/build_mjcf/arm.xml")
    model_path = root / "artifacts/identify_stiffness/arm.xml"
    evaluate(model_path, folder)
    printed = capsys.readouterr().out
    assert "the model was fitted to these 2 of 7 trials" in printed
    assert "\ntilt_30_identify *" in printed
    assert "\ntilt_45_validate *" not in printed
    later = root / "artifacts/identify_damping"  # goes on from this model, with trials of its own
    shutil.copytree(model_path.parent, later)
    table = json.loads((later / "parameters.json").read_text()) | {"fitted_to": {}}
    (later / "parameters.json").write_text(json.dumps(table))
    evaluate(later / "arm.xml", folder)
    assert "the model was fitted to these 2 of 7 trials" in capsys.readouterr().out
    write_trials(folder, [replace(t, positions=t.positions + 1e-4) for t in read_trials(folder, SPLITS)])
    evaluate(model_path, folder)
    assert "was fitted" not in capsys.readouterr().out


def test_what_is_said_of_logs_begins_with_who_asked_and_names_repairs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(workbench(tmp_path))
    folder = tmp_path / "data/raw/demo"
    measured = next(m for m in record(folder, all_truths(), instruments()) if m.name == "release_a")
    for values in (measured.positions, measured.quaternions):
        values[60:110, [1, 2]] = values[60:110, [2, 1]]
    write_log(folder / "release_a.mcap", measured)
    trials_of(folder, tmp_path, "ask")
    output, errors = capsys.readouterr()
    assert all(line.startswith("ask: ") for line in (output + errors).splitlines())
    (line,) = [line for line in errors.splitlines() if "taken for each other" in line]
    first, second = MARKERS[:2]
    assert line.startswith(f"ask: repaired: release_a: {first!r} and {second!r} were taken for each other in ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.xml", "data/processed/filter"], "nowhere.xml: no such file, expected"),
        (["right/arm.xml", "data/raw/july"], "data/raw/july: no such folder, expected a session"),
        (["right/arm.xml", "data/processed/filter", "--out", "right"], "--out: right: found other files in it"),
        (
            ["right/arm.xml", "data/processed/filter", "--reference", "right"],
            "--reference: right/metrics.json: no such",
        ),
        (["right/arm.xml", "data/processed/filter", "--settings", "right"], "right/params.yaml: no such file"),
        (["bare.xml", "data/processed/filter"], "bare.xml: found no site 'base_center', expected one in the mount"),
        (["renamed.xml", "data/processed/filter"], "markers: trial tilt_30_identify: found 'unit_02', expected names"),
        (["cables.xml", "data/processed/filter"], "tendons: trial tilt_30_identify: found 'tendon_2', expected names"),
        (["broken.xml", "data/processed/filter"], "broken.xml: not a model that MuJoCo reads"),
    ],
)
def test_a_mistake_is_one_line_and_nothing_is_written(lab, capsys, words, message):
    root, right, _ = lab
    text = right.read_text()
    (root / "bare.xml").write_text("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
    (root / "renamed.xml").write_text(text.replace("unit_02_center", "link_02_center"))
    (root / "cables.xml").write_text(text.replace('"tendon_2"', '"cable_2"'))
    (root / "broken.xml").write_text("<mujoco>")
    assert evaluate(*words) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.strip().count("\n") == 0
    assert not (root / "evaluation").exists()


def test_a_mount_may_be_tilted_as_it_is_identified_but_not_be_another_frame(lab, tmp_path):
    _, right, _ = lab
    for degrees, message in ((5, None), (90, "turned by 90.0°, expected it in the world's origin")):
        spec = mujoco.MjSpec.from_file(str(right))
        spec.body("base").quat = [np.cos(np.radians(degrees) / 2), np.sin(np.radians(degrees) / 2), 0, 0]
        (tmp_path / "arm.xml").write_text(spec.to_xml())
        if message is None:
            assert Twin.load(tmp_path / "arm.xml").arm.model.nq
        else:
            with pytest.raises(InputError, match=message):
                Twin.load(tmp_path / "arm.xml")


def test_a_reference_is_not_written_over(lab, capsys):
    _, right, folder = lab
    evaluate(right, folder)
    assert evaluate(right, folder, "--reference", "evaluation/filter") == 1
    assert "found the reference there, expected another folder" in capsys.readouterr().err
