"""The hybrid map: where the soft tip can be while the rigid arm holds the mount straight down.

The soft arm then hangs at gravity angle 0 whatever the rigid arm does, and joint 7 turns it freely about the
vertical (its range of 332 degrees is more than the 120 degrees between tendons). So the map is the Minkowski sum

    H = R + S,    S = the soft map at angle 0, swept about z,

of the rigid map R. With R_t the set of points within t of R (distance below t), R_t + S is the set of points
within t of H: sums at a few offsets t give the distance field of H near its surface, finer than the lattice.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from trunkline.reachability.grid import Lattice, redistance

OFFSETS = np.array([1.0, 0.5, 0.0, -0.5, -1.0])  # lattice steps, from the widest set to the narrowest
AZIMUTHS = 72  # directions of the sweep: 7 mm apart at a radius of 8 cm, less than a cell


def sweep(field: NDArray, lattice: Lattice, points: NDArray) -> NDArray:
    """Smallest value of ``field`` on the circle about the z axis through each of ``points`` (N, 3). Shape (N,)."""
    radius = np.hypot(points[:, 0], points[:, 1])
    result = np.full(len(points), np.inf)
    for azimuth in 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS:
        turned = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), points[:, 2]])
        np.minimum(result, lattice.sample(field, turned), out=result)
    return result


def swept_cells(field: NDArray, lattice: Lattice, spacing: float) -> tuple[NDArray, Lattice]:
    """Cells of the swept inside of ``field``, on a lattice of ``spacing`` through the origin."""
    x, y, z = lattice.axes()
    reach = float(np.hypot(np.abs(x).max(), np.abs(y).max()))
    target = Lattice.around([-reach, -reach, z[0]], [reach, reach, z[-1]], spacing, 0.0)
    # One value per radius and height: the circle is the same for every azimuth.
    radii = np.arange(0.0, reach + 2 * spacing, spacing / 2)
    plane = Lattice(np.array([0.0, target.origin[2]]), spacing / 2, (len(radii), 2 * target.shape[2]))
    rr, zz = np.meshgrid(*plane.axes(), indexing="ij")
    swept = sweep(field, lattice, np.column_stack([rr.ravel(), np.zeros(rr.size), zz.ravel()])).reshape(rr.shape)
    gx, gy, gz = np.meshgrid(*target.axes(), indexing="ij")
    values = plane.sample(swept, np.column_stack([np.hypot(gx, gy).ravel(), gz.ravel()]))
    cells = values.reshape(target.shape) < 0
    return _trim(cells, target)


def minkowski_field(
    field: NDArray, lattice: Lattice, cells: NDArray, cells_lattice: Lattice, smoothing: float
) -> tuple[NDArray, Lattice]:
    """Signed distance field of (inside of ``field``) + ``cells``, exact near its surface to the lattice of ``cells``.

    Args:
        field: signed distance in m on ``lattice``, at least 1.5 ``cells_lattice.spacing`` wide outside.
        cells: the set to add, on ``cells_lattice``, whose spacing and phase the result has.
        smoothing: standard deviation of a Gaussian over the field, in lattice steps.
    """
    spacing = cells_lattice.spacing
    lower, upper = lattice.origin, lattice.origin + lattice.spacing * (np.array(lattice.shape) - 1)
    rigid = Lattice.around(lower, upper, spacing, 2 * spacing)
    points = np.stack(np.meshgrid(*rigid.axes(), indexing="ij"), axis=-1).reshape(-1, 3)
    values = lattice.sample(field, points).reshape(rigid.shape)
    shape = tuple(a + b - 1 for a, b in zip(rigid.shape, cells.shape, strict=True))
    padded = tuple(fft.next_fast_len(n, real=True) for n in shape)
    kernel = fft.rfftn(cells.astype(np.float32), padded)
    result = np.full(shape, 2.0 * spacing)
    window = tuple(slice(n) for n in shape)
    for offset in OFFSETS:
        grown = fft.rfftn((values < offset * spacing).astype(np.float32), padded)
        pairs = fft.irfftn(grown * kernel, padded)[window]
        # First reached at an offset between this one and the wider one before it.
        result[pairs > 0.5] = spacing * (offset - 0.25)
    result[result < spacing * OFFSETS[-1]] = -2.0 * spacing
    total = Lattice(rigid.origin + cells_lattice.origin, spacing, shape)
    field = redistance(result, spacing)
    return ndimage.gaussian_filter(field, smoothing) if smoothing else field, total


def _trim(cells: NDArray, lattice: Lattice) -> tuple[NDArray, Lattice]:
    """The smallest box of ``cells`` that holds them all, and its lattice."""
    where = np.nonzero(cells)
    first, last = np.array([w.min() for w in where]), np.array([w.max() for w in where])
    box = cells[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))]
    return box, Lattice(lattice.origin + lattice.spacing * first, lattice.spacing, box.shape)
