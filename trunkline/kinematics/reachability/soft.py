"""The soft arm's map at a gravity angle: where its tip can be, to a tolerance.

An arm that only bends reaches a shell, not a solid: two parameters of three move the tip along the shell, the
third hardly. The map is the set of points within `tolerance` of a sampled tip, so that it has an inside.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy import ndimage
from scipy.spatial import cKDTree

from trunkline.compute.threads import thread_count
from trunkline.kinematics.reachability.tips import TipSource
from trunkline.kinematics.sdf.grid import Lattice, redistance, without_specks


@dataclass(frozen=True)
class SoftShape:
    """How tips become a set.

    `tolerance` (m): how near a reachable tip a point must be. `closing` (m): radius up to which gaps in
    the set are filled. `smoothing`: standard deviation of a Gaussian over the field, in lattice steps.
    `smallest`: islands and cavities of fewer cells vanish.
    """

    tolerance: Annotated[float, Field(gt=0, le=0.2)]
    closing: Annotated[float, Field(gt=0, le=0.2)]
    smoothing: Annotated[float, Field(ge=0, le=5)]
    smallest: Annotated[int, Field(ge=1, le=1_000_000)]


@dataclass(frozen=True)
class SurfaceSettings:
    """See conf/reachability/config.yaml; of `workspace_surface.WorkspaceSurfaces`."""

    directions: Annotated[int, Field(ge=8, le=10_000)]
    around: Annotated[int, Field(ge=8, le=1000)]
    along: Annotated[int, Field(ge=4, le=1000)]
    heldout: Annotated[int, Field(ge=1, le=10_000)]


@dataclass(frozen=True)
class SoftSettings(SoftShape):
    """The shape, and for what: see conf/reachability/config.yaml; voxel in m."""

    voxel: Annotated[float, Field(ge=0.003, le=0.1)]
    angle_step_deg: Annotated[float, Field(ge=0.5, le=180)]
    directions: Annotated[int, Field(ge=8, le=10000)]
    steps: Annotated[int, Field(ge=8, le=10000)]
    shown_deg: Annotated[list[Annotated[float, Field(ge=0, le=180)]], Field(min_length=2)]
    sheets: SurfaceSettings

    def __post_init__(self) -> None:
        if self.shown_deg[0] != 0 or any(after <= before for before, after in pairwise(self.shown_deg)):
            raise ValueError(f"shown_deg: found {self.shown_deg}, expected rising angles from 0")

    @property
    def angle_step(self) -> float:
        """Between the fields, at most, rad."""
        return np.radians(self.angle_step_deg)


def soft_lattice(tips: list[np.ndarray], shape: SoftShape, spacing: float) -> Lattice:
    """One lattice for the maps of all angles, from the tips (N, 3) at each."""
    every = np.concatenate(tips)
    margin = shape.tolerance + shape.closing + 2 * spacing
    return Lattice.around(every.min(axis=0), every.max(axis=0), spacing, margin)


def soft_field(tips: np.ndarray, lattice: Lattice, shape: SoftShape) -> np.ndarray:
    """Signed distance field of the points near `tips` (N, 3), in m. Shape `lattice.shape`."""
    points = np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1).reshape(-1, 3)
    # Closing: grow by tolerance + closing, then shrink by closing. Distances far outside are worked out after that.
    radius = shape.tolerance + shape.closing
    farthest = radius + 2 * lattice.spacing
    distance, _ = cKDTree(tips).query(points, distance_upper_bound=farthest, workers=thread_count())
    grown = np.minimum(distance, farthest).reshape(lattice.shape) - radius
    field = redistance(grown, lattice.spacing) + shape.closing
    return ndimage.gaussian_filter(without_specks(field, lattice.spacing, shape.smallest), shape.smoothing)


def soft_fields(
    tips_at: TipSource, angles: np.ndarray, shape: SoftShape, spacing: float, done: Callable[[float], None]
) -> tuple[np.ndarray, Lattice]:
    """Fields (len(angles), ...) at gravity `angles` (rad) and the lattice they share; `done` hears of each."""
    tips = [tips_at(angle).positions for angle in angles]
    lattice = soft_lattice(tips, shape, spacing)
    fields = np.empty((len(angles), *lattice.shape), np.float32)
    for field, here, angle in zip(fields, tips, angles, strict=True):
        field[:] = soft_field(here, lattice, shape)
        done(angle)
    return fields, lattice
