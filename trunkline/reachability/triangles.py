"""The point of some triangles that is nearest to a point."""

import numpy as np


def nearest_on_triangles(point: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Where triangles with `corners` (T, 3, 3) come nearest to `point` (3,), and how near.

    Each triangle's candidates are the foot of the perpendicular, where it lies within, and the nearest points of its
    three edges.
    """
    start = corners
    edge = corners[:, [1, 2, 0]] - start  # (T, 3, 3)
    squared = np.maximum(np.einsum("tek,tek->te", edge, edge), 1e-30)
    share = np.clip(np.einsum("tek,tek->te", point - start, edge) / squared, 0, 1)
    candidates = (start + share[..., None] * edge).reshape(-1, 3)
    normal = np.cross(edge[:, 0], -edge[:, 2])
    area = np.einsum("tk,tk->t", normal, normal)
    flat = area > 1e-24
    normal, some = normal[flat], corners[flat]
    foot = point - (np.einsum("tk,tk->t", point - some[:, 0], normal) / area[flat])[:, None] * normal
    side = np.einsum("tek,tk->te", np.cross(edge[flat], foot[:, None] - some), normal)
    candidates = np.concatenate([candidates, foot[(side >= 0).all(axis=1)]])
    apart = np.linalg.norm(candidates - point, axis=1)
    best = int(apart.argmin())
    return candidates[best], float(apart[best])
