"""Least squares of one or two unknowns within bounds, thousands of problems at once.

Own code, for its speed: daqp and scipy.optimize.lsq_linear take one problem at a time. What each takes of all three:
`python -m benchmarks.inverse_kinematics`.
"""

import numpy as np


def bounded_least_squares(matrix: np.ndarray, wanted: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Solve N problems min |wanted - matrix x| with 0 ≤ x ≤ `most`, of k unknowns each, k at most 2.

    The plain solution if it lies within the bounds, else the best point of the box's edges.

    Args:
        matrix: Shape (N, D, k).
        wanted: Shape (N, D).
        most: above 0. Shape (k,).

    Returns:
        x. Shape (N, k).
    """
    square = np.einsum("nki,nkj->nij", matrix, matrix)
    ridge = 1e-12 * np.trace(square, axis1=1, axis2=2)[:, None, None] + 1e-300
    right = np.einsum("nki,nk->ni", matrix, wanted)
    best = np.linalg.solve(square + ridge * np.eye(len(most)), right[:, :, None])[:, :, 0]
    outside = ((best < 0) | (best > most)).any(axis=1)
    least = np.where(outside, np.inf, -np.inf)
    for fixed in range(len(most)):
        for value in (0.0, most[fixed]):
            trial = np.empty_like(best)
            trial[:, fixed] = value
            for free in set(range(len(most))) - {fixed}:
                slope = right[:, free] - square[:, free, fixed] * value
                trial[:, free] = np.clip(slope / (square[:, free, free] + 1e-300), 0, most[free])
            cost = np.einsum("ni,nij,nj->n", trial, square, trial) - 2 * np.einsum("ni,ni->n", trial, right)
            nearer = cost < least
            best[nearer], least[nearer] = trial[nearer], cost[nearer]
    return best
