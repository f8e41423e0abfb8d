"""What a page draws: a model's visible geoms as triangles, merged, so that any arm shows, in three draw calls.

A part is one triangle mesh. Every vertex belongs to one body, in whose frame it is, so that a page moves a whole robot
as a skinned mesh: one bone a body, in the order of the poses that are streamed.
"""

import base64
import io
import json
from dataclasses import dataclass
from typing import Any

import fast_simplification
import mujoco
import numpy as np
import trimesh

from trunkline.frames import rotation_from_wxyz
from trunkline.unity.twin import MANIFEST

VERSION = 1
ROBOT, WORLD, THINGS = "robot", "world", "things"  # parts
SHOWN = 3  # MuJoCo shows geoms of groups below by default; touching shapes are in 3
CREASE = np.radians(40.0)  # faces that meet at less are shaded as one surface
SIDES = 24  # of what is round
MOST_TRIANGLES = 25_000  # of the robot, which is drawn twice, for its ghost
SHELL_TRIANGLES = 6_000
COARSEST = 200  # triangles below which no mesh is brought

_Geom = mujoco.mjtGeom


@dataclass(frozen=True)
class Part:
    """positions: m, in the frames of the vertices' bodies (V, 3), float32. normals: (V, 3), unit length. colours: sRGB,
    0 to 255 (V, 3). bodies: of each vertex, its row among the poses (V,). faces: counter-clockwise from outside
    (F, 3)."""

    positions: np.ndarray
    normals: np.ndarray
    colours: np.ndarray
    bodies: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True)
class Scene:
    """ids: of the bodies that move and are seen, in the model (B,); a frame has their poses in this order. bodies:
    their names. parts: by name; that of the world stands in the base frame, its bodies idle."""

    ids: np.ndarray
    bodies: list[str]
    parts: dict[str, Part]


def scene_of(model: mujoco.MjModel, most_triangles: int = MOST_TRIANGLES) -> Scene:
    """All visible geoms of `model`: the robot, what stands still around it, and the things that move freely.

    Args:
        most_triangles: of robot and things together; meshes are decimated by quadric error until they fit.
    """
    geoms = [geom for geom in range(model.ngeom) if _is_visible(model, geom)]
    moving = [geom for geom in geoms if model.body_weldid[model.geom_bodyid[geom]] or _is_robot(model, geom)]
    ids = np.unique(model.geom_bodyid[moving]) if moving else np.zeros(0, int)
    share = _share(model, moving, most_triangles)
    drawn: dict[str, list[Part]] = {}
    for geom in geoms:
        shape = _shape(model, geom, share)
        if shape is None:
            continue
        body = int(model.geom_bodyid[geom])
        turn, shift = rotation_from_wxyz(model.geom_quat[geom]), model.geom_pos[geom]
        name, row = WORLD, 0
        if geom in moving:
            name, row = THINGS if _is_free(model, body) else ROBOT, int(np.searchsorted(ids, body))
        corners, normals, faces = _shaded(shape)
        colour = np.round(255 * np.clip(_colour(model, geom), 0, 1)).astype(np.uint8)
        count = len(corners)
        drawn.setdefault(name, []).append(Part(
            (turn.apply(corners) + shift).astype(np.float32), turn.apply(normals), np.tile(colour, (count, 1)),
            np.full(count, row), faces))  # fmt: skip
    names = [model.body(int(body)).name for body in ids]
    return Scene(ids, names, {name: _merged(parts) for name, parts in drawn.items()})


def as_json(scene: Scene) -> dict[str, Any]:
    """The scene as JSON: arrays little-endian in base64, of the types that `docs/protocol.md` states."""
    parts = {}
    for name, part in scene.parts.items():
        parts[name] = {
            "vertices": len(part.positions),
            "triangles": len(part.faces),
            "positions": packed(part.positions, "<f4"),
            "normals": packed(np.round(127 * part.normals), "i1"),
            "colours": packed(part.colours, "u1"),
            "bodies": packed(part.bodies, "<u2"),
            "indices": packed(part.faces, "<u4"),
        }
    return {"version": VERSION, "bodies": scene.bodies, "parts": parts}


def shells_json(files: dict[str, bytes]) -> dict[str, Any]:
    """Of a package's `files`: the surface of the mount's reach in the base frame, and how many points the tip's has,
    which are streamed, as it turns with gravity.

    Returns:
        `rigid` with `positions` and `indices` as a part has them, null where nothing is mapped; `tip` with `around` and
        `along`, null where the package knows one tilt of gravity at a time.
    """
    manifest = json.loads(files[MANIFEST])
    rigid, sheets = manifest["meshes"].get("rigid"), manifest["reach"].get("sheets")
    shells: dict[str, Any] = {"rigid": None, "tip": None}
    if rigid is not None:
        read = trimesh.load_mesh(io.BytesIO(files[rigid["file"]]), file_type="obj", process=False)
        corners, faces = _collapsed(read.vertices, read.faces, SHELL_TRIANGLES)
        x, z, y = corners.T * [[-1], [1], [1]]  # as `unity.frame.unity_obj` wrote them
        shells["rigid"] = {"positions": packed(np.column_stack([x, y, z]), "<f4"), "indices": packed(faces, "<u4")}
    if sheets:
        shells["tip"] = {name: sheets[name] for name in ("around", "along")}
    return shells


def packed(values: np.ndarray, kind: str) -> str:
    """An array's bytes in C order, of the numpy type `kind`, in base64."""
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode()


def _is_visible(model: mujoco.MjModel, geom: int) -> bool:
    return model.geom_group[geom] < SHOWN and model.geom_rgba[geom, 3] > 0


def _is_robot(model: mujoco.MjModel, geom: int) -> bool:
    """Whether it is on a body other than the world: a robot's foot does not move either, and is the robot's."""
    return bool(model.geom_bodyid[geom])


def _is_free(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body hangs on a free joint."""
    joint = model.body_jntadr[model.body_rootid[body]]
    return joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE


def _colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    material = model.geom_matid[geom]
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return rgba[:3]


def _share(model: mujoco.MjModel, geoms: list[int], most: int) -> float:
    """Of the triangles of every mesh, how many may stay for all of them to be at most `most`."""
    meshes = [geom for geom in geoms if model.geom_type[geom] == _Geom.mjGEOM_MESH]
    whole = sum(int(model.mesh_facenum[model.geom_dataid[geom]]) for geom in meshes)
    rest = (len(geoms) - len(meshes)) * 4 * SIDES
    return min(1.0, max(most - rest, 0) / max(whole, 1))


def _shape(model: mujoco.MjModel, geom: int, share: float) -> trimesh.Trimesh | None:
    """A geom in its own frame; None for what has no sensible triangles, planes without end and height fields."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == _Geom.mjGEOM_MESH:
        return _decimated(model, int(model.geom_dataid[geom]), share)
    if kind == _Geom.mjGEOM_SPHERE:
        return trimesh.creation.icosphere(subdivisions=2, radius=size[0])
    if kind == _Geom.mjGEOM_ELLIPSOID:
        return trimesh.creation.icosphere(subdivisions=2, radius=1.0).apply_scale(size)
    if kind == _Geom.mjGEOM_CAPSULE:
        return trimesh.creation.capsule(2 * size[1], size[0], count=[SIDES, SIDES // 2])
    if kind == _Geom.mjGEOM_CYLINDER:
        return trimesh.creation.cylinder(size[0], 2 * size[1], sections=SIDES)
    if kind == _Geom.mjGEOM_BOX:
        return trimesh.creation.box(2 * size)
    if kind == _Geom.mjGEOM_PLANE and size[0] > 0 and size[1] > 0:
        x, y = size[:2]
        corners = [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]
        return trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)
    return None


def _decimated(model: mujoco.MjModel, mesh: int, share: float) -> trimesh.Trimesh:
    """A mesh of the model, of which `share` of the triangles may stay (Garland, Heckbert 1997)."""
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
    shape = trimesh.Trimesh(vertices, faces, process=True)  # joins corners, without which nothing collapses
    goal = max(int(share * len(shape.faces)), COARSEST)
    return trimesh.Trimesh(*_collapsed(shape.vertices, shape.faces, goal), process=False)


def _collapsed(vertices: np.ndarray, faces: np.ndarray, goal: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) with at most about `goal` triangles left."""
    vertices, faces = np.asarray(vertices, np.float32), np.asarray(faces, np.int32)
    return fast_simplification.simplify(vertices, faces, target_count=goal) if goal < len(faces) else (vertices, faces)


def _shaded(shape: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, their normals, and faces: a corner is there once for each surface that meets others in a crease."""
    split = trimesh.graph.smooth_shade(shape, angle=CREASE)
    return np.array(split.vertices), np.array(split.vertex_normals), np.array(split.faces)


def _merged(parts: list[Part]) -> Part:
    """Parts one after the other."""
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])[:-1]
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)])
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("positions", "normals", "colours", "bodies")
    }
    return Part(**columns, faces=faces)
