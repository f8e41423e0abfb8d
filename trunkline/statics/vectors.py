"""Products of vectors in space and 3 x 3 matrices, written out so that the compiler keeps them in registers."""

import numpy as np

from trunkline.statics.kernel import kernel


@kernel
def cross(ax, ay, az, bx, by, bz):
    """a x b, by components."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def turn_about(axis, angle, out):
    """Rodrigues' formula: the rotation by `angle` (rad) about the unit vector `axis`, into `out` (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    t = 1 - c
    out[0, 0], out[0, 1], out[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c


@kernel
def product(a, b, out):
    """a b into `out`, all (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@kernel
def turned(a, v, out):
    """a v into `out` (3,)."""
    for i in range(3):
        out[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]
