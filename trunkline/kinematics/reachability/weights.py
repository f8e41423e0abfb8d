"""Weights that interpolate over directions of gravity: what is known at nodes, at any direction between them.

With nodes g_j, the polyharmonic spline of order 3 is

    w(g) = M [ |g - g_1|³, …, |g - g_D|³, 1, g ],    M the first D rows of [[Φ, P], [Pᵀ, 0]]⁻¹,

Φ_jk = |g_j - g_k|³ and P a row (1, g_j) a node (Duchon, 1977): it gives the nodes' own values there, and every function
that is linear in g exactly. No azimuth is special, nor the axis.
"""

import numpy as np


def spline_matrix(nodes: np.ndarray) -> np.ndarray:
    """M for `nodes`, unit vectors (D, 3), not all in one plane. Shape (D, D + 4)."""
    count = len(nodes)
    linear = np.column_stack([np.ones(count), nodes])
    whole = np.block([[_cubed(nodes, nodes), linear], [linear.T, np.zeros((4, 4))]])
    return np.linalg.inv(whole)[:count]


def spline_weights(matrix: np.ndarray, nodes: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Of each node, for the direction `down` (3,). Shape (D,), their sum 1."""
    return matrix @ np.concatenate([_cubed(down[None], nodes)[0], [1.0], down])


def _cubed(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.linalg.norm(first[:, None] - second[None], axis=2) ** 3
