"""The soft arm's map at a gravity angle: where its tip can be, to a tolerance.

An arm that only bends reaches a shell, not a solid: two parameters of three move the tip along the shell, the
third hardly. The map is the set of points within ``tolerance`` of a sampled tip, so that it has an inside.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from trunkline.reachability.grid import Lattice, blend, overlap, redistance, without_specks
from trunkline.reachability.tips import TipInterpolator, TipSamples
from trunkline.threads import thread_count


@dataclass(frozen=True)
class SoftShape:
    """How tips become a set.

    ``tolerance`` (m): how near a reachable tip a point must be. ``closing`` (m): radius up to which gaps in
    the set are filled. ``smoothing``: standard deviation of a Gaussian over the field, in lattice steps.
    ``smallest``: islands and cavities of fewer cells vanish.
    """

    tolerance: float
    closing: float
    smoothing: float
    smallest: int


def soft_lattice(samples: TipSamples, shape: SoftShape, spacing: float) -> Lattice:
    """One lattice for the maps of all angles."""
    tips = np.concatenate(samples.tips)
    return Lattice.around(tips.min(axis=0), tips.max(axis=0), spacing, shape.tolerance + shape.closing + 2 * spacing)


def soft_field(tips: NDArray, lattice: Lattice, shape: SoftShape) -> NDArray:
    """Signed distance field of the points near ``tips`` (N, 3), in m. Shape ``lattice.shape``."""
    points = np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1).reshape(-1, 3)
    # Closing: grow by tolerance + closing, then shrink by closing. Distances far outside are worked out after that.
    radius = shape.tolerance + shape.closing
    farthest = radius + 2 * lattice.spacing
    distance, _ = cKDTree(tips).query(points, distance_upper_bound=farthest, workers=thread_count())
    grown = np.minimum(distance, farthest).reshape(lattice.shape) - radius
    field = redistance(grown, lattice.spacing) + shape.closing
    return ndimage.gaussian_filter(without_specks(field, lattice.spacing, shape.smallest), shape.smoothing)


def soft_fields(
    samples: TipSamples, angles: NDArray, lattice: Lattice, shape: SoftShape, done: Callable[[float], None]
) -> NDArray:
    """Fields (len(angles), ...) at gravity ``angles`` (rad), sampled ones or between them; ``done`` hears of each."""
    interpolator = TipInterpolator(samples, shape.tolerance / 2)
    fields = np.empty((len(angles), *lattice.shape), np.float32)
    for field, angle in zip(fields, angles, strict=True):
        field[:] = soft_field(interpolator.tips(angle), lattice, shape)
        done(angle)
    return fields


def heldout_overlap(
    samples: TipSamples, index: int, own: NDArray, step: float, lattice: Lattice, shape: SoftShape
) -> float:
    """Overlap (IoU) of ``own``, the field at angle ``index``, with the blend that is made without its samples.

    The blend is the headset's: linear between two fields ``step`` (rad) apart, here at its worst, half-way.
    """
    angle = samples.angles[index]
    beside = angle + step * np.array([-0.5, 0.5])
    fields = soft_fields(samples.without(index), beside, lattice, shape, lambda _: None)
    return overlap(blend(fields, beside, angle), own)
