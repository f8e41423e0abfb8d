"""Chains of one diameter: tracked points, loads and no tendons, and the settings that make them."""

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest
from omegaconf import OmegaConf

from stages.build_mjcf import Config, main
from tests.support.small_arm import LIMIT
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm.mjcf import Marker, Solver, Tendons, build_spec
from trunkline.model.arm.tendons import even_routes
from trunkline.model.arm.uniform import uniform_chain, uniform_properties
from trunkline.pipeline.config import load_config

CHAIN = uniform_chain(0.3, 0.05, 6, 0.5)
DISTANCES = {"1": 0.1, "2": 0.175, "end": 0.3}
MARKERS = {name: Marker(distance) for name, distance in DISTANCES.items()}


def model_of(tip_load=0.0, masses=(0.02,), stiffness=0.5, tendons=0) -> mujoco.MjModel:
    properties = uniform_properties(CHAIN, masses, stiffness, 5.0)
    solver = Solver(0.002, 1e-5, *LIMIT, *LIMIT)
    cables = Tendons(0.1, 20, 0.1, kp=200, routes=even_routes(CHAIN, tendons, 0.8), kv=10)
    return build_spec(CHAIN, properties, cables, solver, tip_load, MARKERS).compile()


def test_one_diameter_has_equal_joints():
    model = model_of()
    assert CHAIN.ratio == 1.0
    for values in (model.jnt_stiffness, model.dof_damping, model.body_mass[2:]):
        assert (values == values[0]).all()


def test_every_unit_may_have_its_own_mass():
    masses = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]
    np.testing.assert_allclose(model_of(masses=masses).body_mass[2:], masses)


def test_tracked_points_lie_where_the_drawing_says():
    model = model_of()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for name, distance in DISTANCES.items():
        np.testing.assert_allclose(data.site(f"{name}_center").xpos, [0, 0, -distance], atol=1e-12)
    carriers = [model.body(model.site(f"{name}_center").bodyid[0]).name for name in DISTANCES]
    assert carriers == ["unit_02", "unit_04", "unit_06"]  # a point between two units is the first one's end


def test_the_load_pulls_at_the_tip():
    """Torque about the mount of the arm that sticks out sideways: m g L/2 of the units, M g L of the load."""
    torques = []
    for load in (0.0, 0.2):
        model = model_of(tip_load=load)
        model.opt.gravity = [STANDARD_GRAVITY, 0, 0]
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        torques.append(data.qfrc_bias[1])
    assert torques[0] == pytest.approx(6 * 0.02 * STANDARD_GRAVITY * 0.15)
    assert torques[1] - torques[0] == pytest.approx(0.2 * STANDARD_GRAVITY * 0.3)


def test_an_arm_without_tendons_hangs_straight_again():
    model = model_of(tip_load=0.2)
    assert (model.nu, model.na, model.ntendon) == (0, 0, 0)
    data = mujoco.MjData(model)
    data.qpos[1::2] = 0.2
    mujoco.mj_step(model, data, nstep=10000)
    np.testing.assert_allclose(data.site("tip").xpos, [0, 0, -0.3], atol=1e-5)


def test_a_bent_rod_deflects_as_a_beam():
    """Small deflection of a cantilever under a tip force: F L³ / (3 EI), for many units."""
    units, bending = 60, 0.5
    chain = uniform_chain(0.3, 0.05, units, 0.5)
    properties = uniform_properties(chain, [1e-6], bending / chain.lengths[0], 0.3)
    tendons = Tendons(0, 1, 1, kp=1, routes=[], kv=1)
    spec = build_spec(chain, properties, tendons, Solver(0.001, 1e-5, *LIMIT, *LIMIT))
    model = spec.compile()
    jacobian, data = np.zeros((3, model.nv)), mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_jacSite(model, data, jacobian, None, model.site("tip").id)
    bend = jacobian[0] * 1.0 / model.jnt_stiffness  # of each joint under 1 N along x
    assert jacobian[0] @ bend == pytest.approx(0.3**3 / (3 * bending), rel=0.03)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Load and run build_mjcf with changes to the arm `asl_trunk`, or another."""
    conf = tmp_path / "conf" / "build_mjcf"
    (conf / "arm").mkdir(parents=True)
    source = OmegaConf.load("conf/build_mjcf/config.yaml")
    arms = {name: OmegaConf.load(f"conf/build_mjcf/arm/{name}.yaml") for name in ("asl_trunk", "spiral")}
    OmegaConf.save(source, conf / "config.yaml")
    for group in ("holes", "joints"):
        shutil.copytree(f"conf/build_mjcf/{group}", conf / group)
    (tmp_path / "params.yaml").write_text("build_mjcf: {arm: arm, solver: {timestep: 0.002}}\n")
    monkeypatch.chdir(tmp_path)

    def load(changes: dict, arm: str = "asl_trunk") -> Config:
        OmegaConf.save(OmegaConf.merge(arms[arm], changes), conf / "arm" / "arm.yaml")
        return load_config(Config, "build_mjcf", tmp_path)

    return load


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "cone"}, "build_mjcf.arm: "),
        ({"lenght": 1}, "build_mjcf.arm.lenght: unknown key"),
        ({"units": 0}, "build_mjcf.arm.units: found 0, expected 1 to 500"),
        ({"unit_masses": [0.1, -0.1]}, "build_mjcf.arm.unit_masses.1: found -0.1, expected more than 0 to 100"),
        ({"unit_masses": [0.1, 0.1]}, "build_mjcf.arm: unit_masses: found 2, expected one for all"),
        ({"joint_stiffness": 1.0}, "build_mjcf.arm: found both, expected either bending_stiffness"),
        ({"bending_stiffness": None}, "build_mjcf.arm: found neither, expected either bending_stiffness"),
        ({"markers": {"3": 0.5}}, "build_mjcf.arm: markers.3: found 0.5 m, expected at most the length of 0.3225 m"),
        ({"tip_load": -0.1}, "build_mjcf.arm.tip_load: found -0.1"),
    ],
)
def test_a_mistake_names_the_key(project, changes, message):
    with pytest.raises(InputError) as caught:
        project(changes)
    assert message in str(caught.value)


@pytest.mark.parametrize("arm", ["asl_trunk", "spiral"])
def test_units_bend_at_their_upper_ends_where_the_file_does_not_say(project, arm):
    assert project({"joint_place": 0.25}, arm).arm.joint_place == 0.25
    file = Path("conf/build_mjcf/arm/arm.yaml")
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(line for line in lines if not line.startswith("joint_place")))
    assert load_config(Config, "build_mjcf").arm.joint_place == 0


@pytest.mark.parametrize("arm", ["asl_trunk", "spiral"])
@pytest.mark.parametrize(
    ("markers", "message"),
    [
        ({"wrist": 0.6}, "markers.wrist: found 0.6 m, expected at most the length of "),
        ({"base": 0.1}, "markers.base: found the name of a body, expected another"),
        ({"unit_01": 0.1}, "markers.unit_01: found the name of a body, expected another"),
        ({"unit_99": 0.1}, "units' centres have names, unit_01 to unit_"),
    ],
)
def test_a_tracked_point_lies_on_the_arm_and_has_a_name_of_its_own(project, arm, markers, message):
    with pytest.raises(InputError) as caught:
        project({"markers": markers}, arm)
    assert message in str(caught.value)


def test_markers_by_the_name_of_the_release_before(project, capsys):
    file = Path("conf/build_mjcf/arm/arm.yaml")
    project({}, "asl_trunk")
    text = file.read_text()
    markers = load_config(Config, "build_mjcf").arm.markers
    file.write_text(text.replace("markers:", "segments:"))
    assert load_config(Config, "build_mjcf").arm.markers == markers
    assert "build_mjcf.arm: `segments` is called `markers` now" in capsys.readouterr().out


@pytest.mark.parametrize("changes", [{}, {"tendons": 4}, {"bending_stiffness": None, "joint_stiffness": 0.4}])
def test_the_stage_builds_it(project, tmp_path, changes):
    main(project(changes))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "artifacts/build_mjcf/arm.xml"))
    assert (model.ntendon, model.nu) == (changes.get("tendons", 0),) * 2
    assert {f"{name}_center" for name in "123"} <= {model.site(i).name for i in range(model.nsite)}
    assert (tmp_path / "artifacts/build_mjcf/arm.png").stat().st_size > 10000
    if "joint_stiffness" in changes:
        assert model.jnt_stiffness == pytest.approx(0.4)


def test_a_spiral_may_carry_a_load_too(project, tmp_path):
    main(project({"tip_load": 0.05}, "spiral"))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "artifacts/build_mjcf/arm.xml"))
    assert model.body("tip_load").mass[0] == pytest.approx(0.05)
