"""Workspace surfaces: the surface of the tips that the soft arm reaches, at any direction of gravity.

Under one gravity the tips form a surface, with two coordinates: which way the tendons pull, around the arm, and how
far along the tip's way. So a surface is a lattice of points, the same lattice under every gravity, and a point of it
moves smoothly as gravity turns. What is interpolated over directions of gravity is where the points are: few directions
suffice, and kilobytes for each, where grids of distances would have to lie a few degrees apart.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.distance import cdist

from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.dataset.sampling import workspace_surface_at
from trunkline.kinematics.reachability.triangles import nearest_on_triangles
from trunkline.kinematics.reachability.weights import spline_matrix, spline_weights
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.model.statics.chain import Chain

NEAREST = 6  # points of a surface beside a target whose triangles are looked at


@dataclass
class WorkspaceSurfaces:
    """`downs`: directions of gravity in the base frame, unit vectors (D, 3). `points`: m, by direction, way around the
    arm, place along the tip's way (D, R, S, 3), float16 as they are packed. `tolerance`: m, as `soft.SoftShape`."""

    downs: np.ndarray
    points: np.ndarray
    tolerance: float

    @cached_property
    def matrix(self) -> np.ndarray:
        """Of the interpolation, see `weights`. Shape (D, D + 4)."""
        return spline_matrix(self.downs)

    @cached_property
    def _flat(self) -> np.ndarray:
        return self.points.reshape(len(self.points), -1).astype(np.float32)

    def arrays(self) -> dict[str, np.ndarray]:
        """All that it takes to use them, by name."""
        return {"sheets_points": self.points, "sheets_downs": self.downs, "sheets_matrix": self.matrix}

    def at(self, down: np.ndarray) -> np.ndarray:
        """The surface under gravity `down`, a unit vector (3,): m. Shape (R, S, 3)."""
        weights = spline_weights(self.matrix, self.downs, np.asarray(down, float)).astype(np.float32)
        return (weights @ self._flat).reshape(self.points.shape[1:]).astype(float)

    def nearest(self, surface: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The reachable point nearest to each of `points` (N, 3), m (N, 3), and how far it is, m (N,); `surface` as
        `at` gives it."""
        corners = surface.reshape(-1, 3)
        beside = np.argpartition(cdist(points, corners, "sqeuclidean"), NEAREST, axis=1)[:, :NEAREST]
        triangles = self.triangles[self._triangles_of[beside].reshape(len(points), -1)]
        return nearest_on_triangles(points, corners[triangles])

    def signal(self, surface: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Above 0 where `points` (N, 3) are out of reach, about how far, m. Shape (N,)."""
        return self.nearest(surface, points)[1] - self.tolerance

    @cached_property
    def triangles(self) -> np.ndarray:
        """Of a surface's points in one row, (R S, 3): their indices. Shape (2 R (S - 1), 3)."""
        return surface_triangles(*self.points.shape[1:3])

    @cached_property
    def _triangles_of(self) -> np.ndarray:
        """Six triangles that have each point, some twice at the edges. Shape (R S, 6)."""
        corners = self.triangles.T.reshape(-1)
        order = np.argsort(corners, kind="stable")
        count = np.bincount(corners, minlength=self.points[0].size // 3)
        first = np.concatenate([[0], np.cumsum(count)[:-1]])
        return order[first[:, None] + np.minimum(np.arange(6), count[:, None] - 1)] % len(self.triangles)


def surface_triangles(around: int, along: int) -> np.ndarray:
    """Two triangles a cell of a lattice of `around` by `along` points that closes around the arm."""
    ray, step = (part.reshape(-1) for part in np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij"))
    here, beside = ray * along + step, (ray + 1) % around * along + step
    return np.concatenate([np.column_stack([here, here + 1, beside + 1]), np.column_stack([here, beside + 1, beside])])


def finer(surface: np.ndarray, times: int) -> np.ndarray:
    """Points of the surface (R, S, 3) and so many times denser between them, bilinear. Shape (N, 3)."""
    shares = np.arange(times) / times
    closed = np.concatenate([surface, surface[:1]])
    along = closed[:, :-1, None] + shares[:, None] * (closed[:, 1:, None] - closed[:, :-1, None])
    rows = np.concatenate([along.reshape(len(closed), -1, 3), closed[:, -1:]], axis=1)
    around = rows[:-1, None] + shares[:, None, None] * (rows[1:, None] - rows[:-1, None])
    return around.reshape(-1, 3)


def build_surfaces(
    chain: Chain, downs: np.ndarray, around: int, along: int, tolerance: float, done: Callable[[], None],
    learnt: ResidualMap | None = None,
) -> WorkspaceSurfaces:  # fmt: skip
    """Surfaces of `around` by `along` points under gravities `downs` (D, 3); `done` is called after each. `learnt`: as
    for `sample_at`."""
    points = np.empty((len(downs), around, along, 3), np.float16)
    for index, down in enumerate(downs):
        points[index] = workspace_surface_at(chain, STANDARD_GRAVITY * down, around, along, learnt)
        done()
    return WorkspaceSurfaces(downs, points, tolerance)
