"""Signed distances of convex shapes, and the point of a flat disc that is nearest to one.

A box with round edges is the box of its `half` sizes grown by `edge`; a sphere is one of no size, a hook or a capsule
one of a single length. A cylinder is that of its half sizes (radius, radius, height / 2), grown likewise. Distances are
exact outside of a shape, and inside to the nearest face.
"""

from typing import NamedTuple

import numpy as np

from rehearsal.robot.compiled import kernel
from trunkline.model.statics.vectors import dot, plus

BOX, CYLINDER = 0, 1
NEARER = 6  # times a disc's nearest point is sought anew in a step; it begins where the step before has found it


class Shape(NamedTuple):
    """kind: BOX or CYLINDER. half (3,): m, without the edge. edge: m."""

    kind: int
    half: np.ndarray
    edge: float


@kernel
def distance(kind, half, edge, p):
    """Signed distance of point p (tuple, m, the shape's frame) to the surface, m, and its gradient (tuple)."""
    x, y, z = p
    if kind == CYLINDER:
        radius = np.sqrt(x * x + y * y)
        u, w = radius - half[0], abs(z) - half[2]
        nx, ny = (x / radius, y / radius) if radius > 1e-12 else (1.0, 0.0)
        nz = 1.0 if z > 0 else -1.0
        if u > 0 and w > 0:
            away = np.sqrt(u * u + w * w)
            return away - edge, (u / away * nx, u / away * ny, w / away * nz)
        if u > w:
            return u - edge, (nx, ny, 0.0)
        return w - edge, (0.0, 0.0, nz)
    ux, uy, uz = abs(x) - half[0], abs(y) - half[1], abs(z) - half[2]
    sx, sy, sz = 1.0 if x > 0 else -1.0, 1.0 if y > 0 else -1.0, 1.0 if z > 0 else -1.0
    ox, oy, oz = max(ux, 0.0), max(uy, 0.0), max(uz, 0.0)
    away = np.sqrt(ox * ox + oy * oy + oz * oz)
    if away > 0:
        return away - edge, (sx * ox / away, sy * oy / away, sz * oz / away)
    if ux >= uy and ux >= uz:
        return ux - edge, (sx, 0.0, 0.0)
    if uy >= uz:
        return uy - edge, (0.0, sy, 0.0)
    return uz - edge, (0.0, 0.0, sz)


@kernel
def nearest(kind, half, edge, centre, axis, radius, offset):
    """The point of a disc that is nearest to a shape, by projecting to and fro, which converges as both are convex.

    Args:
        centre, axis: of the disc, tuples, the shape's frame; the axis is a unit vector. radius: m.
        offset: from the centre, where to begin; any.

    Returns:
        Its offset from the centre (tuple, m), its signed distance, m, and the gradient there.
    """
    offset = _onto(offset, axis, radius)
    away, gradient = distance(kind, half, edge, plus(centre, 1.0, offset))
    for _ in range(NEARER):
        offset = _onto(plus(offset, -away, gradient), axis, radius)
        away, gradient = distance(kind, half, edge, plus(centre, 1.0, offset))
    return offset, away, gradient


@kernel
def _onto(offset, axis, radius):
    """The point of a disc about the origin that is nearest to `offset`."""
    flat = plus(offset, -dot(offset, axis), axis)
    size = np.sqrt(dot(flat, flat))
    share = radius / size if size > radius else 1.0
    return share * flat[0], share * flat[1], share * flat[2]
