"""Vectors of three numbers and quaternions (w, x, y, z) as plain tuples.

Not numpy: the core's answers must be the same bytes wherever they are computed, and array libraries choose their order
of summation by the processor. For single vectors it is faster too.
"""

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
DOWN: Vector = (0.0, 0.0, -1.0)


def add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(a: Vector, factor: float) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def norm(a: Vector) -> float:
    return math.sqrt(dot(a, a))


def distance(a: Vector, b: Vector) -> float:
    return norm(subtract(a, b))


def wrapped(angle: float) -> float:
    """`angle` in [-π, π), rad."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """The rotation q, then p."""
    a, b, c, d = p
    e, f, g, h = q
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def conjugate(q: Quaternion) -> Quaternion:
    return q[0], -q[1], -q[2], -q[3]


def rotate(q: Quaternion, v: Vector) -> Vector:
    """`v` turned by the unit quaternion `q`."""
    u = (q[1], q[2], q[3])
    t = scale(cross(u, v), 2.0)
    return add(add(v, scale(t, q[0])), cross(u, t))


def about(axis: Vector, angle: float) -> Quaternion:
    """The rotation by `angle`, rad, about an `axis` of unit length."""
    s = math.sin(angle / 2)
    return math.cos(angle / 2), s * axis[0], s * axis[1], s * axis[2]


def unit(q: Quaternion) -> Quaternion:
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length


def angle_between(p: Quaternion, q: Quaternion) -> float:
    """Angle of the rotation from `p` to `q`, rad, in [0, π]."""
    r = multiply(conjugate(p), q)
    return 2 * math.atan2(math.sqrt(r[1] * r[1] + r[2] * r[2] + r[3] * r[3]), abs(r[0]))


def toward(p: Quaternion, q: Quaternion, share: float) -> Quaternion:
    """`p` turned by a `share` of the shortest way to `q` (slerp; Shoemake 1985)."""
    r = multiply(conjugate(p), q)
    if r[0] < 0:
        r = (-r[0], -r[1], -r[2], -r[3])
    sine = math.sqrt(r[1] * r[1] + r[2] * r[2] + r[3] * r[3])
    if sine < 1e-12:
        return p
    half = math.atan2(sine, r[0])
    return unit(multiply(p, about((r[1] / sine, r[2] / sine, r[3] / sine), 2 * half * share)))


def least_rotation(a: Vector, b: Vector) -> Quaternion:
    """The least rotation that turns the direction `a` into `b`, both of unit length and not opposite."""
    c = cross(a, b)
    return unit((1.0 + dot(a, b), c[0], c[1], c[2]))
