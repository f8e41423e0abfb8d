"""Cholesky factor of the Hessian in time proportional to the number of joints.

Only neighbouring joints share a unit; all others meet through gravity and elastic tendons, in r = 3 + taut tendons
products. So above its 2 x 2 blocks the Hessian is the upper part of a matrix of rank r, and so is its factor U:

    H_jk = left_j · right_k,   U_jk = row_j · right_k   for k in a unit after that of j,

with row from left by the same steps as in a dense factor (Vandebril, Van Barel, Mastronardi 2008, "Matrix
Computations and Semiseparable Matrices", chapter 4). How many times as fast it is as np.linalg.cholesky and
np.linalg.solve in the same compiler: docs/measurements/kinematics.md.
"""

from typing import NamedTuple

import numpy as np

from trunkline.model.statics.kernel import kernel


class Hessian(NamedTuple):
    """Shapes: left, right (r, nq), block (n, 4): the entries (1, 1), (1, 2) and (2, 2) of each unit's block, and
    (2, 1) where friction makes it another."""

    left: np.ndarray
    right: np.ndarray
    block: np.ndarray


class Factor(NamedTuple):
    """Upper U with H = Uᵀ U. Shapes: row (r, nq), block (n, 4), total (r, r): Σ row rowᵀ so far. `column` (r, nq) is
    for L in its place where friction makes H unsymmetric, see `capstan.eliminate`."""

    row: np.ndarray
    block: np.ndarray
    total: np.ndarray
    column: np.ndarray


@kernel
def new_factor(units, rank):
    """Room for the factor of a Hessian of `units` units whose rank is at most `rank`."""
    row, column = np.zeros((rank, 2 * units)), np.zeros((rank, 2 * units))
    return Factor(row, np.zeros((units, 4)), np.zeros((rank, rank)), column)


@kernel
def factorize(hessian, factor):
    """Fill `factor`; False if the Hessian is not positive definite."""
    right, row, total = hessian.right, factor.row, factor.total
    rank = right.shape[0]
    for m in range(rank):
        for k in range(rank):
            total[m, k] = 0.0
    for i in range(hessian.block.shape[0]):
        a, b = 2 * i, 2 * i + 1
        aa, ab, bb = hessian.block[i, 0], hessian.block[i, 1], hessian.block[i, 2]
        for m in range(rank):
            from_a, from_b = 0.0, 0.0
            for k in range(rank):
                from_a += total[m, k] * right[k, a]
                from_b += total[m, k] * right[k, b]
            aa -= right[m, a] * from_a
            ab -= right[m, a] * from_b
            bb -= right[m, b] * from_b
            row[m, a] = hessian.left[m, a] - from_a
            row[m, b] = hessian.left[m, b] - from_b
        if not aa > 0:
            return False
        aa = aa**0.5
        ab /= aa
        bb -= ab * ab
        if not bb > 0:
            return False
        bb = bb**0.5
        factor.block[i, 0], factor.block[i, 1], factor.block[i, 2] = aa, ab, bb
        for m in range(rank):
            row[m, a] /= aa
            row[m, b] = (row[m, b] - ab * row[m, a]) / bb
        for m in range(rank):
            for k in range(rank):
                total[m, k] += row[m, a] * row[k, a] + row[m, b] * row[k, b]
    return True


@kernel
def solve(hessian, factor, x):
    """Solve H y = x in place, `x` of shape (nq,)."""
    right, row, block = hessian.right, factor.row, factor.block
    rank, units = right.shape[0], block.shape[0]
    sums = np.zeros(rank)
    for i in range(units):
        a, b = 2 * i, 2 * i + 1
        at_a, at_b = x[a], x[b]
        for m in range(rank):
            at_a -= right[m, a] * sums[m]
            at_b -= right[m, b] * sums[m]
        x[a] = at_a / block[i, 0]
        x[b] = (at_b - block[i, 1] * x[a]) / block[i, 2]
        for m in range(rank):
            sums[m] += row[m, a] * x[a] + row[m, b] * x[b]
    for m in range(rank):
        sums[m] = 0.0
    for i in range(units - 1, -1, -1):
        a, b = 2 * i, 2 * i + 1
        at_a, at_b = x[a], x[b]
        for m in range(rank):
            at_a -= row[m, a] * sums[m]
            at_b -= row[m, b] * sums[m]
        x[b] = at_b / block[i, 2]
        x[a] = (at_a - block[i, 1] * x[b]) / block[i, 0]
        for m in range(rank):
            sums[m] += right[m, a] * x[a] + right[m, b] * x[b]
