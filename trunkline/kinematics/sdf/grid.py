"""Signed distance fields on a regular lattice: from points or a rough field, their blending, their overlap.

Sign convention everywhere: negative inside the reachable set, positive outside, zero on its surface, in m.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage
from skimage.morphology import isotropic_closing, remove_small_holes, remove_small_objects

from trunkline.errors import InputError


@dataclass(frozen=True)
class Lattice:
    """Points `origin + spacing * index` in 2 or 3 dimensions: `origin` (d,) and `spacing` in m."""

    origin: np.ndarray
    spacing: float
    shape: tuple[int, ...]

    @classmethod
    def around(cls, lower: ArrayLike, upper: ArrayLike, spacing: float, margin: float) -> "Lattice":
        """The lattice through multiples of `spacing` that covers a box and `margin` m more on each side."""
        first = np.floor((np.asarray(lower) - margin) / spacing).astype(int)
        last = np.ceil((np.asarray(upper) + margin) / spacing).astype(int)
        return cls(first * spacing, spacing, tuple(int(n) for n in last - first + 1))

    def axes(self) -> list[np.ndarray]:
        """Coordinates along each axis, in m."""
        return [o + self.spacing * np.arange(n) for o, n in zip(self.origin, self.shape, strict=True)]

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Indices (N, d) of the lattice points nearest to `points` (N, d)."""
        return np.rint((points - self.origin) / self.spacing).astype(int)

    def occupancy(self, points: np.ndarray) -> np.ndarray:
        """Whether any of `points` (N, d) lies in each cell; points off the lattice do not count."""
        index = self.nearest(points)
        index = index[((index >= 0) & (index < self.shape)).all(axis=1)]
        cells = np.zeros(self.shape, dtype=bool)
        cells[tuple(index.T)] = True
        return cells

    def sample(self, field: np.ndarray, points: np.ndarray) -> np.ndarray:
        """`field` at `points` (N, d), multilinear; beyond the lattice, the value at its border. Shape (N,)."""
        index = (np.asarray(points) - self.origin) / self.spacing
        return ndimage.map_coordinates(field, index.T, order=1, mode="nearest", output=np.float64)


def close_gaps(cells: np.ndarray, radius: float) -> np.ndarray:
    """Morphological closing with a ball of `radius` cells: gaps narrower than its diameter fill up."""
    pad = int(np.ceil(radius)) + 1  # or what grows beyond the border is cut off, and shrinks back too far
    return isotropic_closing(np.pad(cells, pad), radius)[(slice(pad, -pad),) * cells.ndim]


def drop_specks(cells: np.ndarray, smallest: int) -> np.ndarray:
    """`cells` without islands, and then without holes, of fewer than `smallest` cells."""
    return remove_small_holes(remove_small_objects(cells, max_size=smallest - 1), max_size=smallest - 1)


def without_specks(field: np.ndarray, spacing: float, smallest: int) -> np.ndarray:
    """`field` (m) after `drop_specks` on its inside, as a distance field again."""
    cells = field < 0
    retained = drop_specks(cells, smallest)
    return redistance(np.where(retained == cells, field, np.where(retained, -0.5, 0.5) * spacing), spacing)


def distance_from_cells(cells: np.ndarray, spacing: float) -> np.ndarray:
    """Signed distance in m to the border of occupied `cells`, half-way between cell centres."""
    outside = ndimage.distance_transform_edt(~cells)
    inside = ndimage.distance_transform_edt(cells)
    return spacing * (np.maximum(outside - 0.5, 0.0) - np.maximum(inside - 0.5, 0.0))


def redistance(field: np.ndarray, spacing: float) -> np.ndarray:
    """Signed distance in m to the zero level of `field`, whose values are distances near zero only.

    Values within one spacing of zero stay. From a lattice point x further out to the nearest point p across
    the surface it is |x - p| less the depth |field(p)| of p: off by at most three quarters of a spacing, a tenth in the
    root mean square. Fast marching halves the largest error, but moves values near zero by up to a third of a spacing
    and takes longer (docs/measurements/kinematics.md).
    """
    inside = field < 0
    result = np.array(field, dtype=float)
    for side, sign in ((inside, -1.0), (~inside, 1.0)):
        distance, nearest = ndimage.distance_transform_edt(side, return_indices=True)
        depth = np.minimum(np.abs(field[tuple(nearest)]), spacing)
        far = side & (np.abs(field) > spacing)
        result[far] = sign * np.maximum(distance * spacing - depth, spacing)[far]
    return result


def blend(fields: np.ndarray, angles: np.ndarray, angle: float) -> np.ndarray:
    """Field at `angle`, linear between the two of `angles` (K,), ascending, beside it.

    Args:
        fields: signed distances on one lattice, (K, ...).
        angles: gravity angles of the fields, in rad.
        angle: in rad; outside the range of `angles` the nearest field holds.
    """
    if len(angles) == 1:
        return fields[0]
    upper = int(np.clip(np.searchsorted(angles, angle), 1, len(angles) - 1))
    share = np.clip((angle - angles[upper - 1]) / (angles[upper] - angles[upper - 1]), 0.0, 1.0)
    low, high = fields[upper - 1], fields[upper]
    return low + np.asarray(share, dtype=low.dtype) * (high - low)


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    """Intersection over union of the insides of two fields on one lattice.

    Raises:
        InputError: if both are empty: that would say nothing, and look like a perfect match.
    """
    a, b = first < 0, second < 0
    union = int((a | b).sum())
    if not union:
        raise InputError("overlap of two maps: found both empty, expected points inside at least one "
                         "(params.yaml: a smaller `voxel` or `smallest` keeps more of a map)")
    return int((a & b).sum()) / union
