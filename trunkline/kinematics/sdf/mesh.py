"""Closed surfaces of signed distance fields: marching cubes, then collapsed edges of least quadric error."""

from dataclasses import dataclass
from pathlib import Path

import fast_simplification
import numpy as np
import trimesh
from point_cloud_utils import signed_distance_to_mesh
from skimage.measure import marching_cubes
from trimesh.exchange.obj import export_obj

from trunkline.errors import InputError
from trunkline.kinematics.sdf.grid import Lattice

# Lattice points at exactly the level make marching cubes emit degenerate triangles and open edges.
LEVEL = 1e-3  # voxels outside zero
DIGITS = 6  # after the decimal point of a vertex in a file: a micrometre
# Of the simplifier: the lowest that comes down to the triangles asked for moves the surface least.
AGGRESSIVENESS = range(3, 10)


@dataclass
class TriangleMesh:
    """A closed triangle mesh: `vertices` (V, 3) in m, `faces` (F, 3), outward by the right-hand rule."""

    vertices: np.ndarray
    faces: np.ndarray

    @property
    def mesh(self) -> trimesh.Trimesh:
        return trimesh.Trimesh(self.vertices, self.faces, process=False)

    def is_closed(self) -> bool:
        """Watertight, consistently wound, outward: every edge has two faces and the volume is positive."""
        mesh = self.mesh
        return bool(mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0)


def surface(field: np.ndarray, lattice: Lattice, most_triangles: int, settings: str) -> TriangleMesh:
    """Closed mesh of the zero level of `field` on a 3-D `lattice`, with at most `most_triangles`, as it is `written`.

    `settings` is the section of params.yaml in which the field's `voxel` is set, for errors.

    Edges are collapsed by quadric error (Garland, Heckbert 1997). That may leave a mesh that is not closed; such a one
    is not taken.

    Raises:
        InputError: if nothing is inside, or no closed mesh of at most `most_triangles` comes out.
    """
    if not (field < 0).any():
        raise InputError(f"params.yaml: {settings}.voxel: found {lattice.spacing:g} m and an empty map, "
                         f"expected less, or a smaller {settings}.smallest")
    whole = unsimplified(field, lattice)
    shape = written(*whole)
    for aggressiveness in AGGRESSIVENESS:
        if _is_small(shape, most_triangles):
            break
        shape = _simplified(*whole, most_triangles, aggressiveness)
    if not _is_small(shape, most_triangles):
        raise InputError(f"params.yaml: {settings}.voxel: found {lattice.spacing:g} m and {len(shape.faces)} "
                         f"triangles, expected a closed mesh of at most reachability.most_triangles, {most_triangles}")
    return shape


def _is_small(shape: TriangleMesh, most_triangles: int) -> bool:
    return len(shape.faces) <= most_triangles and shape.is_closed()


def _simplified(vertices: np.ndarray, faces: np.ndarray, triangles: int, aggressiveness: int) -> TriangleMesh:
    """Edges collapsed until `triangles` are left, or `aggressiveness` allows no more."""
    return written(*fast_simplification.simplify(
        vertices.astype(np.float32), faces.astype(np.int32), target_count=triangles, agg=aggressiveness
    ))  # fmt: skip


def written(vertices: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """The mesh that a reader of its file makes, who takes vertices of the same digits for one.

    `vertices` (V, 3) in m, `faces` (F, 3).
    Where the surface passes a lattice point by less than those digits, marching cubes puts several vertices in one
    place. Triangles between them have no area and are left out: with them the mesh reads as open.
    """
    rounded = np.round(vertices.astype(float), DIGITS)
    _, first, place = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    retained = np.sort(first)
    corners = np.searchsorted(retained, first[place.ravel()])[faces]
    return TriangleMesh(rounded[retained], corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)])


def unsimplified(field: np.ndarray, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) in m and faces (F, 3) of the zero level of `field`, as marching cubes leaves them."""
    # The border counts as outside, so that a set that leaves the lattice is closed there.
    padded = np.pad(np.asarray(field, dtype=np.float32), 1, constant_values=lattice.spacing)
    vertices, faces, _, _ = marching_cubes(padded, LEVEL * lattice.spacing, spacing=(lattice.spacing,) * 3)
    return vertices + (lattice.origin - lattice.spacing), faces


def contains(shape: TriangleMesh, points: np.ndarray) -> np.ndarray:
    """Whether each of `points` (N, 3), m, lies inside."""
    distance, _, _ = signed_distance_to_mesh(
        np.asarray(points, float), np.asarray(shape.vertices, float), np.asarray(shape.faces, np.int32)
    )
    return distance < 0


def write_obj(path: str | Path, shape: TriangleMesh, title: str) -> None:
    """Write a Wavefront OBJ in m, to a micrometre; `title` goes into its first line."""
    text = export_obj(shape.mesh, include_normals=False, include_color=False, header=f"{title}; m", digits=DIGITS)
    Path(path).write_text(text.rstrip() + "\n", encoding="ascii")
