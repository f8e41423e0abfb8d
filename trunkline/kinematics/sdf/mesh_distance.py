"""How far apart two triangle meshes are: the largest distance from a point of either to the other."""

import numpy as np
from point_cloud_utils import closest_points_on_mesh


def mesh_distance(
    first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray], step: float
) -> float:
    """Two-sided (Hausdorff) distance in m, from below by less than 0.6 `step`.

    Args:
        first, second: vertices (V, 3) in m and faces (F, 3).
        step: m, between the points of each mesh that are looked at, at most.
    """
    return max(_farthest(surface_points(*first, step)[0], second), _farthest(surface_points(*second, step)[0], first))


def surface_points(vertices: np.ndarray, faces: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3) on every triangle, corners included, no further apart than `step` m, and whose they are (P,)."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(1, np.ceil(longest / step)).astype(int)
    points, owners = [], []
    for count in np.unique(parts):
        rows = np.flatnonzero(parts == count)
        i, j = np.divmod(np.arange((count + 1) ** 2), count + 1)
        inside = i + j <= count
        weights = np.column_stack([i, j, count - i - j])[inside] / count
        points.append((weights @ corners[rows]).reshape(-1, 3))
        owners.append(np.repeat(rows, len(weights)))
    return np.concatenate(points), np.concatenate(owners)


def _farthest(points: np.ndarray, mesh: tuple[np.ndarray, np.ndarray]) -> float:
    vertices, faces = mesh
    distance, _, _ = closest_points_on_mesh(points, np.asarray(vertices, float), np.asarray(faces, np.int32))
    return float(distance.max())
