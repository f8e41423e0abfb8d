"""Two sessions of one arm through every stage that knows trials, from the first identification to the certificate."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stages import report as report_stage
from stages import score as score_stage
from tests.identification.test_per_session import MOUNTS, mounted
from tests.identification.test_stage import metrics_of, settings, truth_of
from tests.report.certificate.sample import ASKED, INGESTED
from tests.support.matched_plant import begin_project, curl, release, static_pull, tilt
from tests.support.workbench import ROOT
from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.pipeline.identify import CAD_MODEL, misfit, run
from trunkline.pipeline.stage import write_json
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import read_trials, write_trials
from trunkline.tools.evaluate.__main__ import main as evaluate

SCALES = {"stiffness": 0.8, "damping": 1.4, "kp": 0.7}
STAGES = ("identify_stiffness", "identify_damping", "identify_control")
FILTERED = Path("data/processed/filter")


def session_of(truth, session: str, seed: int) -> list:
    arm = mounted(truth, MOUNTS[session])
    trials = []
    for split, angle, pull, bend, level in zip(SPLITS, (60, 45, 75), (20, 15, 10), (0.2, 0.25, 0.3), (30, 40, 50),
                                               strict=True):  # fmt: skip
        more = {"split": split, "noise": 1e-4, "seed": seed + len(trials)}
        trials += [tilt(arm, angle, **more), tilt(arm, angle - 30, **more), static_pull(arm, (pull, 0, 0), **more),
                   release(arm, bend, frames=60, **more), curl(arm, level, frames=60, **more)]  # fmt: skip
    return [replace(trial, session=session, name=f"{session}/{trial.name}") for trial in trials]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """After all stages: its folder, and what the parameters truly are."""
    root = tmp_path_factory.mktemp("two")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("trunkline.identification.fit.intervals.RESAMPLINGS", 500)
        patch.chdir(root)
        model = begin_project(root, 4)
        true = {name: scale * parameter_named(name).read(model) for name, scale in SCALES.items()}
        truth = truth_of(model, **SCALES)
        write_trials(FILTERED, [*session_of(truth, "monday", 0), *session_of(truth, "friday", 50)])
        ranges = {name: (value / 3, 3 * value) for name, value in true.items()}
        mounts = dict.fromkeys(("mount_tilt_x", "mount_tilt_y"), (-0.1, 0.1))
        rested = ["static_tilt", "static_pull"]
        configs = {
            "identify_stiffness": settings(rested, rested, {n: ranges[n] for n in ("stiffness", "kp")} | mounts,
                                           ["stiffness"]),
            "identify_damping": settings(["release"], ["release"], {"damping": ranges["damping"]}),
            "identify_control": settings(["curl"], ["release", "curl", *rested], {"kp": ranges["kp"]}),
        }  # fmt: skip
        before = CAD_MODEL
        for stage, config in configs.items():
            run(stage, replace(config, optimizer=config.fine), before, STAGES[:2] if stage == STAGES[2] else ())
            before = Path("artifacts") / stage / "arm.xml"
        score_stage.main(score_stage.Config(stages=list(STAGES), floor_poses=3))
        for stage, metrics in (("ingest", INGESTED), ("filter", {"gap_share": 0.01})):
            (root / "artifacts" / stage).mkdir()
            write_json(root / "artifacts" / stage / "metrics.json", metrics)
        report_stage.main(report_stage.Config(**vars(ASKED), rig=None))
    return root, true


def test_each_stage_finds_what_both_share(project):
    root, true = project
    for stage, name in zip(STAGES, SCALES, strict=True):
        table = json.loads((root / f"artifacts/{stage}/parameters.json").read_text())
        assert table["parameters"][name]["value"] == pytest.approx(true[name], rel=0.03)
        assert ("per_session" in table) == (stage == "identify_stiffness")


def test_every_model_but_that_of_the_drawing_knows_both_mounts(project):
    """Of trials that no fit has seen, and of the arm with all scalars and no joint's own factor."""
    root, _ = project
    for stage in STAGES:
        metrics = metrics_of(root, stage)
        assert metrics["identified"]["validate"]["e_position_mm"] < 1
        assert metrics["coarse"]["validate"]["e_position_mm"] < 1
        assert metrics["cad"]["validate"]["e_position_mm"] > 3


def test_the_score_is_as_good_in_each_session(project):
    root, _ = project
    scored = pd.read_csv(root / "artifacts/score/trials.csv")
    last = scored[(scored.stage == STAGES[2]) & (scored.model == "identified")]
    means = last.groupby(last.trial.str.partition("/")[0]).e_position_mm.mean()
    assert set(means.index) == set(MOUNTS)
    assert means.max() < 1
    assert (root / "artifacts/score/errors.png").stat().st_size > 10_000


def test_the_certificate_tells_of_both_and_whose_mount_it_is_for(project):
    root, _ = project
    facts = json.loads((root / "artifacts/report/facts.json").read_text())
    recorded = facts["session"]["recorded"]
    assert [line for line in recorded if line.startswith("friday: static tilts: 2 identify, 2 validate")]
    assert len(recorded) == 2 * 4
    assert facts["uncertainty"]["held_out_trials"] == 6  # of both
    assert facts["uncertainty"]["lacking_pct"]["of_what_gravity_moves"] < 0.5  # were it one mount: a tenth and more
    page = (root / "artifacts/report/certificate.html").read_text()
    assert "It is of the arm as it was mounted in the session monday." in page
    assert "mount_tilt_x@friday" in page


@pytest.fixture
def later(project, tmp_path, monkeypatch):
    """A copy of the project with settings, to work in."""
    shutil.copytree(project[0], tmp_path, dirs_exist_ok=True)
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_evaluate_tells_of_each_session_and_knows_one_alone(later, capsys):
    model = "artifacts/identify_control/arm.xml"
    assert evaluate([model, f"{FILTERED}"]) == 0
    output = capsys.readouterr().out
    assert output.index("\nsession monday\n") < output.index("\nsession friday\n")
    whole = json.loads((later / "evaluation/filter/metrics.json").read_text())
    for session in MOUNTS:
        assert whole["by_session"][session]["model"]["trials"] == 15
        assert whole["by_session"][session]["model"]["e_position_mm"] < 1
    alone = [replace(t, session="", name=t.name.removeprefix("friday/")) for t in read_trials(FILTERED, SPLITS)
             if t.session == "friday"]  # fmt: skip
    folder = later / "friday"
    folder.mkdir()
    write_trials(folder, alone)
    assert evaluate([model, "friday"]) == 0
    assert "evaluate: the session friday of those that the model was fitted to" in capsys.readouterr().out
    friday = json.loads((later / "evaluation/friday/metrics.json").read_text())
    assert friday["model"] == whole["by_session"]["friday"]["model"]


def test_another_session_of_the_same_name_is_doubted(later, capsys):
    trials = [replace(t, positions=t.positions + 1e-5 * np.arange(3)) for t in read_trials(FILTERED, SPLITS)]
    write_trials(FILTERED, trials)
    assert evaluate(["artifacts/identify_stiffness/arm.xml", f"{FILTERED}"]) == 0
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("evaluate: warning: session friday: the model has numbers for a session of that name")


def test_a_fit_far_from_what_it_was_fitted_to_is_said_or_refused():
    errors = {"release": {"e_position_mm": 9.6, "e_position_pct": 4.0}, "curl": {"e_position_mm": 99.0,
              "e_position_pct": 41.0}}  # fmt: skip
    assert misfit(errors, ["release"]) == ""
    errors["release"] = {"e_position_mm": 24.0, "e_position_pct": 10.0}
    assert misfit(errors, ["release"]).startswith("after the fit, bodies are 24 mm off in the mean of releases, 10 %")
    with pytest.raises(InputError, match="99 mm off in the mean of curls, 41 % of the arm's length, expected at most"):
        misfit(errors, ["release", "curl"])
