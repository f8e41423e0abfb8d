"""Vertices of a coarse mesh moved so that its triangles, not its corners, lie on a surface.

A simplifier leaves corners on the surface, and triangles inside where it is convex. Each vertex moves along its normal
by minus the mean signed distance of the triangles around it, weighted as the vertex weighs in each point of them.
"""

import numpy as np
from numpy.typing import NDArray

from trunkline.reachability.grid import Lattice

POINTS = 6  # along each side of a triangle
ROUNDS = 2


def fit_vertices(vertices: NDArray, faces: NDArray, field: NDArray, lattice: Lattice, level: float) -> NDArray:
    """Vertices (V, 3), m, fitted to where ``field`` (m) on ``lattice`` is ``level``; ``faces`` (F, 3) stay."""
    i, j = np.divmod(np.arange(POINTS**2), POINTS)
    weights = np.column_stack([i, j, POINTS - 1 - i - j])[i + j < POINTS] / (POINTS - 1)
    for _ in range(ROUNDS):
        corners = vertices[faces]
        points = np.einsum("pk,fkc->fpc", weights, corners)
        distance = lattice.sample(field, points.reshape(-1, 3)).reshape(points.shape[:2]) - level
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(across, axis=1)
        normal, off, total = np.zeros_like(vertices), np.zeros(len(vertices)), np.zeros(len(vertices))
        for corner in range(3):
            share = area[:, None] * weights[:, corner] ** 2
            np.add.at(normal, faces[:, corner], across)
            np.add.at(off, faces[:, corner], (share * distance).sum(axis=1))
            np.add.at(total, faces[:, corner], share.sum(axis=1))
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-15)
        vertices = vertices - normal * (off / np.maximum(total, 1e-15))[:, None]
    return vertices
