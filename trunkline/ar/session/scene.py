"""What a client draws: the geoms of the composed model, so that any arm shows, and the reach."""

from dataclasses import dataclass

import fast_simplification
import mujoco
import numpy as np
import trimesh

from trunkline.ar.session.binary import MARKERS
from trunkline.errors import InputError
from trunkline.kinematics.reachability.weights import spline_weights
from trunkline.kinematics.sdf.grid import Lattice
from trunkline.kinematics.sdf.mesh import surface

SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane", mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule", mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder", mujoco.mjtGeom.mjGEOM_BOX: "box", mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}  # fmt: skip
SHOWN = 3  # MuJoCo shows geoms of groups below by default; what only touches is in 3
MOST_TRIANGLES = 20_000  # of all meshes; a robot is drawn twice, for its ghost
COARSEST = 200  # triangles below which no mesh is brought
SHELL_TRIANGLES = 4000
DIGITS = 5  # after the decimal point of what is drawn, m


def scene(model: mujoco.MjModel, bodies: tuple[str, ...], maps: dict[str, np.ndarray], length: float) -> dict:
    """As docs/live-sessions.md has it.

    Args:
        bodies: names, in the order of the frames' rows. maps: `unity.unpacked.maps_of`. length: of the arm, m.
    """
    place = {model.body(name).id: row for row, name in enumerate(bodies)}
    meshes: dict[int, int] = {}
    geoms = [_geom(model, geom, place, meshes) for geom in range(model.ngeom) if _is_drawn(model, geom, place)]
    share = min(1.0, MOST_TRIANGLES / max(sum(int(model.mesh_facenum[mesh]) for mesh in meshes), 1))
    sheets = maps.get("sheets_points")
    return {
        "bodies": list(bodies),
        "markers": list(MARKERS),
        "geoms": geoms,
        "meshes": [_mesh(model, mesh, share) for mesh in meshes],
        "shell": None if sheets is None else {"around": int(sheets.shape[1]), "along": int(sheets.shape[2])},
        "reach": _reach(maps),
        "arm": {"length": length, "units": sum(name.startswith("unit_") for name in bodies)},
    }


@dataclass(frozen=True)
class Shells:
    """Where the tip can be under gravity from any side: points by direction (D, R, S, 3), m, in the soft base."""

    points: np.ndarray
    downs: np.ndarray
    matrix: np.ndarray

    @classmethod
    def of(cls, maps: dict[str, np.ndarray]) -> "Shells | None":
        """None where the maps know one tilt alone."""
        if "sheets_points" not in maps:
            return None
        points, downs, matrix = (np.asarray(maps[f"sheets_{key}"], float) for key in ("points", "downs", "matrix"))
        return cls(points, downs, matrix)

    def at(self, down: np.ndarray) -> np.ndarray:
        """Under gravity along `down` (3,), a unit vector in the soft base. Shape (R S, 3)."""
        weights = spline_weights(self.matrix, self.downs, np.asarray(down, dtype=float))
        return np.tensordot(weights, self.points, axes=1).reshape(-1, 3)


def _is_drawn(model: mujoco.MjModel, geom: int, place: dict[int, int]) -> bool:
    body, shape = int(model.geom_bodyid[geom]), int(model.geom_type[geom])
    is_shown = model.geom_group[geom] < SHOWN and model.geom_rgba[geom, 3] > 0
    return (body == 0 or body in place) and is_shown and shape in SHAPES


def _geom(model: mujoco.MjModel, geom: int, place: dict[int, int], meshes: dict[int, int]) -> dict:
    body, mesh = int(model.geom_bodyid[geom]), None
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = meshes.setdefault(int(model.geom_dataid[geom]), len(meshes))
    material = int(model.geom_matid[geom])
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return {
        "body": place.get(body, -1),
        "shape": SHAPES[mujoco.mjtGeom(int(model.geom_type[geom]))],
        "size": _rounded(model.geom_size[geom]),
        "position": _rounded(model.geom_pos[geom]),
        "quaternion": [float(value) for value in model.geom_quat[geom]],
        "rgba": [round(float(value), 3) for value in rgba],
        "mesh": mesh,
    }


def _mesh(model: mujoco.MjModel, mesh: int, share: float) -> dict:
    """With `share` of its triangles left: edges are collapsed by quadric error (Garland, Heckbert 1997)."""
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    vertices = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]
    faces = model.mesh_face[face : face + model.mesh_facenum[mesh]]
    goal = max(int(share * len(faces)), COARSEST)
    if goal < len(faces):
        shape = trimesh.Trimesh(vertices, faces, process=True)  # joins corners, without which nothing collapses
        corners, triangles = np.asarray(shape.vertices, np.float32), np.asarray(shape.faces, np.int32)
        vertices, faces = fast_simplification.simplify(corners, triangles, target_count=goal)
    return {"vertices": _rounded(vertices), "faces": [int(value) for value in np.ravel(faces)]}


def _reach(maps: dict[str, np.ndarray]) -> dict | None:
    """Of the mount, as a mesh; None where it makes none."""
    x, y, z = (float(value) for value in maps["rigid_origin"])
    values = np.asarray(maps["rigid"], dtype=float)
    try:
        lattice = Lattice(np.array([x, y, z]), float(maps["rigid_spacing"]), values.shape)
        mesh = surface(values, lattice, SHELL_TRIANGLES, "reachability")
    except InputError:
        return None
    return {"vertices": _rounded(mesh.vertices), "faces": [int(value) for value in mesh.faces.ravel()]}


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), DIGITS) for value in np.ravel(values)]
