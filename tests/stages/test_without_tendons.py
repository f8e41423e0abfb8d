"""An arm without tendons: its pipeline ends with identify_damping, and asking for more is an error of one line."""

from importlib import import_module

import pytest

from tests.support.small_arm import small_spec
from tests.support.workbench import ROOT
from trunkline.pipeline.stage import run_stage

MODELS = [f"artifacts/{stage}/arm.xml" for stage in ("build_mjcf", "identify_damping", "identify_control")]


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """A project with settings, and models of a small arm without tendons from every stage that makes one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf").symlink_to(ROOT / "conf")
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    spec = small_spec()
    for element in (*spec.actuators, *spec.tendons):
        spec.delete(element)
    spec.compile()
    for model in MODELS:
        (tmp_path / model).parent.mkdir(parents=True)
        (tmp_path / model).write_text(spec.to_xml())
    return tmp_path


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("identify_control", "params.yaml: identify_control.parameters.kp: found it for an arm without tendons"),
        ("fk_dataset", "artifacts/identify_control/arm.xml: found no tendons, expected at least one"),
        ("train_ik", "artifacts/identify_control/arm.xml: found no tendons, expected at least one"),
        ("reachability", "artifacts/identify_control/arm.xml: found no tendons, expected at least one"),
    ],
)
def test_asking_for_more_is_an_error_of_one_line(arm, capsys, name, start):
    before = sorted(arm.rglob("*"))
    stage = import_module(f"stages.{name}")
    with pytest.raises(SystemExit):
        run_stage(name, stage.Config, stage.main)
    output = capsys.readouterr()
    assert output.err.startswith(f"error: {start}")
    assert "identify_damping" in output.err
    assert output.err.count("\n") == 1
    assert sorted(arm.rglob("*")) == before


def test_a_package_names_the_stage_that_is_missing(arm, capsys):
    stage = import_module("stages.package_unity")
    with pytest.raises(SystemExit):
        run_stage("package_unity", stage.Config, stage.main)
    message = capsys.readouterr().err
    assert message.startswith("error: artifacts/reachability/meshes: found no mesh, expected .obj files")
    assert message.count("\n") == 1


@pytest.mark.parametrize(("content", "start"), [(None, "no such file"), ("<mujoco>", "not a model that MuJoCo reads")])
def test_without_a_model_that_is_said(arm, capsys, content, start):
    model = arm / "artifacts/identify_control/arm.xml"
    model.unlink()
    if content is not None:
        model.write_text(content)
    stage = import_module("stages.fk_dataset")
    with pytest.raises(SystemExit):
        run_stage("fk_dataset", stage.Config, stage.main)
    assert capsys.readouterr().err.startswith(f"error: artifacts/identify_control/arm.xml: {start}")
