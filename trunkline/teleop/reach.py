"""Reach, live: whether a target can be reached now, and the nearest point that can.

The signal s at a point is the maps' signed distance (m, negative inside), trilinear between lattice points; of the
soft arm, linear between the two gravity angles beside the present one, as `trunkline/reachability/reach_signal.py`
defines it. Outside, the nearest point is looked for down the signal's gradient. Where that leads further
away than the nearest lattice point that is inside both of these maps, that is taken, and as much of the way from there
as is inside.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from scipy.spatial import cKDTree

from trunkline.errors import InputError
from trunkline.teleop.vectors import DOWN, Vector, add, distance, dot, scale, subtract

DEPTH = 5e-4  # m inside of the surface to which steps down the gradient go, so that they come inside
PROJECTIONS = 5  # most of them; of a distance, one is enough
HALVINGS = 7  # of the way from the nearest lattice point that is inside: to 1/128 of it
FLAT = 0.1  # square of a slope that is no distance's: midway between parts of a map
SYMMETRY = 2 * math.pi / 3  # three tendons alike: the maps turned by it are the maps
SHELL = 1.5  # lattice steps below the surface within which the points nearest to anything outside lie


Signal = Callable[[Vector], tuple[float, Vector]]  # s and its gradient at a point


class Reading(NamedTuple):
    """`where` a point is, how far `outside_by`, m, and the nearest reachable point, the `offer`, where it is
    outside."""

    where: Literal["inside", "outside", "unknown"]
    outside_by: float = 0.0
    offer: Vector | None = None


class Reach(Protocol):
    """What tells whether targets can be reached."""

    def rigid(self, mount: Vector, pointing: Vector) -> Reading:
        """Of the mount at `mount`, m, the end effector `pointing` along a unit vector, both in the rigid base frame."""
        ...

    def soft(self, tip: Vector, gravity: Vector) -> Reading:
        """Of the tip at `tip`, m, under gravity along a unit vector, both in the soft arm's base frame."""
        ...


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


class MapReach:
    """Reach by the maps of `reachability`: the mount's for an end effector straight down, the tip's by gravity angle.

    What no map tells is "unknown": a mount that points elsewhere, and gravity that is not in the plane of a tendon.
    """

    def __init__(
        self,
        rigid: SignedMap,
        soft: list[SignedMap],
        angles: np.ndarray,
        *,
        tilt_tolerance: float = math.radians(1.0),
        azimuth_tolerance: float = math.radians(5.0),
    ) -> None:
        """
        Args:
            rigid: in the rigid base frame. soft: in the soft arm's, on one lattice, at gravity `angles`, rad,
            ascending. tilt_tolerance: rad, how far from straight down the mount still is. azimuth_tolerance: rad, how
            far from a
                tendon's plane gravity still is.
        """
        if len(soft) != len(angles) or len(soft) < 2 or (np.diff(angles) <= 0).any():
            raise InputError(f"soft maps: found {len(soft)} maps at angles {list(angles)}, expected as many, ascending")
        self._rigid, self._soft, self._angles = rigid, soft, [float(angle) for angle in angles]
        self._tilt, self._azimuth = tilt_tolerance, azimuth_tolerance
        self._rigid_points = _shell(rigid, rigid.values)
        self._soft_points = [
            _shell(low, np.maximum(low.values, high.values)) for low, high in zip(soft, soft[1:], strict=False)
        ]

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "MapReach":
        """From what `reachability` writes into grids.npz: `rigid`, `soft_<angle>`, `soft_angles` and their lattices.

        Raises:
            InputError: one of them is missing.
        """
        names = sorted(name for name, values in arrays.items() if name.startswith("soft_") and np.ndim(values) == 3)
        needed = ("rigid", "rigid_origin", "rigid_spacing", "soft_angles", "soft_origin", "soft_spacing")
        for key in needed:
            if key not in arrays:
                raise InputError(f"maps: found no {key!r}, expected what the stage reachability writes")

        def read(name: str, lattice: str) -> SignedMap:
            origin = tuple(float(x) for x in arrays[f"{lattice}_origin"])
            values = np.ascontiguousarray(arrays[name], dtype=np.float32)
            return SignedMap(values, origin, float(arrays[f"{lattice}_spacing"]))  # type: ignore[arg-type]

        return cls(read("rigid", "rigid"), [read(name, "soft") for name in names], arrays["soft_angles"])

    def rigid(self, mount: Vector, pointing: Vector) -> Reading:
        if dot(pointing, DOWN) < math.cos(self._tilt):
            return Reading("unknown")
        return _reading(self._rigid.slope, self._rigid_points, mount)

    def soft(self, tip: Vector, gravity: Vector) -> Reading:
        level = math.hypot(gravity[0], gravity[1])
        angle = math.atan2(level, -gravity[2])
        turn = 0.0
        if angle > self._tilt:
            azimuth = math.atan2(gravity[1], gravity[0])
            turn = SYMMETRY * round(azimuth / SYMMETRY)
            # The nearer the axis, the less its direction says: what counts is how far gravity is out of the plane.
            if level * abs(math.sin(azimuth - turn)) > math.sin(self._azimuth):
                return Reading("unknown")
        if angle > self._angles[-1]:
            return Reading("unknown")
        upper = next((i for i in range(1, len(self._angles) - 1) if angle <= self._angles[i]), len(self._angles) - 1)
        low, high = self._soft[upper - 1], self._soft[upper]
        share = (angle - self._angles[upper - 1]) / (self._angles[upper] - self._angles[upper - 1])
        share = min(max(share, 0.0), 1.0)

        def signal(point: Vector) -> tuple[float, Vector]:
            (below, down), (above, up) = low.slope(point), high.slope(point)
            return below + share * (above - below), add(scale(down, 1 - share), scale(up, share))

        found = _reading(signal, self._soft_points[upper - 1], _about_z(tip, -turn))
        return found if found.offer is None else found._replace(offer=_about_z(found.offer, turn))


def _reading(signal: Signal, points: tuple[cKDTree | None, np.ndarray], point: Vector) -> Reading:
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


def _about_z(point: Vector, angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return c * point[0] - s * point[1], s * point[0] + c * point[1], point[2]


def _shell(lattice: SignedMap, values: np.ndarray) -> tuple[cKDTree | None, np.ndarray]:
    """A tree of the lattice points just inside of `values`, and these points (N, 3)."""
    points = lattice.points((values <= 0) & (values > -SHELL * lattice.spacing))
    return (cKDTree(points) if len(points) else None), points
