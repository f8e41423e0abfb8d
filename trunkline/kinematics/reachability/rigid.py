"""The rigid arm's map: where its mount can be with the end effector straight down.

Joint 1 turns everything about the base's z axis, so the set is known from a profile in (r, z) and, in each
cell of it, the azimuths phi0 that the arm reaches with q1 = 0. These come in pairs +-phi0 (limits and links
are mirror images), and q1 covers +-Q1 around each. With the largest and the smallest |phi0| of a cell, a and b,
the azimuth psi = |phi| is reached exactly if b - Q1 <= psi <= Q1 + a. A million poses on a plane leave few gaps.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import Q_MAX, mount_pose
from trunkline.kinematics.sdf.grid import Lattice, close_gaps, distance_from_cells, drop_specks, redistance

# Distances from cells go up and down by a part of a cell along a slanting border. Without these steps, the mesh needs
# half as many triangles for the same accuracy.
STEP_SMOOTHING = 1.0  # cells of the profile, standard deviation of a Gaussian over its distances


@dataclass
class Profile:
    """The reachable set in cylinder coordinates, on a 2-D lattice of (r, z).

    `distance` (R, Z) is the signed distance in m in the plane; `widest` and `narrowest` (R, Z) are the
    largest and smallest azimuth |phi0| in rad reached there with q1 = 0.
    """

    lattice: Lattice
    distance: np.ndarray
    widest: np.ndarray
    narrowest: np.ndarray

    def field(self, points: np.ndarray) -> np.ndarray:
        """Negative inside the reachable set; near its surface a distance in m. `points` (N, 3), result (N,)."""
        r = np.hypot(points[:, 0], points[:, 1])
        azimuth = np.abs(np.arctan2(points[:, 1], points[:, 0]))
        plane = np.column_stack([r, points[:, 2]])
        too_far_round = azimuth - Q_MAX[0] - self.lattice.sample(self.widest, plane)
        too_near_front = self.lattice.sample(self.narrowest, plane) - Q_MAX[0] - azimuth
        return np.maximum(self.lattice.sample(self.distance, plane), r * np.maximum(too_far_round, too_near_front))


def profile(q: np.ndarray, mount_offset: float, spacing: float, closing: float, smallest: int) -> Profile:
    """Profile of the set that downward poses `q` (N, 7) sample.

    Args:
        q: from `sample_downward`, in rad.
        mount_offset: from the flange to the mount, in m.
        spacing: of the (r, z) lattice, in m.
        closing: radius in m of the gaps between samples that are filled.
        smallest: islands and holes of fewer cells than this vanish.
    """
    return outline(*_cylinder(q, mount_offset), spacing, closing, smallest)


def outline(
    radius: np.ndarray, height: np.ndarray, azimuth: np.ndarray, spacing: float, closing: float, smallest: int
) -> Profile:
    """As `profile`, from points at `radius` and `height` (N,), m, and `azimuth` |phi0| (N,), rad."""
    plane = np.column_stack([radius, height])
    # Cells of r < 0 mirror those of r > 0, so that the axis is no border.
    right = Lattice.around([0.0, height.min()], [radius.max(), height.max()], spacing, closing + 3 * spacing)
    first = round(-right.origin[0] / spacing)
    cells = right.occupancy(plane)[first:]
    cells = np.concatenate([cells[:0:-1], cells])
    cells = drop_specks(close_gaps(cells, closing / spacing), smallest)
    # A cell counts as soon as the set touches it: its border lies half a cell too far out on average.
    distance = distance_from_cells(cells, spacing) + 0.5 * spacing
    distance = ndimage.gaussian_filter(distance, STEP_SMOOTHING)[len(cells) // 2:]
    lattice = Lattice(np.array([0.0, right.origin[1]]), spacing, distance.shape)
    window = 2 * int(np.ceil(closing / spacing)) + 1
    widest = _per_cell(np.maximum, lattice, plane, azimuth, -np.inf, window)
    narrowest = _per_cell(np.minimum, lattice, plane, azimuth, np.inf, window)
    return Profile(lattice, distance, widest, narrowest)


def rigid_field(shape: Profile, spacing: float, smoothing: float) -> tuple[np.ndarray, Lattice]:
    """Signed distance field (float64) of the set on a 3-D lattice.

    Args:
        shape: from `profile`.
        spacing: of the lattice, in m.
        smoothing: standard deviation of a Gaussian over the field, in lattice steps.

    Raises:
        InputError: if the set is empty.
    """
    inside = shape.distance < 0
    if not inside.any():
        raise InputError(f"params.yaml: reachability.rigid.profile_voxel: found {shape.lattice.spacing:g} m and an "
                         "empty profile, expected less, or a smaller reachability.rigid.smallest")
    r, z = shape.lattice.axes()
    reach, low, high = r[inside.any(axis=1)][-1], z[inside.any(axis=0)][0], z[inside.any(axis=0)][-1]
    lattice = Lattice.around([-reach, -reach, low], [reach, reach, high], spacing, 4 * spacing)
    points = np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1).reshape(-1, 3)
    field = redistance(shape.field(points).reshape(lattice.shape), spacing)
    return ndimage.gaussian_filter(field, smoothing) if smoothing else field, lattice


def azimuth_from_joint_1(points: np.ndarray, joint_1: np.ndarray) -> np.ndarray:
    """|phi0| (N,), rad, at which `points` (N, 3) would be with q1 = 0 instead of `joint_1` (N,), rad."""
    azimuth = np.arctan2(points[:, 1], points[:, 0]) - joint_1
    return np.abs((azimuth + np.pi) % (2 * np.pi) - np.pi)


def _cylinder(q: np.ndarray, mount_offset: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radius (m), height (m) and |phi0| (rad), each (N,), of the mount."""
    chunks = []
    for start in range(0, len(q), 1 << 15):
        part = q[start:start + (1 << 15)]
        position, _ = mount_pose(part, mount_offset)
        azimuth = azimuth_from_joint_1(position, part[:, 0])
        chunks.append(np.column_stack([np.hypot(position[:, 0], position[:, 1]), position[:, 2], azimuth]))
    return tuple(np.concatenate(chunks).T)


def _per_cell(choose, lattice: Lattice, plane: np.ndarray, values: np.ndarray, empty: float, window: int) -> np.ndarray:
    """`choose` (np.maximum or np.minimum) of `values` within `window` cells, nearest where there are none."""
    result = np.full(lattice.shape, empty)
    choose.at(result, tuple(lattice.nearest(plane).T), values)
    around = ndimage.maximum_filter if choose is np.maximum else ndimage.minimum_filter
    result = around(result, size=window)
    nearest = ndimage.distance_transform_edt(np.isinf(result), return_distances=False, return_indices=True)
    return result[tuple(nearest)]
