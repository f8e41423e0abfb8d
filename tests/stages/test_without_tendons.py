"""An arm without tendons: the stages that need them are skipped in one line each, by what build_mjcf made."""

from importlib import import_module

import mujoco
import pytest

from tests.support.small_arm import small_spec
from tests.support.workbench import ROOT
from trunkline.arm.tendons import CAD_MODEL
from trunkline.pipeline.stage import run_stage

STAGES = ["identify_control", "fk_dataset", "train_ik", "reachability", "package_unity"]


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """A project with nothing but settings and the CAD model of a small arm."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf").symlink_to(ROOT / "conf")
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    CAD_MODEL.parent.mkdir(parents=True)
    spec = small_spec()
    CAD_MODEL.write_text(_xml(spec))
    return spec


def _xml(spec: mujoco.MjSpec) -> str:
    spec.compile()
    return spec.to_xml()


@pytest.mark.parametrize("name", STAGES)
def test_without_tendons_a_stage_is_skipped_in_one_line(arm, tmp_path, capsys, name):
    for element in (*arm.actuators, *arm.tendons):
        arm.delete(element)
    CAD_MODEL.write_text(_xml(arm))
    before = sorted(tmp_path.rglob("*"))
    stage = import_module(f"stages.{name}")
    run_stage(name, stage.Config, stage.main)
    assert capsys.readouterr().out == f"{name}: skipped: {CAD_MODEL}: the arm has no tendons\n"
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("name", STAGES)
def test_with_tendons_it_goes_on_to_what_it_reads(arm, capsys, name):
    stage = import_module(f"stages.{name}")
    with pytest.raises(SystemExit):
        run_stage(name, stage.Config, stage.main)
    said = capsys.readouterr()
    assert "skipped" not in said.out
    assert str(CAD_MODEL) not in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(("content", "found"), [(None, "no such file"), ("<mujoco>", "not a model that MuJoCo reads")])
def test_without_a_model_that_is_said(arm, capsys, content, found):
    CAD_MODEL.unlink()
    if content is not None:
        CAD_MODEL.write_text(content)
    stage = import_module("stages.fk_dataset")
    with pytest.raises(SystemExit):
        run_stage("fk_dataset", stage.Config, stage.main)
    assert capsys.readouterr().err.startswith(f"error: {CAD_MODEL}: {found}")
