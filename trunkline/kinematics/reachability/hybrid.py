"""The hybrid map: where the soft tip can be while the rigid arm holds the mount straight down.

The soft arm then hangs at gravity angle 0 whatever the rigid arm does, and joint 7 turns it freely about the
vertical (its range of 332 degrees is more than the 120 degrees between tendons). So the map is the Minkowski sum

    H = R + S,    S = the soft arm's tips at angle 0, swept about z,

of the rigid map R. S is the tips themselves, not the soft map around them: its tolerance would swell H. With
R_t the set of points within t of R (distance below t), R_t + S is the set of points within t of H: sums at a
few offsets t give the distance field of H near its surface, finer than the lattice.
"""

import numpy as np
from scipy import fft, ndimage

from trunkline.kinematics.sdf.grid import Lattice, redistance, without_specks

# A tip counts for the nearest lattice point only if each coordinate is this near: with all tips, up to half a
# step away, H would be 0.4 steps too large on average.
NEAR = 0.2  # lattice steps
OFFSETS = np.array([1.0, 0.5, 0.0, -0.5, -1.0])  # t in lattice steps, from the widest set to the narrowest


def swept_cells(tips: np.ndarray, spacing: float) -> tuple[np.ndarray, Lattice]:
    """Cells of a lattice of `spacing` (m) through the origin that `tips` (N, 3) pass when turned about z."""
    radius, height = np.hypot(tips[:, 0], tips[:, 1]), tips[:, 2]
    reach = radius.max()
    # Once per cell of the half-plane, a quarter of the spacing wide: tips that share one pass the same cells.
    plane = Lattice.around([0.0, height.min()], [reach, height.max()], spacing / 4, spacing)
    radius, height = (plane.origin + plane.spacing * np.argwhere(plane.occupancy(np.column_stack([radius, height])))).T
    azimuths = np.linspace(0.0, 2 * np.pi, int(np.ceil(8 * np.pi * reach / spacing)) + 1)
    circle = np.stack([np.outer(radius, np.cos(azimuths)), np.outer(radius, np.sin(azimuths)),
                       np.broadcast_to(height[:, None], (len(height), len(azimuths)))], axis=-1)
    lattice = Lattice.around([-reach, -reach, height.min()], [reach, reach, height.max()], spacing, 0.0)
    passed = circle.reshape(-1, 3)
    offset = (passed - lattice.origin) / spacing
    return lattice.occupancy(passed[(np.abs(offset - np.rint(offset)) <= NEAR).all(axis=1)]), lattice


def minkowski_field(
    field: np.ndarray, lattice: Lattice, cells: np.ndarray, cells_lattice: Lattice, smoothing: float, smallest: int
) -> tuple[np.ndarray, Lattice]:
    """Signed distance field of (inside of `field`) + `cells`, exact near its surface to the lattice of `cells`.

    Args:
        field: signed distance in m on `lattice`, at least 1.5 `cells_lattice.spacing` wide outside.
        cells: the set to add, on `cells_lattice`, whose spacing and phase the result has.
        smoothing: standard deviation of a Gaussian over the field, in lattice steps.
        smallest: islands and cavities of fewer cells vanish.
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
    field = without_specks(redistance(result, spacing), spacing, smallest)
    return ndimage.gaussian_filter(field, smoothing) if smoothing else field, total
