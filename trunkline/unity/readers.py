"""Every file of a finished package, opened by readers that had no part in making it.

Meshes: trimesh, and MuJoCo's reader of OBJ files. Models: MuJoCo. The network: ONNX's checker, and three engines that
share no code: onnxruntime (C++), ONNX's reference implementation (numpy) and tract (Rust). Grids: numpy, by the
manifest's words alone, beside the meshes of the same name. The rest: JSON, YAML, text. Of C# only its brackets are
counted: no compiler reads it here, but a test has Mono compile a package's core.
"""

import io
import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import onnx
import onnxruntime
import tract
import trimesh
import yaml
from onnx.reference import ReferenceEvaluator

from trunkline.twin.package import MANIFEST

ENGINES_APART = 1e-6  # m, of two engines' answers of the same network; its numbers are of 32 bits
POSES = 64  # on which they are compared
WEIGHTS_OFF = 1e-6  # of a direction's own surface, blended for it
MESH_OFF_GRID = 1.0  # lattice steps (the largest), of any vertex from the surface of the grid of its name
ASSET = (
    "<mujoco><asset><mesh name='m' file='{}' inertia='exact'/></asset>"
    "<worldbody><body><geom type='mesh' mesh='m'/></body></worldbody></mujoco>"
)


def refusals(files: dict[str, bytes]) -> dict[str, str]:
    """What a reader says against each of a package's `files` (contents by path) that one refuses."""
    reasons = {}
    for path, data in sorted(files.items()):
        read = READERS.get(path[path.rfind("."):])
        if read is None:
            reasons[path] = "no reader for files of its kind"
            continue
        try:
            read(path, data, files)
        except Exception as error:  # whatever a reader raises, it has refused the file
            reasons[path] = f"{type(error).__name__}: {error}"
    return reasons


def _mesh(path: str, data: bytes, files: dict[str, bytes]) -> None:
    merged = trimesh.load_mesh(io.BytesIO(data), file_type="obj")
    as_written = trimesh.load_mesh(io.BytesIO(data), file_type="obj", process=False)
    for mesh in (merged, as_written):
        if not mesh.is_watertight:
            raise ValueError("trimesh finds it open")
        if not mesh.is_winding_consistent or mesh.volume <= 0:
            raise ValueError("trimesh finds faces that point inwards")
    name = path.rsplit("/", 1)[-1]
    model = mujoco.MjModel.from_xml_string(ASSET.format(name), {name: data})  # raises unless closed, faces outwards
    if len(merged.faces) != len(as_written.faces) or model.mesh_facenum[0] != len(merged.faces):
        raise ValueError("readers find different numbers of triangles")


def _model(path: str, data: bytes, files: dict[str, bytes]) -> None:
    model = mujoco.MjModel.from_xml_string(data.decode())
    mujoco.mj_step(model, mujoco.MjData(model))


def _network(path: str, data: bytes, files: dict[str, bytes]) -> None:
    model = onnx.load_model_from_string(data)
    onnx.checker.check_model(model, full_check=True)
    (entry,) = model.graph.input
    poses = np.random.default_rng(0).uniform(-0.5, 0.5, (POSES, entry.type.tensor_type.shape.dim[-1].dim_value))
    poses[:, -4:] /= np.linalg.norm(poses[:, -4:], axis=1, keepdims=True)  # a quaternion
    reference, *others = ((name, answer(data, poses.astype(np.float32))) for name, answer in ENGINES.items())
    for name, outputs in others:
        apart = max(np.abs(first - second).max() for first, second in zip(reference[1], outputs, strict=True))
        if not apart <= ENGINES_APART:
            raise ValueError(f"{reference[0]} and {name} are {apart:g} apart")


def _by_onnxruntime(data: bytes, poses: np.ndarray) -> list[np.ndarray]:
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    return session.run(None, {session.get_inputs()[0].name: poses})


def _by_reference(data: bytes, poses: np.ndarray) -> list[np.ndarray]:
    model = onnx.load_model_from_string(data)
    return [np.asarray(values) for values in ReferenceEvaluator(model).run(None, {model.graph.input[0].name: poses})]


def _by_tract(data: bytes, poses: np.ndarray) -> list[np.ndarray]:
    with TemporaryDirectory() as folder:  # tract opens files alone
        path = Path(folder) / "network.onnx"
        path.write_bytes(data)
        engine = tract.onnx().load(path).into_model().into_runnable()
    return [tensor.to_numpy() for tensor in engine.run([poses])]


# name: what it answers of a network's file and poses (N, I), each output of the graph in its order, (N, O)
ENGINES: dict[str, Callable[[bytes, np.ndarray], list[np.ndarray]]] = {
    "onnxruntime": _by_onnxruntime,
    "ONNX's reference": _by_reference,
    "tract": _by_tract,
}


def _grid(path: str, data: bytes, files: dict[str, bytes]) -> None:
    manifest = json.loads(files[MANIFEST])
    sheets = manifest["reach"].get("sheets")  # packages of one tilt have none
    if sheets and path in (sheets["file"], sheets["weights"]):
        _sheets(sheets, files)
        return
    ((name, grid),) = [(name, grid) for name, grid in manifest["grids"].items() if grid["file"] == path]
    values = np.frombuffer(data, "<f2").reshape(grid["shape"][::-1]).astype(float)  # z, y, x
    if not np.isfinite(values).all() or not (values < 0).any() or not (values > 0).any():
        raise ValueError("no signed distances: not finite, or of one sign")
    if name in manifest["meshes"]:
        vertices = trimesh.load_mesh(io.BytesIO(files[manifest["meshes"][name]["file"]]), file_type="obj").vertices
        origin, spacing = np.array(grid["origin"]), np.array(grid["spacing"])
        places = (vertices * [-1, 1, 1] - origin) / spacing  # as Unity imports them
        nearest = np.clip(np.round(places), 0, np.array(grid["shape"]) - 1).astype(int)
        x, y, z = nearest.T
        away = np.linalg.norm(places - nearest, axis=1)  # at the border the set may reach half a cell out
        off = np.abs(values[z, y, x]) / spacing.max() - away
        if away.max() > np.sqrt(3) or off.max() > MESH_OFF_GRID:
            raise ValueError("the mesh of its name lies off its surface")


def _sheets(sheets: dict, files: dict[str, bytes]) -> None:
    """Under each of the directions that they were made for, the surface blended is the one that was kept."""
    downs = np.array(sheets["directions"]).reshape(-1, 3)
    points = np.frombuffer(files[sheets["file"]], "<f2").reshape(len(downs), sheets["around"], sheets["along"], 3)
    matrix = np.frombuffer(files[sheets["weights"]], "<f8").reshape(len(downs), len(downs) + 4)
    apart = np.linalg.norm(downs[:, None] - downs, axis=2)
    weights = matrix @ np.vstack([apart**3, np.ones(len(downs)), downs.T])
    if not np.isfinite(points).all() or not np.abs(weights - np.eye(len(downs))).max() < WEIGHTS_OFF:
        raise ValueError("no surfaces: not finite, or blended to others than those that were kept")


def _json(path: str, data: bytes, files: dict[str, bytes]) -> None:
    json.loads(data)


def _meta(path: str, data: bytes, files: dict[str, bytes]) -> None:
    if not {"fileFormatVersion", "guid"} <= set(yaml.safe_load(data)):
        raise ValueError("no file format and identifier")


def _text(path: str, data: bytes, files: dict[str, bytes]) -> None:
    data.decode()


def _script(path: str, data: bytes, files: dict[str, bytes]) -> None:
    text = data.decode()
    for pair in ("{}", "()", "[]"):
        if text.count(pair[0]) != text.count(pair[1]):
            raise ValueError(f"brackets {pair} do not match")


READERS: dict[str, Callable[[str, bytes, dict[str, bytes]], None]] = {
    ".obj": _mesh,
    ".xml": _model,
    ".onnx": _network,
    ".bytes": _grid,
    ".json": _json,
    ".asmdef": _json,
    ".meta": _meta,
    ".md": _text,
    ".cs": _script,
}
