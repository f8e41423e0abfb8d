"""A map as a signed distance on a lattice, and the nearest point within it.

The signal s at a point is trilinear between lattice points. Outside, the nearest point is looked for down the signal's
gradient. Where that leads further away than the nearest lattice point that is inside, that is taken, and as much of the
way from there as is inside.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from trunkline.ar.teleop.reach_message import Reading
from trunkline.ar.teleop.vectors import Vector, distance, dot, scale, subtract

DEPTH = 5e-4  # m inside of the surface to which steps down the gradient go, so that they come inside
PROJECTIONS = 5  # most of them; of a distance, one is enough
HALVINGS = 7  # of the way from the nearest lattice point that is inside: to 1/128 of it
FLAT = 0.1  # square of a slope that is no distance's: midway between parts of a map
SHELL = 1.5  # lattice steps below the surface within which the points nearest to anything outside lie

Signal = Callable[[Vector], tuple[float, Vector]]  # s and its gradient at a point


@dataclass(frozen=True)
class SignedMap:
    """Signed distances `values` (nx, ny, nz), m, on the lattice `origin` (3,) + `spacing` * index, m."""

    values: np.ndarray
    origin: Vector
    spacing: float

    def at(self, point: Vector) -> float:
        """s at `point`; off the lattice, the value at its border and the distance to that."""
        return self.slope(point)[0]

    def slope(self, point: Vector) -> tuple[float, Vector]:
        """s at `point`, and its gradient there."""
        low, share, off = [], [], []
        for x, first, count in zip(point, self.origin, self.values.shape, strict=True):
            place = (x - first) / self.spacing
            inside = min(max(place, 0.0), count - 1.0)
            cell = min(int(inside), count - 2)
            low.append(cell)
            share.append(inside - cell)
            off.append(place - inside)
        (i, j, k), (u, v, w) = low, share
        item = self.values.item
        a, b, c, d = item(i, j, k), item(i, j + 1, k), item(i + 1, j, k), item(i + 1, j + 1, k)
        da, db = item(i, j, k + 1) - a, item(i, j + 1, k + 1) - b
        dc, dd = item(i + 1, j, k + 1) - c, item(i + 1, j + 1, k + 1) - d
        a, b, c, d = a + w * da, b + w * db, c + w * dc, d + w * dd  # along z; then along y, then x
        e, f = a + v * (b - a), c + v * (d - c)
        up = (da + v * (db - da)) + u * ((dc + v * (dd - dc)) - (da + v * (db - da)))
        value = e + u * (f - e)
        if not (off[0] or off[1] or off[2]):
            return value, scale((f - e, (b - a) + u * ((d - c) - (b - a)), up), 1 / self.spacing)
        beyond = math.sqrt(off[0] ** 2 + off[1] ** 2 + off[2] ** 2)
        along = ((f - e) / self.spacing, ((b - a) + u * ((d - c) - (b - a))) / self.spacing, up / self.spacing)
        x, y, z = (o / beyond if o else g for o, g in zip(off, along, strict=True))
        return value + self.spacing * beyond, (x, y, z)

    def points(self, cells: np.ndarray) -> np.ndarray:
        """Lattice points of `cells`, bool of the shape of `values`. Shape (N, 3), m."""
        return np.array(self.origin) + self.spacing * np.argwhere(cells)


def read(signal: Signal, points: tuple[cKDTree | None, np.ndarray], point: Vector) -> Reading:
    """Of `point` by a `signal`; `points` as `shell` gives them: where else to look for the nearest."""
    outside, slope = signal(point)
    if outside <= 0:
        return Reading("inside")
    tree, places = points
    if tree is None:
        return Reading("outside", outside)
    aim = _projected(signal, point, outside, slope)
    # Whether any lattice point is nearer; with a bound, the tree is soon asked.
    _, index = tree.query(point, distance_upper_bound=math.inf if aim is None else distance(aim, point))
    if aim is not None and index == len(places):
        return Reading("outside", outside, aim)
    x, y, z = places[index]
    near = (float(x), float(y), float(z))
    inside, beyond = 0.0, 1.0  # shares of the way from `near` to `point`
    for _ in range(HALVINGS):
        half = (inside + beyond) / 2
        if signal(_between(near, point, half))[0] <= 0:
            inside = half
        else:
            beyond = half
    return Reading("outside", outside, _between(near, point, inside))


def _projected(signal: Signal, point: Vector, value: float, slope: Vector) -> Vector | None:
    """Where the way down the signal's gradient from `point` comes inside; None where it does not."""
    for _ in range(PROJECTIONS):
        steep = dot(slope, slope)
        if steep < FLAT:
            return None
        point = subtract(point, scale(slope, (value + DEPTH) / steep))
        value, slope = signal(point)
        if value <= 0:
            return point
    return None


def _between(a, b, share: float) -> Vector:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


def shell(lattice: SignedMap, values: np.ndarray) -> tuple[cKDTree | None, np.ndarray]:
    """A tree of the lattice points just inside of `values`, and these points (N, 3)."""
    points = lattice.points((values <= 0) & (values > -SHELL * lattice.spacing))
    return (cKDTree(points) if len(points) else None), points
