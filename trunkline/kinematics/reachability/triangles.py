"""The point of some triangles that is nearest to a point."""

import numpy as np


def nearest_on_triangles(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where triangles with `corners` (N, T, 3, 3) come nearest to `points` (N, 3), (N, 3), and how near, (N,).

    Each triangle's candidates are the foot of the perpendicular, where it lies within, and the nearest points of its
    three edges.
    """
    point = points[:, None]
    edge = np.roll(corners, -1, axis=2) - corners
    along = np.einsum("ntek,ntek->nte", point[:, :, None] - corners, edge)
    share = np.clip(along / np.maximum(np.einsum("ntek,ntek->nte", edge, edge), 1e-30), 0, 1)
    on_edges = corners + share[..., None] * edge
    normal = np.cross(edge[:, :, 0], edge[:, :, 1])
    area = np.maximum(np.einsum("ntk,ntk->nt", normal, normal), 1e-30)
    height = np.einsum("ntk,ntk->nt", point - corners[:, :, 0], normal) / area
    foot = point - height[..., None] * normal
    side = np.einsum("ntek,ntk->nte", np.cross(edge, foot[:, :, None] - corners), normal)
    within = (side >= 0).all(axis=2) & (area > 1e-24)
    candidates = np.concatenate([on_edges, foot[:, :, None]], axis=2).reshape(len(points), -1, 3)
    apart = np.linalg.norm(candidates - point, axis=2).reshape(*within.shape, 4)
    apart[..., 3][~within] = np.inf
    apart = apart.reshape(len(points), -1)
    best = apart.argmin(axis=1)
    row = np.arange(len(points))
    return candidates[row, best], apart[row, best]
