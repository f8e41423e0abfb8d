"""The finished package, opened by readers that had no part in making it; and that they refuse what is wrong."""

import subprocess

import mujoco
import numpy as np
import onnx
import pytest
import torch

from tests.support.folders import package
from tests.unity.mono import compiled
from tests.unity.test_assemble import files, sources  # noqa: F401
from trunkline.kinematics.ik.network import InverseKinematics
from trunkline.kinematics.ik.onnx import to_onnx
from trunkline.twin.package import MANIFEST, read_tarball
from trunkline.unity import readers
from trunkline.unity.readers import ENGINES, refusals
from trunkline.unity.upm_package import MODEL, NETWORK, write_tarball

OBJ = "Runtime/Reachability/soft_030.obj"
CORE = "Runtime/Core/"
GRID = "Runtime/Reachability/soft_030.bytes"


def test_no_reader_refuses_a_file_of_the_package(files, tmp_path):  # noqa: F811
    write_tarball(tmp_path / "twin.tgz", files)
    assert refusals(read_tarball(tmp_path / "twin.tgz")) == {}


def test_tar_unpacks_the_same_files_and_the_model_loads_from_there(files, tmp_path):  # noqa: F811
    write_tarball(tmp_path / "twin.tgz", files)
    subprocess.run(["tar", "xzf", "twin.tgz"], cwd=tmp_path, check=True)
    root = tmp_path / "package"
    assert {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()} == files
    assert mujoco.MjModel.from_xml_path(str(root / MODEL)).nu == 3


@pytest.fixture(scope="module")
def built():
    """The files of the package that the stage made last."""
    return read_tarball(package())


def test_no_reader_refuses_a_file_of_the_package_that_was_built(built):
    assert refusals(built) == {}


@pytest.mark.parametrize("package", ["files", "built"])
def test_a_compiler_reads_the_core_in_the_package(package, request, tmp_path):
    write_tarball(tmp_path / "twin.tgz", request.getfixturevalue(package))
    scripts = {path: data for path, data in read_tarball(tmp_path / "twin.tgz").items() if path.startswith(CORE)}
    written = [tmp_path / path.removeprefix(CORE) for path in scripts if path.endswith(".cs")]
    for path in written:
        path.write_bytes(scripts[CORE + path.name])
    assert {path.name for path in written} >= {"Teleoperation.cs", "Aligning.cs"}
    compiled(tmp_path / "core.dll", written, [], "-noconfig")


def poses(count, inputs):
    """Random inputs of the network, far beyond the arm's reach too. Shape (count, inputs)."""
    rng = np.random.default_rng(1)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    gravity = rng.uniform(-np.pi, np.pi, (count, 1)) if inputs == 8 else rng.normal(size=(count, 3))
    if inputs > 8:
        gravity /= np.linalg.norm(gravity, axis=1, keepdims=True)
    values = [gravity, rng.uniform(-0.6, 0.6, (count, 3)), quaternions]
    return np.hstack(values).astype(np.float32)


def assert_agreement(network: bytes):
    """All engines answer alike to 1e-6 m: commands, lengths and tips."""
    asked = poses(2000, onnx.load_model_from_string(network).graph.input[0].type.tensor_type.shape.dim[-1].dim_value)
    answers = {name: answer(network, asked) for name, answer in ENGINES.items()}
    assert list(answers) == ["onnxruntime", "ONNX's reference", "tract"]
    expected = answers.pop("onnxruntime")
    assert [values.shape for values in expected] == [(2000, 3)] * 3
    assert min(np.ptp(values, axis=0).min() for values in expected) > 1e-3  # the inputs matter
    for values in answers.values():
        for array, reference in zip(values, expected, strict=True):
            np.testing.assert_allclose(array, reference, rtol=0, atol=1e-6)


def test_all_engines_agree_on_a_network():
    rng = np.random.default_rng(0)
    commands = rng.uniform(0.3, 0.5, (500, 3))
    torch.manual_seed(0)
    network = InverseKinematics(64, poses(500, 8), commands, commands + rng.uniform(0, 0.02, (500, 3)))
    assert_agreement(to_onnx(network, ["tendon_1", "tendon_2", "tendon_3"], 5e-3).SerializeToString())


def test_all_engines_agree_on_the_network_of_the_package_that_was_built(built):
    assert_agreement(built[NETWORK])


def test_an_engine_that_answers_otherwise_is_named(files, monkeypatch):  # noqa: F811
    def off(data, asked):
        return [values + np.float32(2e-6) for values in ENGINES["ONNX's reference"](data, asked)]

    monkeypatch.setattr(readers, "ENGINES", ENGINES | {"tract": off})
    (reason,) = refusals(files).values()
    assert reason.startswith("ValueError: onnxruntime and tract are ")


def without_a_face(obj: bytes) -> bytes:
    return obj.rstrip().rpartition(b"\n")[0] + b"\n"


def turned_inside_out(obj: bytes) -> bytes:
    lines = [line.split() for line in obj.splitlines()]
    return b"\n".join(b" ".join([a, d, c, b] if a == b"f" else [a, b, c, d]) for a, b, c, d in lines) + b"\n"


def shifted(obj: bytes) -> bytes:
    lines = [line.split() for line in obj.splitlines()]
    return b"\n".join(
        b" ".join([a, b"%f" % (float(b) + 1.0), c, d] if a == b"v" else [a, b, c, d]) for a, b, c, d in lines
    )


def with_two_vertices_in_one_place(obj: bytes) -> bytes:
    """As marching cubes leaves them: one vertex split in two of the same digits, with two flat triangles between."""
    lines = obj.decode().splitlines()
    vertices = [line for line in lines if line.startswith("v")]
    faces = np.array([line.split()[1:] for line in lines if line.startswith("f")], int)
    around = np.flatnonzero((faces == 1).any(axis=1))
    twin = len(vertices) + 1
    moved = faces[around[0]]  # one triangle goes over to the twin; two flat ones close the edges
    turned = np.roll(moved, -int(np.flatnonzero(moved == 1)[0]))
    _, second, third = turned.tolist()
    faces[around[0]] = [twin, second, third]
    faces = np.vstack([faces, [[1, second, twin], [1, twin, third]]])
    return "\n".join([*vertices, vertices[0], *(f"f {a} {b} {c}" for a, b, c in faces)]).encode()


@pytest.mark.parametrize(
    ("path", "change"),
    [
        (OBJ, without_a_face),
        (OBJ, turned_inside_out),
        (OBJ, with_two_vertices_in_one_place),
        (GRID, lambda data: data[:-2]),
        (GRID, lambda data: (-np.abs(np.frombuffer(data, "<f2"))).tobytes()),
        (GRID, lambda data: np.full(len(data) // 2, np.nan, "<f2").tobytes()),
        (MODEL, lambda data: data.replace(b"<inertial", b"<site").replace(b"diaginertia", b"size")),
        (NETWORK, lambda data: data[:-40]),
        (NETWORK, lambda data: data.replace(b"MatMul", b"MatMal")),
        (MANIFEST + ".meta", lambda data: b"guid: x\n"),
        ("package.json", lambda data: data[:-4]),
        ("Runtime/Twin.cs", lambda data: data + b"}"),
        ("README.md", lambda data: b"\xff"),
    ],
)
def test_a_file_that_is_wrong_is_refused(files, path, change):  # noqa: F811
    assert set(refusals(files | {path: change(files[path])})) == {path}


def test_a_mesh_elsewhere_than_its_grid_is_seen(files):  # noqa: F811
    reasons = refusals(files | {OBJ: shifted(files[OBJ])})
    assert "off its surface" in reasons[GRID]


def test_a_file_of_an_unknown_kind_is_no_readers(files):  # noqa: F811
    assert refusals(files | {"a.xyz": b""}) == {"a.xyz": "no reader for files of its kind"}
