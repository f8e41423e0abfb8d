"""Cholesky factor of a small dense matrix, in place, in the order that lets the compiler vectorise it."""

from numba import njit


@njit(cache=True)
def factorize(matrix, factor):
    """Upper U with matrix = Uᵀ U from the upper triangle of `matrix`; False if that is not positive definite.

    Args:
        matrix, factor: shape (n, n); `factor` is overwritten above and on its diagonal.
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(i, n):
            factor[i, j] = matrix[i, j]
    for k in range(n):
        pivot = factor[k, k]
        if not pivot > 0:
            return False
        scale = 1 / pivot**0.5
        for j in range(k, n):
            factor[k, j] *= scale
        for i in range(k + 1, n):
            f = factor[k, i]
            for j in range(i, n):
                factor[i, j] -= f * factor[k, j]
    return True


@njit(cache=True)
def solve(factor, x):
    """Solve Uᵀ U y = x in place, `x` of shape (n,)."""
    n = factor.shape[0]
    for i in range(n):
        x[i] /= factor[i, i]
        f = x[i]
        for j in range(i + 1, n):
            x[j] -= f * factor[i, j]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for j in range(i + 1, n):
            s -= factor[i, j] * x[j]
        x[i] = s / factor[i, i]
