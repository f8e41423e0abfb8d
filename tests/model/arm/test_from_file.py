"""A chain that comes as MJCF: what it must have, and that the statics read what the stage makes of it."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from stages.build_mjcf import Config, cad_arm, main
from tests.identification.test_parameters import assert_survives, with_parts
from tests.support.workbench import ROOT
from trunkline.errors import InputError
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.setup import check_parameters
from trunkline.identification.parameters.parameters import PARAMETERS, parameters_of
from trunkline.model.arm.from_file import FromFile
from trunkline.model.arm_model import BACKLASH, RATE_LIMIT, ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.pipeline.config import load_config

FILE = "four_links.xml"
MODELS = ROOT / "conf/build_mjcf/mjcf"
TEXT = (MODELS / FILE).read_text()


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Load the settings of build_mjcf for the arm `four_links` with another text of its file."""
    (tmp_path / "conf/build_mjcf/arm").mkdir(parents=True)
    for name in ("config.yaml", "arm/four_links.yaml"):
        (tmp_path / "conf/build_mjcf" / name).write_text((ROOT / "conf/build_mjcf" / name).read_text())
    for group in ("holes", "joints"):
        shutil.copytree(ROOT / "conf/build_mjcf" / group, tmp_path / "conf/build_mjcf" / group)
    (tmp_path / "conf/build_mjcf/mjcf").mkdir()
    (tmp_path / "params.yaml").write_text("build_mjcf: {arm: four_links, solver: {timestep: 0.002}}\n")
    monkeypatch.chdir(tmp_path)

    def load(text: str) -> Config:
        (tmp_path / "conf/build_mjcf/mjcf" / FILE).write_text(text)
        return load_config(Config, "build_mjcf", tmp_path)

    return load


def test_the_stage_builds_it_and_the_statics_read_it(project, tmp_path):
    main(project(TEXT))
    built = mujoco.MjModel.from_xml_path(str(tmp_path / "artifacts/build_mjcf/arm.xml"))
    typed = mujoco.MjModel.from_xml_string(TEXT)
    for name in ("jnt_range", "jnt_stiffness", "dof_damping", "body_mass", "site_pos", "actuator_gainprm"):
        np.testing.assert_allclose(getattr(built, name), getattr(typed, name), rtol=1e-5, err_msg=name)
    assert built.opt.timestep == typed.opt.timestep
    chain = read_chain(built)
    assert (chain.units, chain.tendons) == (4, 3)
    assert chain.length == pytest.approx(0.24)
    metrics = json.loads((tmp_path / "artifacts/build_mjcf/metrics.json").read_text())
    assert (metrics["units"], metrics["length_m"]) == (4, pytest.approx(0.24))
    assert metrics["mass_kg"] == pytest.approx(built.body_mass[2:].sum(), rel=5e-4)  # four digits
    assert (tmp_path / "artifacts/build_mjcf/arm.png").stat().st_size > 10000


def arm_with_every_part() -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_string(FromFile("mjcf", FILE).build(None, None, MODELS).spec.to_xml())
    for number in (RATE_LIMIT, BACKLASH):
        spec.add_numeric(name=number, data=[0.01], size=1)
    for actuator in spec.actuators:
        actuator.nsample = 100
    return with_parts(spec, [1, 3])


OWN = list(parameters_of(arm_with_every_part().compile()))


@pytest.mark.parametrize("name", OWN)
def test_it_can_be_identified(name):
    """Every parameter can be set in it and saved."""
    assert_survives(arm_with_every_part(), name)


def test_what_the_settings_name_is_added_and_its_motors_stay_its_own(project):
    drawn = cad_arm(project(TEXT)).spec.compile()
    names = "build_mjcf: {arm: four_links, joints: viscoelastic, holes: rubbing, solver: {timestep: 0.002}}"
    Path("params.yaml").write_text(names)
    added = cad_arm(project(TEXT)).spec.compile()
    group = ArmModel(added).branches[0]
    assert (len(group.branch), len(ArmModel(drawn).branches)) == (8, 0)
    np.testing.assert_allclose(added.dof_armature[group.branch], 1e-5)
    assert (ArmModel(added).guide_holes.size, ArmModel(drawn).guide_holes.size) == (12, 0)
    for name in ("actuator_gainprm", "actuator_dynprm", "actuator_delay"):
        np.testing.assert_array_equal(getattr(added, name), getattr(drawn, name))
    assert added.opt.timestep == drawn.opt.timestep == 0.001


def test_the_way_to_a_dead_time_is_said_and_leads_there(project):
    config = SimpleNamespace(parameters={"dead_time": Bounds(0.002, 0.1)})
    with pytest.raises(InputError, match="dead_time: found .*; of an arm that comes as MJCF, expected `delay`"):
        check_parameters("identify_control", config, cad_arm(project(TEXT)).spec.compile())
    delayed = TEXT.replace("<position ", '<position delay="0.02" nsample="200" interp="linear" ', 1)
    model = cad_arm(project(delayed)).spec.compile()
    check_parameters("identify_control", config, model)
    assert PARAMETERS["dead_time"].read(model) == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<mujoco", "<mujocco", "not a model that MuJoCo reads: "),
        ('name="base"', 'name="mount"', "found no body `base`, expected one: the mount"),
        ('name="base_center"', 'name="middle"', "found no site 'base_center', expected one in the mount"),
        ('name="tip"', 'name="end"', "found no site 'tip', expected one on the last unit"),
        ("(shoulder|upper|lower|hand)_center", r"\1_middle", "found no site <marker>_center, expected one for every"),
        ('name="upper_roll" ', "", "found a joint without a name (number 4), expected names for all"),
        ('name="pull_b" ', "", "found an actuator without a name"),
        ('<joint name="hand_roll" axis="1 0 0"/>', "", "body 'hand': found 1 joints, expected two hinges, or none"),
        ('type="hinge"', 'type="slide"', "body 'shoulder': found 2 joints, expected two hinges"),
        ('stiffness="0.6"', "", "joint 'shoulder_pitch': found no stiffness or no damping, expected a guess"),
        ('<site name="base_center"/>', '<site name="base_center" pos="0 0 1"/>', "'base_center': found it moved or"),
        ('forcerange="-40 0"', 'forcerange="-40 40"', "actuator 'pull_a': found force range -40 40, expected -F 0"),
        ('contype="0" conaffinity="0"', "", "may touch "),
        ('<position name="pull_c" tendon="c"/>', "", "tendon 'c': found 0 actuators, expected 1"),
    ],
)
def test_what_later_stages_need_is_said_in_one_line(project, tmp_path, old, new, message):
    assert re.search(old, TEXT)
    with pytest.raises(InputError) as caught:
        main(project(re.sub(old, new, TEXT)))
    assert message in str(caught.value)
    assert not (tmp_path / "artifacts/build_mjcf").exists()


@pytest.mark.parametrize(
    ("file", "message"),
    [("three_links.xml", "three_links.xml: no such file"), ("../config.yaml", "expected a file in ")],
)
def test_the_file_lies_where_the_pipeline_watches(file, message):
    with pytest.raises(InputError, match=message):
        FromFile("mjcf", file).build(None, None, MODELS)
