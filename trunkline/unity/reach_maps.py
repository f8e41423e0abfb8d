"""The reachability stage's meshes and grids, in the form that Unity reads."""

from pathlib import Path

import numpy as np
import trimesh
from scipy.ndimage import map_coordinates

from trunkline.errors import InputError
from trunkline.kinematics.sdf.grid import Lattice
from trunkline.kinematics.sdf.mesh import unsimplified
from trunkline.kinematics.sdf.mesh_distance import mesh_distance
from trunkline.unity.frame import unity_obj, unity_position, unity_volume
from trunkline.unity.manifest import GridBlock, Mesh, ReachBlock, SheetsBlock
from trunkline.unity.rounding import rounded

FOLDER = "Runtime/Reachability"
BETWEEN_GRIDS = (
    "trilinear between the points of the two grids beside the gravity angle, linear between their angles; also out of"
    " reach: points off the grid and gravity angles beyond the first and last"
)
PROBES = 200_000  # points by which grids are compared
LOOKS = 0.5  # lattice steps, between the points of a mesh that are looked at
TO_SHEET = "distance from the sheet's triangles under the gravity that pulls, less the tolerance"


def frame_of(name: str) -> str:
    """The frame of a map by its name: soft maps are the arm's own, the others hang on the rigid arm."""
    return "base of the soft arm" if name.startswith("soft") else "base of the rigid arm"


def convert_meshes(
    paths: list[Path], arrays: dict[str, np.ndarray], source: str
) -> tuple[dict[str, bytes], dict[str, Mesh]]:
    """Meshes (OBJ or STL) as OBJ files for Unity.

    Args:
        arrays, source: as of `convert_grids`; how far a mesh is from the surface of the grid of its name is measured.

    Returns:
        Contents by path in the package, and the manifest's blocks by name of the map.
    """
    files, blocks = {}, {}
    for path in paths:
        mesh = trimesh.load_mesh(path)
        if len(mesh.faces) == 0:
            raise InputError(f"{path}: found no triangles, expected a closed mesh")
        file = f"{FOLDER}/{path.stem}.obj"
        files[file] = unity_obj(mesh.vertices, mesh.faces)
        blocks[path.stem] = Mesh(
            file=file,
            frame=frame_of(path.stem),
            triangles=len(mesh.faces),
            deviation=_deviation(mesh, arrays, path.stem, source),
        )
    return files, blocks


def _deviation(mesh: trimesh.Trimesh, arrays: dict[str, np.ndarray], name: str, source: str) -> float | None:
    """How far a mesh and the surface of the grid of its name, as it is packed, are from each other at most, m."""
    if name not in arrays:
        return None
    origin, spacing = (_lattice(arrays, name, key, source) for key in ("origin", "spacing"))
    if np.ptp(spacing):
        return None
    lattice = Lattice(origin, float(spacing[0]), arrays[name].shape)
    whole = unsimplified(rounded(arrays[name]), lattice)
    return mesh_distance((mesh.vertices, mesh.faces), whole, LOOKS * lattice.spacing)


def convert_grids(arrays: dict[str, np.ndarray], source: str) -> tuple[dict[str, bytes], dict[str, GridBlock]]:
    """Signed distance grids as raw volumes for Unity.

    Args:
        arrays: every array of three dimensions is a map (x, y, z) by its name; `<name>_origin` (3,) and
            `<name>_spacing` in m place it, or `origin` and `spacing` if maps share a lattice.
        source: the file they are from, for messages.
    """
    files, blocks = {}, {}
    for name, values in sorted(arrays.items()):
        if values.ndim != 3:
            continue
        origin, spacing = (_lattice(arrays, name, key, source) for key in ("origin", "spacing"))
        file = f"{FOLDER}/{name}.bytes"
        packed = rounded(values)
        files[file] = unity_volume(packed)
        blocks[name] = GridBlock(
            file=file,
            frame=frame_of(name),
            shape=unity_position(values.shape).tolist(),
            origin=unity_position(origin).tolist(),
            spacing=unity_position(spacing).tolist(),
            overlap=_overlap(values, packed),
        )
    if not blocks:
        raise InputError(f"{source}: found no grid of three dimensions, expected one for each map")
    return files, blocks


def _overlap(values: np.ndarray, packed: np.ndarray) -> float:
    """Of the insides of two grids, by points anywhere between theirs: those in both over those in either."""
    points = np.random.default_rng(0).uniform(0, np.array(values.shape) - 1, (PROBES, 3)).T
    first, second = (map_coordinates(np.asarray(grid, float), points, order=1) <= 0 for grid in (values, packed))
    return round(float((first & second).sum() / max((first | second).sum(), 1)), 5)


def convert_sheets(arrays: dict[str, np.ndarray], source: str) -> tuple[dict[str, bytes], SheetsBlock | None]:
    """The surface of tips under any gravity, for Unity; nothing where the maps are of one tilt.

    Args:
        arrays: `sheets_points` (D, R, S, 3), m, under gravity `sheets_downs` (D, 3), and
            `sheets_matrix` (D, D + 4), see `reachability.sheets`.
        source: the file they are from, for messages.
    """
    if "sheets_points" not in arrays:
        return {}, None
    points, downs, matrix = (
        np.asarray(arrays[name], float) for name in ("sheets_points", "sheets_downs", "sheets_matrix")
    )
    count = len(points)
    if points.ndim != 4 or points.shape[3] != 3 or (downs.shape, matrix.shape) != ((count, 3), (count, count + 4)):
        raise InputError(
            f"{source}: found sheets_points of shape {points.shape}, sheets_downs of shape {downs.shape} and"
            f" sheets_matrix of shape {matrix.shape}, expected (D, R, S, 3), (D, 3) and (D, D + 4)"
        )
    file, weights = f"{FOLDER}/sheets.bytes", f"{FOLDER}/sheet_weights.bytes"
    directions = unity_position(downs)
    block = SheetsBlock(
        file=file,
        weights=weights,
        directions=directions.reshape(-1).tolist(),
        around=points.shape[1],
        along=points.shape[2],
    )
    matrix = np.column_stack([matrix[:, :-3], unity_position(matrix[:, -3:])])  # its last columns are of g itself
    return {file: unity_position(points).astype("<f2").tobytes(), weights: matrix.astype("<f8").tobytes()}, block


def describe_reach(arrays: dict[str, np.ndarray], sheets: SheetsBlock | None, source: str) -> ReachBlock:
    """How a headset tells from the soft grids or sheets what is out of reach.

    Args:
        arrays: maps named `soft_<angle>` in the order of `soft_angles`, rad; `soft_threshold` and `soft_tolerance`, m.
        sheets: if gravity comes from any side.
        source: the file they are from, for messages.
    """
    for key in ("soft_angles", "soft_threshold", "soft_tolerance"):
        if key not in arrays:
            raise InputError(f"{source}: found no {key}, expected it beside the soft maps")
    names = sorted(name for name, values in arrays.items() if name.startswith("soft_") and values.ndim == 3)
    angles = np.asarray(arrays["soft_angles"], float).tolist()
    if len(names) != len(angles):
        raise InputError(f"{source}: found {len(names)} soft maps and {len(angles)} soft_angles, expected as many")
    return ReachBlock(
        angles=angles,
        grids=names,
        threshold=float(arrays["soft_threshold"]),
        tolerance=float(arrays["soft_tolerance"]),
        sheets=sheets,
        signal=TO_SHEET if sheets else BETWEEN_GRIDS,
    )


def _lattice(arrays: dict[str, np.ndarray], name: str, key: str, source: str) -> np.ndarray:
    group = name.split("_")[0]
    for candidate in (f"{name}_{key}", f"{group}_{key}", key):
        if candidate in arrays:
            return np.broadcast_to(arrays[candidate].astype(float), 3)
    raise InputError(f"{source}: {name}: found no {key}, expected {name}_{key}, {group}_{key} or {key}")
