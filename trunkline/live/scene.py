"""What a page draws: a model's visible geoms and their meshes, decimated, so that any arm shows; a package's shells.

The tables of docs/protocol.md say what the JSON holds.
"""

import io
import json
from dataclasses import dataclass
from typing import Any

import fast_simplification
import mujoco
import numpy as np
import trimesh

from trunkline.unity.twin import MANIFEST

SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): "plane",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}
SHOWN = 3  # MuJoCo shows geoms of groups below by default; what only touches is in 3
MOST_TRIANGLES = 20_000  # of all meshes; they are drawn twice, for the robot has a ghost
SHELL_TRIANGLES = 6_000
COARSEST = 200  # triangles below which no mesh is brought
DIGITS = 5  # of a length in m after the point: a hundredth of a millimetre


@dataclass(frozen=True)
class Drawn:
    """ids: of the bodies that are drawn, in the model (B,): the poses that are streamed are theirs, in this order.
    scene: `bodies`, `geoms` and `meshes`, as JSON has them."""

    ids: np.ndarray
    scene: dict[str, Any]


def drawn(model: mujoco.MjModel, most_triangles: int = MOST_TRIANGLES) -> Drawn:
    """All visible geoms of `model`; height fields and what else has no simple shape are left out.

    Args:
        most_triangles: of all meshes together; they are decimated by quadric error until they fit.
    """
    geoms = [geom for geom in range(model.ngeom) if _is_visible(model, geom)]
    ids = np.unique([body for body in model.geom_bodyid[geoms] if body])
    used = sorted({int(model.geom_dataid[geom]) for geom in geoms if _shape(model, geom) == "mesh"})
    share = min(1.0, most_triangles / max(sum(int(model.mesh_facenum[mesh]) for mesh in used), 1))
    listed = []
    for geom in geoms:
        body, mesh = int(model.geom_bodyid[geom]), int(model.geom_dataid[geom])
        listed.append({
            "body": int(np.searchsorted(ids, body)) if body else -1,
            "shape": _shape(model, geom),
            "size": model.geom_size[geom].tolist(),
            "position": model.geom_pos[geom].tolist(),
            "quaternion": model.geom_quat[geom].tolist(),
            "rgba": _colour(model, geom).tolist(),
            "mesh": used.index(mesh) if _shape(model, geom) == "mesh" else None,
        })  # fmt: skip
    scene = {
        "bodies": [model.body(int(body)).name for body in ids],
        "geoms": listed,
        "meshes": [_mesh(model, mesh, share) for mesh in used],
    }
    return Drawn(ids, scene)


def shells(files: dict[str, bytes]) -> dict[str, Any]:
    """Of a package's `files`: `shell` and `reach`, as JSON has them."""
    manifest = json.loads(files[MANIFEST])
    rigid, sheets = manifest["meshes"].get("rigid"), manifest["reach"].get("sheets")
    reach = None
    if rigid is not None:
        read = trimesh.load_mesh(io.BytesIO(files[rigid["file"]]), file_type="obj", process=False)
        x, z, y = np.asarray(read.vertices).T * [[-1], [1], [1]]  # as `unity.frame.unity_obj` wrote them
        reach = _listed(*_collapsed(np.column_stack([x, y, z]), read.faces, SHELL_TRIANGLES))
    return {"shell": {name: sheets[name] for name in ("around", "along")} if sheets else None, "reach": reach}


def _is_visible(model: mujoco.MjModel, geom: int) -> bool:
    return model.geom_group[geom] < SHOWN and _colour(model, geom)[3] > 0 and _shape(model, geom) != ""


def _shape(model: mujoco.MjModel, geom: int) -> str:
    return SHAPES.get(int(model.geom_type[geom]), "")


def _colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """rgba, 0 to 1. Shape (4,)."""
    material = model.geom_matid[geom]
    return model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]


def _mesh(model: mujoco.MjModel, mesh: int, share: float) -> dict[str, list]:
    """A mesh of the model, of which `share` of the triangles may stay."""
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
    shape = trimesh.Trimesh(vertices, faces, process=True)  # joins corners, without which nothing collapses
    goal = max(int(share * len(faces)), COARSEST)
    return _listed(*_collapsed(np.asarray(shape.vertices), np.asarray(shape.faces), goal))


def _collapsed(vertices: np.ndarray, faces: np.ndarray, goal: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) with edges collapsed (Garland, Heckbert 1997) until about `goal` are left."""
    vertices, faces = np.asarray(vertices, np.float32), np.asarray(faces, np.int32)
    return fast_simplification.simplify(vertices, faces, target_count=goal) if goal < len(faces) else (vertices, faces)


def _listed(vertices: np.ndarray, faces: np.ndarray) -> dict[str, list]:
    return {
        "vertices": np.round(vertices.astype(float), DIGITS).ravel().tolist(),
        "faces": np.asarray(faces).ravel().tolist(),
    }
