"""The package, whole: reproducible, complete, described truly, and moving as the calibrated model does."""

import hashlib
import io
import json
import re
import runpy
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import onnx
import pytest
import trimesh
import yaml
from onnx import TensorProto, helper

from tests.support.folders import ROOT, TABLE_OF_NOTHING
from tests.support.small_arm import small_mjcf
from trunkline.errors import InputError
from trunkline.frames import downwards
from trunkline.kinematics.dataset.gravities import spread
from trunkline.kinematics.ik.inputs import TILT
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.kinematics.reachability.workspace_surface import WorkspaceSurfaces
from trunkline.model.arm.joints import Joints, MaxwellElement, add_elements
from trunkline.twin.package import MANIFEST, read_tarball
from trunkline.unity import manifest as schema
from trunkline.unity.assemble import CSHARP, Label, Sources, Trajectory, assemble, compare
from trunkline.unity.importer import as_imported
from trunkline.unity.linearize import JointLaw, Laws, TendonLaw, compile_with
from trunkline.unity.manifest import Manifest, Model, Names, SureBlock
from trunkline.unity.plugin import VERSION
from trunkline.unity.readers import refusals
from trunkline.unity.roundtrip import curl, simulate
from trunkline.unity.sources import read_sources
from trunkline.unity.upm_package import MODEL, NETWORK, package_json, write_tarball

LABEL = Label("org.trunkline.twin", "1.2.3", "Twin", "A twin.", "6000.0")
TRAJECTORY = Trajectory(duration=0.4, pull=0.04, tilts_deg=[0.0, 57.3])
ROBOT = PandaRobot("panda", 0.05, 0.6, 0.1, [0.0, -0.2, 0.0, -1.9, 0.0, 1.7, 0.785398])


def network(inputs: int = 8, opset: int = 15, outputs: list[str] | None = None) -> bytes:
    weights = helper.make_tensor("w", TensorProto.FLOAT, [inputs, 3], np.ones(3 * inputs))
    names = ("commands", "lengths", "tip")
    widths = {"x": inputs} | dict.fromkeys(names, 3)
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["n", w]) for n, w in widths.items()]
    nodes = [helper.make_node("MatMul", ["x", "w"], [name]) for name in names]
    graph = helper.make_graph(nodes, "ik", ends[:1], ends[1:], [weights])
    opsets = [helper.make_opsetid("", opset)]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=8)
    names = {"inputs": TILT, "outputs": outputs or ["tendon_1", "tendon_2", "tendon_3"]}
    meaning = {name: f"{name} in m" for name in ("commands", "lengths", "tip")}
    meaning |= {"doubt_beyond_m": "0.005", "sure_pulls_m": "0.02", "straight_lengths_m": "[0.4, 0.4, 0.4]",
                "sure_tilts_deg": "[90, 30]"}  # fmt: skip
    helper.set_model_props(model, {key: json.dumps(value) for key, value in names.items()} | meaning)
    return model.SerializeToString()


def grids() -> dict[str, np.ndarray]:
    axes = [np.linspace(-0.5, 0.5, n) for n in (5, 7, 9)]
    distance = np.linalg.norm(np.meshgrid(*axes, indexing="ij"), axis=0) - 0.3
    spacing = [axis[1] - axis[0] for axis in axes]
    return {
        "soft_030": distance,
        "soft_035": distance - 0.04,
        "soft_angles": np.radians([30.0, 35.0]),
        "soft_threshold": np.array(0.0),
        "soft_tolerance": np.array(0.02),
        "rigid": distance + 0.1,
        "origin": np.full(3, -0.5),
        "spacing": np.array(spacing),
    }


def row(value: float, unit: str, low: float, high: float) -> dict:
    span = [value / 100, value * 100]
    return {"value": value, "unit": unit, "interval_95_given_model": [low, high], "range": span, "at_bound": False}


FITTED_TO = {f"pull_{number}": f"{number:016x}" for number in range(10)}
PARAMETERS = {
    "identify_stiffness": {
        "parameters": {"stiffness": row(0.5, "N m/rad", 0.4, 0.6), "kp": row(1900.0, "N/m", 1000.0, 3600.0)},
        "correlation": {"stiffness": {"stiffness": 1.0, "kp": 0.3}, "kp": {"stiffness": 0.3, "kp": 1.0}},
        "fitted_to": FITTED_TO,
    },
    "identify_damping": {
        "parameters": {"damping": row(0.02, "N m s/rad", 0.01, 0.04)},
        "correlation": {"damping": {}},
        "fitted_to": FITTED_TO,
    },
    "identify_control": {
        "parameters": {"kp": row(2000.0, "N/m", 1800.0, 2200.0)},
        "correlation": {"kp": {"kp": 1.0}},
        "fitted_to": FITTED_TO,
    },
}


def sources_in(folder: Path) -> Sources:
    (folder / "ik.onnx").write_bytes(network())
    np.savez(folder / "grids.npz", **grids())
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
    ball.export(folder / "soft_030.obj")
    ball.export(folder / "rigid.stl")
    return Sources(
        mjcf=small_mjcf(),
        tables=PARAMETERS,
        network=folder / "ik.onnx",
        meshes=sorted([*folder.glob("*.obj"), *folder.glob("*.stl")]),
        grids=folder / "grids.npz",
        metrics={"train_ik": {"opset": 15}},
        texts={"README.md": b"twin", "LICENSE.md": b"free", "CHANGELOG.md": b"new"},
        trunkline="0.1.0",
    )


@pytest.fixture
def sources(tmp_path) -> Sources:
    return sources_in(tmp_path)


@pytest.fixture
def files(assembled) -> dict[str, bytes]:
    """Of what `sources` has."""
    return dict(assembled)


def test_the_model_from_the_finished_package_moves_as_the_calibrated_one(files, sources, tmp_path):
    write_tarball(tmp_path / "twin.tgz", files)
    packed = mujoco.MjModel.from_xml_string(read_tarball(tmp_path / "twin.tgz")[MODEL].decode())
    calibrated = mujoco.MjModel.from_xml_string(sources.mjcf)
    assert compare(calibrated, packed, TRAJECTORY) == (0.0, 0)
    packed.actuator_gainprm[:, 0] *= 1.01
    assert compare(calibrated, packed, TRAJECTORY)[0] > 0.1  # one percent of a gain is seen


def test_the_curl_bends_the_arm_towards_the_pulled_tendon():
    model = mujoco.MjModel.from_xml_string(small_mjcf())
    positions = simulate(model, curl(model, TRAJECTORY.duration, TRAJECTORY.pull), tilt=0.0).positions
    assert positions[:, -1, 0].max() > 0.05  # m, tendon 1 is over +x


def test_the_same_inputs_give_the_same_bytes(files, sources, tmp_path):
    write_tarball(tmp_path / "a.tgz", files)
    write_tarball(tmp_path / "b.tgz", assemble(LABEL, sources, TRAJECTORY, ROBOT)[0])
    assert (tmp_path / "a.tgz").read_bytes() == (tmp_path / "b.tgz").read_bytes()


def test_every_file_and_folder_has_a_meta_with_its_own_lasting_guid(files, sources):
    visible = {path for path in files if "~/" not in path}  # Unity ignores folders that end in ~
    contents = {path for path in visible if not path.endswith(".meta")}
    folders = {str(folder) for path in contents for folder in Path(path).parents} - {"."}
    assert {path.removesuffix(".meta") for path in files if path.endswith(".meta")} == contents | folders
    guids = {
        path: re.search(rb"guid: ([0-9a-f]{32})\n", data)[1]
        for path, data in files.items()
        if path.endswith(".meta")
    }
    assert len(set(guids.values())) == len(guids)
    later = Label(**vars(LABEL) | {"version": "2.0.0"})
    again, _ = assemble(later, sources, TRAJECTORY, ROBOT)
    assert all(again[path] == files[path] for path in guids)


def test_the_manifest_is_valid_and_true(files, sources):
    manifest = Manifest.model_validate_json(files[MANIFEST])
    for path, digest in manifest.sha256.items():
        assert hashlib.sha256(files[path]).hexdigest() == digest
    assert set(manifest.sha256) == set(files) - {MANIFEST}
    model = mujoco.MjModel.from_xml_string(sources.mjcf)
    assert manifest.model.time_step == model.opt.timestep
    assert manifest.model.gravity_unity == [0, model.opt.gravity[2], 0]
    assert manifest.model.names.actuators == ["tendon_1_position", "tendon_2_position", "tendon_3_position"]
    assert manifest.model.names.joints[:2] == ["unit_01_x", "unit_01_y"]
    assert manifest.network.output_order == ["tendon_1", "tendon_2", "tendon_3"]
    assert (manifest.network.input, manifest.network.opset) == ("x", 15)
    assert list(manifest.network.outputs) == ["commands", "lengths", "tip"]
    assert manifest.network.doubt_beyond == 0.005
    assert manifest.network.sure == SureBlock(pulls=0.02, tilt=90, pulled_tilt=30)
    assert set(manifest.meshes) == {"rigid", "soft_030"}
    assert manifest.hybrid.robot == ROBOT
    with pytest.raises(ValueError, match="extra"):
        Manifest.model_validate(json.loads(files[MANIFEST]) | {"surprise": 1})


def test_meshes_and_grids_say_how_true_they_are(files, sources):
    """A ball's mesh of 80 triangles lies inside of it; a grid of one spacing tells by how much."""
    axis = np.linspace(-0.5, 0.5, 21)
    ball = np.linalg.norm(np.meshgrid(axis, axis, axis, indexing="ij"), axis=0) - 0.3
    maps = {name: values for name, values in grids().items() if not name.startswith("soft_0")} | {"soft_030": ball}
    lattice = {"soft_angles": np.array([0.5]), "origin": np.full(3, -0.5), "spacing": axis[1] - axis[0]}
    np.savez(sources.grids, **maps | lattice)
    described = Manifest.model_validate_json(assemble(LABEL, sources, TRAJECTORY, ROBOT)[0][MANIFEST])
    mesh = trimesh.load_mesh(io.BytesIO(files[described.meshes["soft_030"].file]), file_type="obj")
    assert len(mesh.faces) == described.meshes["soft_030"].triangles
    sag = 0.3 - np.linalg.norm(mesh.triangles_center, axis=1).min()
    assert described.meshes["soft_030"].deviation == pytest.approx(sag, rel=0.3)
    assert 0.98 < described.grids["soft_030"].overlap < 1
    uneven = Manifest.model_validate_json(files[MANIFEST])
    assert uneven.meshes["soft_030"].deviation is None  # of a lattice that is not the same along all axes


def headset_signal(files: dict[str, bytes], base: np.ndarray, angle: float) -> float:
    """How far a point of the arm's base frame is out of reach, m, from the package's files and manifest alone."""
    manifest = json.loads(files[MANIFEST])
    reach = manifest["reach"]
    upper = int(np.clip(np.searchsorted(reach["angles"], angle), 1, len(reach["angles"]) - 1))
    weight = (angle - reach["angles"][upper - 1]) / (reach["angles"][upper] - reach["angles"][upper - 1])
    signal = 0.0
    for name, share in ((reach["grids"][upper - 1], 1 - weight), (reach["grids"][upper], weight)):
        grid = manifest["grids"][name]
        texture = np.frombuffer(files[grid["file"]], "<f2").reshape(grid["shape"][::-1]).astype(float)  # z, y, x
        place = (base[[0, 2, 1]] - grid["origin"]) / grid["spacing"]
        first = np.floor(place).astype(int)
        part = place - first
        for corner in np.ndindex(2, 2, 2):
            x, y, z = first + corner
            signal += share * texture[z, y, x] * np.prod(np.where(corner, part, 1 - part))
    return signal


def test_the_headset_tells_what_is_out_of_reach(files):
    """Balls of radius 0.3 m at 30° and 0.34 m at 35°: of 0.32 m half-way between."""
    reach = Manifest.model_validate_json(files[MANIFEST]).reach
    assert reach.grids == ["soft_030", "soft_035"]
    assert (reach.threshold, reach.tolerance) == (0.0, 0.02)
    direction = np.array([0.48, 0.6, -0.64])
    for angle_deg, radius in ((30.0, 0.3), (32.5, 0.32), (35.0, 0.34)):
        for gap in (-0.05, 0.05):
            signal = headset_signal(files, (radius + gap) * direction, np.radians(angle_deg))
            assert signal == pytest.approx(gap, abs=0.04)  # the grid is coarse
            assert (signal > reach.threshold) == (gap > 0)


def harden(mjcf: str) -> str:
    """The model with springs and dampers that stiffen."""
    spec = mujoco.MjSpec.from_string(mjcf)
    for joint in spec.joints:
        joint.stiffness = [joint.stiffness[0], 0, 4 * joint.stiffness[0]]
        joint.damping = [joint.damping[0], 0, joint.damping[0] / 30]
    spec.compile()
    return spec.to_xml()


def test_springs_that_stiffen_are_restored_from_the_manifest(sources):
    sources.mjcf = harden(sources.mjcf)
    files, violations = assemble(LABEL, sources, TRAJECTORY, ROBOT)
    assert violations == []
    model = Manifest.model_validate_json(files[MANIFEST]).model
    calibrated, mjcf = mujoco.MjModel.from_xml_string(sources.mjcf), files[MODEL].decode()
    linear = mujoco.MjModel.from_xml_string(mjcf)
    laws = Laws(model.springs, model.dampers, model.diagonals)
    assert compare(calibrated, compile_with(mjcf, laws), TRAJECTORY) == (0.0, 0)
    assert model.import_max_deviation_mm < 0.01
    assert model.changes_max_deviation_mm == compare(calibrated, linear, TRAJECTORY)[0] > 1
    for laws, first, higher in (
        (model.springs, calibrated.jnt_stiffness, calibrated.jnt_stiffnesspoly),
        (model.dampers, calibrated.dof_damping, calibrated.dof_dampingpoly),
    ):
        assert [law.joint for law in laws] == model.names.joints
        assert [law.coefficients for law in laws] == [(a, *rest) for a, rest in zip(first, higher, strict=True)]


def test_a_linear_model_is_packed_as_it_is_but_for_its_controls(files, sources):
    model = Manifest.model_validate_json(files[MANIFEST]).model
    assert (model.springs, model.dampers, model.changes_max_deviation_mm) == ([], [], 0)
    before, after = (text.partition("<actuator>") for text in (sources.mjcf, files[MODEL].decode()))
    assert before[0] == after[0]
    assert "input=" not in after[2]


def test_what_a_file_cannot_say_of_winches_is_stated_and_left_out(sources):
    spec = mujoco.MjSpec.from_string(sources.mjcf)
    for name, value in (("rate_limit", 0.25), ("backlash", 3e-4)):
        spec.add_numeric(name=name, data=[value], size=1)
    files, violations = assemble(LABEL, replace(sources, mjcf=spec.to_xml()), TRAJECTORY, ROBOT)
    assert violations == []
    described = Manifest.model_validate_json(files[MANIFEST]).model
    assert (described.rate_limit, described.backlash) == (0.25, 3e-4)
    assert b"numeric" not in files[MODEL]
    plain = Manifest.model_validate_json(assemble(LABEL, sources, TRAJECTORY, ROBOT)[0][MANIFEST]).model
    assert (plain.rate_limit, plain.backlash) == (0, 0)


def test_branches_of_joints_are_packed_under_names_that_unity_can_hold(sources):
    """A branch's hinge and the tendon that ties it have names of their own."""
    spec = mujoco.MjSpec.from_string(sources.mjcf)
    add_elements(spec, Joints([MaxwellElement(0.3, 0.5)]), 1e-5)
    files, violations = assemble(LABEL, replace(sources, mjcf=spec.to_xml()), TRAJECTORY, ROBOT)
    assert not violations
    packed = mujoco.MjModel.from_xml_string(files[MODEL].decode())
    names = [packed.tendon(i).name for i in range(packed.ntendon)]
    assert {"unit_01_x_branch_1_tie", "tendon_1"} <= set(names)
    assert Manifest.model_validate_json(files[MANIFEST]).model.changes_max_deviation_mm < 1e-3


def test_the_component_for_unity_reads_what_the_manifest_holds(files):
    script = files["Runtime/Twin.cs"].decode()
    classes = re.findall(r"\[Serializable\]\s+private class (\w+) \{(.*?)\}", script, re.DOTALL)
    read = {name: set(re.findall(r"public [\w[\]]+ (\w+);", body)) for name, body in classes}
    blocks = {
        "Manifest": Manifest.model_fields, "Model": Model.model_fields, "Names": Names.model_fields,
        "Actuator": schema.Actuator.model_fields, "Branch": schema.BranchBlock.model_fields,
        "JointLaw": JointLaw.__dataclass_fields__, "TendonLaw": TendonLaw.__dataclass_fields__,
    }  # fmt: skip
    assert read.keys() == blocks.keys()
    for name, fields in blocks.items():
        assert read[name]
        assert read[name] <= set(fields)
    assert "public class Twin : MonoBehaviour" in script  # Unity goes by the file's name
    assembly = json.loads(files["Runtime/Trunkline.asmdef"])
    assert "Mujoco.Runtime" in assembly["references"]
    assert assembly["allowUnsafeCode"]
    assert [version["define"] for version in assembly["versionDefines"]] == assembly["defineConstraints"]


def test_what_unity_would_compile_loses_nothing_but_digits(files, sources):
    calibrated = mujoco.MjModel.from_xml_string(sources.mjcf)
    imported = mujoco.MjModel.from_xml_string(as_imported(sources.mjcf))
    assert compare(calibrated, imported, TRAJECTORY)[0] < 0.01
    for field in ("dof_armature", "dof_damping", "jnt_stiffness", "tendon_frictionloss", "actuator_biasprm"):
        np.testing.assert_allclose(getattr(imported, field), getattr(calibrated, field), rtol=1e-6)
    limited = sources.mjcf.replace("forcelimited", 'actlimited="true" actrange="0.48 0.5" forcelimited')
    lossy = mujoco.MjModel.from_xml_string(as_imported(limited))
    assert (
        compare(mujoco.MjModel.from_xml_string(limited), lossy, TRAJECTORY)[0] > 1
    )  # it drops what Unity drops


def test_a_simulation_that_warns_breaks_a_rule(sources):
    sources.mjcf = sources.mjcf.replace('armature="1e-05"', 'armature="0"').replace("-80 0", "-80000 0")
    sources.mjcf = sources.mjcf.replace("-2000", "-2e7").replace('gainprm="2000"', 'gainprm="2e7"')
    _, violations = assemble(LABEL, sources, TRAJECTORY, ROBOT)
    assert [violation.element for violation in violations] == ["simulation"]


def test_models_of_which_one_diverges_are_not_called_alike(sources, monkeypatch):
    model = mujoco.MjModel.from_xml_string(sources.mjcf)
    assert compare(model, model, TRAJECTORY)[0] == 0

    def diverging(model, controls, tilt):
        motion = simulate(model, controls, tilt)
        motion.positions[-1] = np.nan
        return motion

    monkeypatch.setattr("trunkline.unity.assemble.simulate", diverging)
    with pytest.raises(InputError, match="found positions that are not finite"):
        compare(model, model, TRAJECTORY)


def silent_network() -> bytes:
    network_without = onnx.load_model_from_string(network())
    del network_without.metadata_props[:]
    return network_without.SerializeToString()


def grids_without(name: str) -> dict[str, np.ndarray]:
    return {key: values for key, values in grids().items() if key != name}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"grids": lambda: grids_without("soft_angles")}, "grids.npz: found no soft_angles, expected"),
        ({"grids": lambda: grids_without("soft_threshold")}, "grids.npz: found no soft_threshold, expected"),
        ({"grids": lambda: grids_without("soft_tolerance")}, "grids.npz: found no soft_tolerance, expected"),
        ({"grids": lambda: {"soft_030": np.zeros((2, 2, 2))}}, "grids.npz: soft_030: found no origin"),
        ({"grids": lambda: grids() | sheets_of_a_ball().arrays() | {"sheets_downs": np.zeros((3, 3))}},
         r"sheets_points of shape \(20, 12, 8, 3\), sheets_downs of shape \(3, 3\)"),
        ({"network": lambda: network(inputs=7)},
         r"ik.onnx: found inputs of width \[7\].*expected one input \(theta_g"),
        ({"network": lambda: b"not a network"}, "expected an ONNX file"),
        ({"network": lambda: network(outputs=["tendon_2", "tendon_1", "tendon_3"])},
         r"ik.onnx: found outputs \['tendon_2', .* expected .* \['tendon_1', "),
        ({"network": silent_network}, "ik.onnx: found no 'inputs' in the file's metadata"),
    ],
)  # fmt: skip
def test_maps_and_networks_that_do_not_say_what_they_are_are_one_line(sources, change, message):
    if "grids" in change:
        np.savez(sources.grids, **change["grids"]())
    else:
        sources.network.write_bytes(change["network"]())
    with pytest.raises(InputError, match=message):
        assemble(LABEL, sources, TRAJECTORY, ROBOT)


@pytest.fixture
def project(tmp_path, sources) -> Path:
    """A folder with all that the stage reads."""
    root = tmp_path / "project"
    for folder in ("package_unity", "shared"):
        shutil.copytree(ROOT / "conf" / folder, root / "conf" / folder)
    for name in ("params.yaml", "LICENSE", "trunkline/unity/CHANGELOG.md", "docs/unity.md"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    stages = (
        "ingest filter build_mjcf identify_stiffness identify_damping identify_control fk_dataset train_ik"
    )
    for stage in [*stages.split(), "reachability"]:
        (root / "artifacts" / stage).mkdir(parents=True)
        (root / "artifacts" / stage / "metrics.json").write_text("{}")
    for stage in ("build_mjcf", "identify_control"):
        (root / "artifacts" / stage / "arm.xml").write_text(sources.mjcf)
    for stage, table in sources.tables.items():
        (root / "artifacts" / stage / "parameters.json").write_text(json.dumps(TABLE_OF_NOTHING | table))
    shutil.copy(sources.network, root / "artifacts/train_ik/ik.onnx")
    (root / "artifacts/reachability/meshes").mkdir()
    for path in sources.meshes:
        shutil.copy(path, root / "artifacts/reachability/meshes")
    np.savez(root / "artifacts/reachability/grids.npz", **grids(), **sheets_of_a_ball().arrays())
    return root


def run(project: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, str(ROOT / "stages/package_unity.py")]
    return subprocess.run(command, cwd=project, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True)


def run_here(project: Path, monkeypatch) -> None:
    """As a process of its own would, but for what that imports, which takes 3 s."""
    monkeypatch.chdir(project)
    runpy.run_path(str(ROOT / "stages/package_unity.py"), run_name="__main__")


@pytest.mark.parametrize("change", [str, harden])
def test_the_stage_writes_package_manifest_and_metrics(project, change, monkeypatch):
    """It makes shared vectors, and settles arms in the plug-in's order of calls: 4 s each."""
    arm = project / "artifacts/identify_control/arm.xml"
    arm.write_text(change(arm.read_text()))
    if change is str:
        done = run(project)
        assert done.returncode == 0, done.stderr
    else:
        run_here(project, monkeypatch)
    out = project / "artifacts/package_unity"
    (tarball,) = out.glob("*.tgz")
    files, metrics = read_tarball(tarball), json.loads((out / "metrics.json").read_text())
    steps = json.loads(files["Tests/Vectors/steps.json"])["sequences"]
    cases = [data for path, data in files.items() if path.startswith("Tests/Vectors/") and path.endswith(".json")]
    start, recreated = metrics.pop("start_error_mm"), metrics.pop("recreated_error_mm")
    dropped = metrics.pop("dropped_max_deviation_mm")
    assert metrics == {
        "rule_violations": 0,
        "foreign_readers_failed": 0,
        "roundtrip_max_deviation_mm": 0.0,
        "files": len(files),
        "bytes": tarball.stat().st_size,
        "shared_vectors": sum(len(json.loads(data).get("cases", [])) for data in cases)
        + sum(len(sequence["steps"]) for sequence in steps),
    }
    assert start["turns"] >= 2
    assert max(start["max"], recreated["max"]) < 0.1  # mm
    assert min(start["without"], recreated["without"]) > 10
    assert dropped == 0.0, "this arm has neither dead time nor rubbing cables"
    assert (out / "manifest.json").read_bytes() == files[MANIFEST]
    assert onnx.load_model_from_string(files[NETWORK]).graph.name == "ik"
    assert json.loads(files["package.json"])["version"] in tarball.name
    assert "Tests/Vectors/steps.json" in files


@pytest.mark.parametrize(
    "missing",
    ["identify_control/arm.xml", "train_ik/ik.onnx", "reachability/grids.npz", "ingest/metrics.json",
     "identify_damping/parameters.json"],
)
def test_a_missing_input_is_one_line_and_leaves_nothing(project, missing, monkeypatch, capsys):
    (project / "artifacts" / missing).unlink()
    with pytest.raises(SystemExit) as ended:
        run_here(project, monkeypatch)
    message = capsys.readouterr().err
    assert (ended.value.code, message.count("\n")) == (1, 1)
    assert message.startswith(f"error: artifacts/{missing}: no such file")
    assert not (project / "artifacts/package_unity").exists()


def sheets_of_a_ball() -> WorkspaceSurfaces:
    """A hanging ball's lower half, swinging with gravity: linear in its direction. Turned a little, so that of no point
    in an arm's plane two others are the nearest."""
    downs = spread(20, 2.0, crowd=True)
    way, place = np.meshgrid(0.1 + 2 * np.pi * np.arange(12) / 12, np.linspace(0, np.pi / 2, 8), indexing="ij")
    half = 0.2 * np.stack([np.sin(place) * np.cos(way), np.sin(place) * np.sin(way), -np.cos(place)], axis=-1)
    return WorkspaceSurfaces(downs, (half + 0.3 * downs[:, None, None]).astype(np.float16), 0.02)


def headset_surface(files: dict[str, bytes], down: np.ndarray) -> np.ndarray:
    """The surface of tips in Unity's axes, (around, along, 3) m, under gravity in Unity's direction `down`, from the
    package's files and the manifest's words alone."""
    sheets = json.loads(files[MANIFEST])["reach"]["sheets"]
    directions = np.array(sheets["directions"]).reshape(-1, 3)
    points = np.frombuffer(files[sheets["file"]], "<f2").reshape(len(directions), sheets["around"], sheets["along"], 3)
    matrix = np.frombuffer(files[sheets["weights"]], "<f8").reshape(len(directions), -1)
    weights = matrix @ [*(np.linalg.norm(down - directions, axis=1) ** 3), 1, *down]
    return np.einsum("d,drsk->rsk", weights, points.astype(float))


def test_the_headset_blends_the_surface_of_tips_under_gravity_from_any_side(plain):
    sheets, down = sheets_of_a_ball(), downwards(0.9, 2.0)
    surface = headset_surface(plain, down[[0, 2, 1]])
    np.testing.assert_allclose(surface[..., [0, 2, 1]], sheets.at(down), atol=1e-6)
    radius = np.linalg.norm(surface - 0.3 * down[[0, 2, 1]], axis=2)
    np.testing.assert_allclose(radius, 0.2, atol=2e-3)
    reach = Manifest.model_validate_json(plain[MANIFEST]).reach
    assert "triangles" in reach.signal
    assert reach.sheets.directions[1] < -0.99  # the hanging arm's gravity, along Unity's -y


def test_sheets_are_read_by_the_manifest_and_damaged_ones_refused(plain):
    assert refusals(plain) == {}
    weights = json.loads(plain[MANIFEST])["reach"]["sheets"]["weights"]
    other = np.frombuffer(plain[weights]) * 1.01
    refused = set(refusals(plain | {weights: other.tobytes()}))
    assert refused == {weights, weights.replace("sheet_weights", "sheets")}


def test_the_package_s_changelog_names_its_version(project):
    label = yaml.safe_load((project / "params.yaml").read_text())["package_unity"]
    assert f"## [{label['version']}] - " in read_sources(project).texts["CHANGELOG.md"].decode()


def test_package_json_has_the_modules_that_the_scripts_use():
    document = json.loads(package_json("org.a.b", "1.2.3", "A", "6000.0", "B"))
    script = "".join(path.read_text() for path in CSHARP.rglob("*.cs"))
    uses = {"jsonserialize": "JsonUtility.", "physics": "Physics.gravity", "xr": "using UnityEngine.XR;"}
    assert {f"com.unity.modules.{name}" for name in uses} == set(document["dependencies"])
    assert all(words in script for words in uses.values())


def test_the_manifest_names_the_plug_in_s_version(files):
    assert Manifest.model_validate_json(files[MANIFEST]).versions.unity_plugin == VERSION
