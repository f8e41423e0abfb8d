"""How far apart two triangle meshes are: the largest distance from a point of either to the other."""

import numpy as np
import trimesh
from scipy.spatial import cKDTree

CANDIDATES = 6  # triangles near a point to which its distance is worked out exactly


def mesh_distance(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray], step: float) -> float:
    """Two-sided (Hausdorff) distance in m, from above by less than a tenth of `step`.

    Args:
        first, second: vertices (V, 3) in m and faces (F, 3).
        step: m, between the points of each mesh that are looked at, at most.
    """
    sides = [surface_points(*mesh, step) for mesh in (first, second)]
    return max(
        _farthest(sides[0][0], *sides[1], second),
        _farthest(sides[1][0], *sides[0], first),
    )


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


def _farthest(points: np.ndarray, near: np.ndarray, owners: np.ndarray, mesh: tuple[np.ndarray, np.ndarray]) -> float:
    vertices, faces = mesh
    distance, index = cKDTree(near).query(points, k=CANDIDATES)
    # The nearest sample bounds the distance from above: only points that it leaves in doubt need their triangles.
    best = distance[:, 0]
    doubtful = np.argsort(-best)
    farthest = 0.0
    for rows in np.array_split(doubtful, max(1, len(doubtful) // 4096)):
        if best[rows[0]] <= farthest:
            break
        triangles = vertices[faces[owners[index[rows]]]].reshape(-1, 3, 3)
        closest = trimesh.triangles.closest_point(triangles, np.repeat(points[rows], CANDIDATES, axis=0))
        gap = np.linalg.norm(closest.reshape(len(rows), CANDIDATES, 3) - points[rows, None], axis=2).min(axis=1)
        farthest = max(farthest, float(gap.max()))
    return farthest
