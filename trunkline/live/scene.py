"""What a client draws: the geoms of the composed model, so that any arm shows, and the reach."""

from dataclasses import dataclass

import fast_simplification
import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.fields.grid import Lattice
from trunkline.fields.mesh import surface
from trunkline.live.wire import MARKERS
from trunkline.reachability.weights import spline_weights

SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane", mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule", mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder", mujoco.mjtGeom.mjGEOM_BOX: "box", mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}  # fmt: skip
SHELL_TRIANGLES = 4000
MESH_TRIANGLES = 3000  # of a body's mesh, at most: the maker's have some 20 000, and a headset draws all of them
DIGITS = 5  # after the decimal point of what is drawn, m


def scene(model: mujoco.MjModel, bodies: tuple[str, ...], maps: dict[str, np.ndarray], length: float) -> dict:
    """As docs/protocol.md has it.

    Args:
        bodies: names, in the order of the frames' rows. maps: `unity.unpacked.maps_of`. length: of the arm, m.
    """
    place = {model.body(name).id: row for row, name in enumerate(bodies)}
    meshes: dict[int, int] = {}
    geoms = [_geom(model, geom, place, meshes) for geom in range(model.ngeom) if _is_seen(model, geom, place)]
    sheets = maps.get("sheets_points")
    return {
        "bodies": list(bodies),
        "markers": list(MARKERS),
        "geoms": geoms,
        "meshes": [_mesh(model, mesh) for mesh in meshes],
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


def _is_seen(model: mujoco.MjModel, geom: int, place: dict[int, int]) -> bool:
    body = int(model.geom_bodyid[geom])
    return (body == 0 or body in place) and model.geom_rgba[geom, 3] > 0 and int(model.geom_type[geom]) in SHAPES


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


def _mesh(model: mujoco.MjModel, mesh: int) -> dict:
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    vertices = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]
    faces = model.mesh_face[face : face + model.mesh_facenum[mesh]]
    if len(faces) > MESH_TRIANGLES:
        vertices, faces = fast_simplification.simplify(
            np.asarray(vertices, np.float32), np.asarray(faces, np.int32), target_count=MESH_TRIANGLES
        )
    return {"vertices": _rounded(vertices), "faces": [int(value) for value in faces.ravel()]}


def _reach(maps: dict[str, np.ndarray]) -> dict | None:
    """Of the mount, as a mesh; None where it makes none."""
    x, y, z = (float(value) for value in maps["rigid_origin"])
    values = np.asarray(maps["rigid"], dtype=float)
    try:
        lattice = Lattice(np.array([x, y, z]), float(maps["rigid_spacing"]), values.shape)
        found = surface(values, lattice, SHELL_TRIANGLES, "reachability")
    except InputError:
        return None
    return {"vertices": _rounded(found.vertices), "faces": [int(value) for value in found.faces.ravel()]}


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), DIGITS) for value in np.ravel(values)]
