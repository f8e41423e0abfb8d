"""A new twin takes the old one's place only where it replays both sessions; whatever fails, the old one stays."""

import json
import os
import shutil
from dataclasses import replace

import pytest

from tests.support.folders import ROOT, TABLE_OF_NOTHING
from tests.support.matched_plant import release, small_model, tilt
from tests.support.small_arm import small_spec
from trunkline.identification.parameters.saving import save_model
from trunkline.identification.results.scoring import fingerprint
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import read_trials, write_trials
from trunkline.tools.promote import __main__ as promotion
from trunkline.tools.promote.__main__ import main


def arm(stiffness: float):
    model = small_model(4)
    model.jnt_stiffness[:] *= stiffness
    return model


def write_twin(folder, stiffness: float, fitted_to=None):
    spec, model = small_spec(4), arm(stiffness)
    spec.option.timestep = model.opt.timestep
    spec.compile()
    stage = folder / "identify_stiffness"
    stage.mkdir(parents=True)
    (stage / "arm.xml").write_text(save_model(spec, model))
    compared = {"experiments": [], "frames": 40, "command_delay": 0.0}
    table = TABLE_OF_NOTHING | {"compared": compared, "fitted_to": fitted_to or {}}
    (stage / "parameters.json").write_text(json.dumps(table))


def write_session(folder, stiffness: float):
    model = arm(stiffness)
    folder.mkdir()
    tilts = [tilt(model, angle, split) for angle, split in ((30, "identify"), (45, "validate"), (60, "validate"))]
    write_trials(folder, [*tilts, tilt(arm(9.0), 75, "test"), release(model, 0.3, "validate", 40)])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Twins by the stiffness that they think the arm has, and sessions of arms that have it, as shares of one's."""
    root = tmp_path_factory.mktemp("made")
    (root / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    for name, stiffness in (("stiff", 1.3), ("right", 1.0), ("soft", 0.7)):
        write_twin(root / name, stiffness)
        write_session(root / f"of_{name}", stiffness)
    return root


@pytest.fixture
def lab(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(folder) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def decisions(lab) -> list[dict]:
    return json.loads((lab / "stiff.promotion.json").read_text())


def test_a_twin_that_replays_both_sessions_takes_the_place_and_the_old_one_is_left_beside(lab, capsys):
    old, new = files(lab / "stiff"), files(lab / "right")
    assert main(["stiff", "right", "of_right", "of_right"]) == 0
    assert files(lab / "stiff") == files(lab / "right") == new
    assert files(lab / "stiff.before") == old
    assert "promote: stiff: now right, which passed on both" in capsys.readouterr().out
    (decision,) = decisions(lab)
    assert decision["promoted"]
    assert decision["reasons"] == []
    assert decision["old_model"] != decision["new_model"]
    for session in decision["errors"]:
        assert session["trials"] == 3  # of `validate`: neither those of fits nor the wild one of `test`
        assert session["new"]["release"]["e_tip_mm"] < 0.3 * session["old"]["release"]["e_tip_mm"]
    assert not [path for path in lab.iterdir() if path.name.startswith(".")]


def test_one_that_is_worse_on_the_old_session_stays_out_though_it_is_better_on_its_own(lab, capsys):
    old = files(lab / "stiff")
    assert main(["stiff", "soft", "of_stiff", "of_soft"]) == 1
    printed = capsys.readouterr().out
    assert "promote: of_stiff: release: e_tip_mm: found " in printed
    assert printed.splitlines()[-1] == "promote: stiff: the old twin stays"
    assert files(lab / "stiff") == old
    assert not (lab / "stiff.before").exists()
    assert main(["stiff", "stiff", "of_stiff", "of_stiff"]) == 1  # no better than itself
    first, second = decisions(lab)
    assert not first["promoted"]
    assert all(reason.startswith("of_stiff: ") for reason in first["reasons"])
    assert ["expected less than the old twin's" in reason for reason in second["reasons"]] == [True]


@pytest.mark.parametrize(
    ("harm", "expected"),
    [
        ("no trials", "of_right: found no trial to validate that neither twin was fitted to"),
        ("broken model", "arm.xml"),
        ("no session", "nowhere"),
    ],
)
def test_after_a_mistake_the_old_twin_stays_and_the_reason_is_kept(harm, expected, lab):
    old, session = files(lab / "stiff"), "nowhere" if harm == "no session" else "of_right"
    if harm == "no trials":
        trials = [t for t in read_trials(lab / session, SPLITS) if t.split != "validate"]
        write_trials(lab / session, trials)
    if harm == "broken model":
        (lab / "right/identify_stiffness/arm.xml").write_text("<mujoco><worldbody/></mujoco>")
    assert main(["stiff", "right", session, session]) == 1
    (decision,) = decisions(lab)
    assert expected in decision["reasons"][0]
    assert files(lab / "stiff") == old


@pytest.mark.parametrize("twin", ["stiff", "right"])
def test_trials_that_either_twin_was_fitted_to_do_not_count(twin, lab):
    trials = [replace(t, split="validate") for t in read_trials(lab / "of_right", SPLITS) if t.split != "test"]
    write_trials(lab / "of_right", trials)
    shutil.rmtree(lab / twin)
    write_twin(lab / twin, {"stiff": 1.3, "right": 1.0}[twin], {t.name: fingerprint(t) for t in trials[:2]})
    assert main(["stiff", "right", "of_right", "of_right"]) == 0
    assert [session["trials"] for session in decisions(lab)[0]["errors"]] == [len(trials) - 2] * 2


@pytest.mark.parametrize("step", ["rename", "keep"])
def test_where_the_exchange_itself_fails_the_old_twin_is_where_it_was(step, lab, monkeypatch):
    old, rename = files(lab / "stiff"), os.rename

    def fail(*args):
        raise OSError(28, "No space left on device")

    if step == "keep":
        monkeypatch.setattr(promotion, "_keep", fail)
    else:
        monkeypatch.setattr(os, "rename", lambda a, b: fail() if a.name.startswith(".part") else rename(a, b))
    assert main(["stiff", "right", "of_right", "of_right"]) == 1
    assert files(lab / "stiff") == old
    assert not (lab / "stiff.before").exists()


def test_a_twin_that_cannot_be_copied_costs_no_earlier_one(lab, monkeypatch):
    def fail(*args):
        raise OSError(28, "No space left on device")

    shutil.copytree(lab / "stiff", lab / "stiff.before")
    earlier = files(lab / "stiff.before")
    monkeypatch.setattr(shutil, "copytree", fail)
    assert main(["stiff", "right", "of_right", "of_right"]) == 1
    assert files(lab / "stiff.before") == earlier


def test_what_is_no_pair_of_twins_is_one_line_and_nothing_is_written(lab, capsys):
    os.symlink("stiff", "link")
    (lab / "arm.tgz").write_bytes(b"")
    for arguments, expected in (
        (["nowhere", "right"], "nowhere, right: found nothing and a folder"),
        (["link", "right"], "link, right: found a link"),
        (["stiff", "arm.tgz"], "stiff, arm.tgz: found a folder and .tgz"),
        (["stiff/identify_stiffness/arm.xml"] * 2, "found .xml and .xml"),
    ):
        assert main([*arguments, "of_right", "of_right"]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert expected in line
        assert "expected two folders of artifacts, or two .tgz" in line
    (lab / "stiff.promotion.json").write_text("{")
    assert main(["stiff", "right", "of_right", "of_right"]) == 1
    assert "stiff.promotion.json: " in capsys.readouterr().err
    assert (lab / "stiff.promotion.json").read_text() == "{"
