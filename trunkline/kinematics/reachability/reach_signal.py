"""Out of reach or not: what a headset reads off the soft maps, and how often it is right between their angles.

The signal at a point x of the arm's base frame and a gravity angle θ is

    s(x, θ) = (1 - w) φ_i(x) + w φ_{i+1}(x),    w = (θ - θ_i) / (θ_{i+1} - θ_i),

φ the packed grids (16-bit floats, m, negative inside), trilinear between lattice points, θ_i and θ_{i+1} the two angles
beside θ. The tip reaches x, to the maps' tolerance, where s ≤ 0; elsewhere s is about how far x is outside.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from trunkline.compute.threads import thread_count
from trunkline.kinematics.reachability.soft import SoftShape, soft_field
from trunkline.kinematics.sdf.grid import Lattice, blend, overlap

THRESHOLD = 0.0  # m; a signal above it means out of reach
THICKNESS = 0.1  # of the distance of points outside: they are drawn from as much more


class HeldOut(NamedTuple):
    """At a gravity `angle` and `azimuth` (rad) that has no map: overlap `iou` of the blended map with the angle's own,
    share of its tips that the signal calls `reachable`, and share of points `beyond` reach that it calls so too."""

    angle: float
    iou: float
    reachable: float
    beyond: float
    azimuth: float = 0.0


def packed(fields: np.ndarray) -> np.ndarray:
    """Fields as the headset gets them."""
    return fields.astype(np.float16)


def reach_signal(
    fields: np.ndarray, angles: np.ndarray, lattice: Lattice, points: np.ndarray, angle: float
) -> np.ndarray:
    """s for `points` (N, 3), m; negative within reach. Shape (N,).

    Args:
        fields: `packed`, (B, ...), at `angles` (B,), rad, ascending.
        angle: gravity angle, rad.
    """
    return lattice.sample(blend(fields.astype(np.float32), angles, angle), points)


def held_out(
    fields: np.ndarray,
    angles: np.ndarray,
    lattice: Lattice,
    shape: SoftShape,
    tips: np.ndarray,
    angle: float,
    *,
    beyond: float,
    count: int,
    seed: int,
) -> HeldOut:
    """Check at `angle`, rad, against its own `tips` (N, 3).

    Args:
        fields, angles, lattice: as for `reach_signal`.
        beyond: m, how far from every tip are the points that shall be out of reach.
        count: how many of them to draw. seed: of the draw.
    """
    sampled = soft_field(tips, lattice, shape)
    iou = overlap(blend(fields.astype(np.float32), angles, angle), sampled)
    outside = points_beyond(tips, beyond, count, np.random.default_rng(seed))
    reachable, called = (
        (reach_signal(fields, angles, lattice, points, angle) <= THRESHOLD).mean() for points in (tips, outside)
    )
    return HeldOut(angle, iou, float(reachable), float(called))


def points_beyond(tips: np.ndarray, distance: float, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (at most `count`, 3) whose nearest tip is `distance` m away, or a little more."""
    around = tips[rng.integers(0, len(tips), 40 * count)]
    directions = rng.normal(size=around.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = around + (1 + THICKNESS) * distance * directions
    nearest, _ = cKDTree(tips).query(points, workers=thread_count())
    return points[(nearest >= distance) & (nearest <= (1 + THICKNESS) * distance)][:count]
