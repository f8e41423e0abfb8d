"""Stages and tools that need lengths of cable refuse an arm whose motors are commanded by force; those that know an arm
of one length alone refuse one that its tendons shorten. In one line, before anything else is read."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from stages import fk_dataset, package_unity, reachability, report, train_ik
from tests.model.arm.test_sections import SOLVER
from tests.model.simulation.test_shortening import soft_arm
from tests.support.forced_arm import MOTORS, forced_spec
from trunkline.errors import InputError
from trunkline.model.arm_model import ArmModel
from trunkline.tools.record_poses import __main__ as record_poses
from trunkline.tools.suggest import __main__ as suggest

BY_FORCE = "found an arm whose motors are commanded by force, N, expected lengths of cable"


@pytest.fixture
def forced(tmp_path) -> Path:
    (tmp_path / "arm.xml").write_text(forced_spec().to_xml())
    return tmp_path / "arm.xml"


def test_stages_refuse_forces(forced, monkeypatch):
    with pytest.raises(InputError, match=f"^train_ik.model: {BY_FORCE}"):
        train_ik.main(SimpleNamespace(model=str(forced)))
    monkeypatch.setattr(package_unity, "read_sources", lambda _: SimpleNamespace(mjcf=forced.read_text()))
    with pytest.raises(InputError, match=f"^package_unity: {BY_FORCE}"):
        package_unity.main(SimpleNamespace())
    (forced.parent / "metrics.json").write_text("{}")
    monkeypatch.setattr(report, "existing", lambda _: forced.parent / "metrics.json")
    arm = ArmModel(forced_spec().compile())
    monkeypatch.setattr(report, "Twin", SimpleNamespace(load=lambda _: SimpleNamespace(arm=arm)))
    with pytest.raises(InputError, match=f"^report: {BY_FORCE}"):
        report.main(SimpleNamespace(rig=None))


def test_tools_refuse_forces(forced, monkeypatch, capsys):
    assert record_poses.main([str(forced.parent / "poses"), "--model", str(forced)]) != 0
    assert f"record-poses: {BY_FORCE}" in capsys.readouterr().err
    monkeypatch.setattr(suggest, "trials_of", lambda *_: [])
    monkeypatch.setattr(suggest, "with_room", lambda spec, *_: spec.compile())
    assert suggest.main([str(forced.parent), "--model", str(forced)]) != 0
    assert f"suggest: {BY_FORCE}" in capsys.readouterr().err


@pytest.mark.parametrize("stage", [fk_dataset, reachability])
def test_an_arm_that_gets_shorter_is_refused(stage, tmp_path):
    (tmp_path / "arm.xml").write_text(soft_arm().build(MOTORS, SOLVER, Path()).spec.to_xml())
    with pytest.raises(InputError, match=r"^\w+.model: found an arm with axial_stiffness, expected one without"):
        stage.main(SimpleNamespace(model=str(tmp_path / "arm.xml")))
