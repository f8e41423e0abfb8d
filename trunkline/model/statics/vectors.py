"""Vectors in space as tuples of three numbers, matrices as tuples of three rows: both stay in registers.

Numba's np.cross and @ make an array for each result. How many times as slow that is:
docs/measurements/kinematics.md.
"""

import numpy as np

from trunkline.model.statics.kernel import kernel


@kernel
def vector(array, i):
    """Row i of an array (N, 3)."""
    return array[i, 0], array[i, 1], array[i, 2]


@kernel
def copy(source, target):
    """target[:] = source for arrays of shape (N,); numba takes seconds to compile the slices' own checks."""
    for k in range(source.shape[0]):
        target[k] = source[k]


@kernel
def largest(values):
    """Largest magnitude in an array of shape (N,)."""
    most = 0.0
    for value in values:
        most = max(most, abs(value))
    return most


@kernel
def dot(a, b):
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def plus(a, factor, b):
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@kernel
def turn_about(axis, angle):
    """Rodrigues' formula: the rotation by `angle` (rad) about the unit vector `axis`."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis
    t = 1 - c
    return (
        (t * x * x + c, t * x * y - s * z, t * x * z + s * y),
        (t * x * y + s * z, t * y * y + c, t * y * z - s * x),
        (t * x * z - s * y, t * y * z + s * x, t * z * z + c),
    )


@kernel
def turned(matrix, v):
    """The matrix times a vector."""
    return dot(matrix[0], v), dot(matrix[1], v), dot(matrix[2], v)


@kernel
def product(a, b):
    """The matrix a b."""
    return _row_times(a[0], b), _row_times(a[1], b), _row_times(a[2], b)


@kernel
def _row_times(row, b):
    return (
        row[0] * b[0][0] + row[1] * b[1][0] + row[2] * b[2][0],
        row[0] * b[0][1] + row[1] * b[1][1] + row[2] * b[2][1],
        row[0] * b[0][2] + row[1] * b[1][2] + row[2] * b[2][2],
    )
