"""Check of the workspace surfaces, at directions of gravity without one, against equilibria there."""

from collections.abc import Callable

import numpy as np

from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.dataset.sampling import sample_at, workspace_surface_at
from trunkline.kinematics.reachability.reach_signal import THRESHOLD, HeldOut, points_beyond
from trunkline.kinematics.reachability.soft import SoftSettings, soft_field, soft_lattice
from trunkline.kinematics.reachability.tips import LOOK_EVERY
from trunkline.kinematics.reachability.workspace_surface import WorkspaceSurfaces, finer
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.kinematics.sdf.grid import overlap
from trunkline.model.statics.chain import Chain

DENSER = 4  # times, of surfaces whose sets are compared


def check_surfaces(
    surfaces: WorkspaceSurfaces,
    chain: Chain,
    soft: SoftSettings,
    *,
    beyond: float,
    count: int,
    seed: int,
    done: Callable[[str], None],
    learnt: ResidualMap | None = None,
) -> list[HeldOut]:
    """Surfaces at `soft.sheets.heldout` directions of gravity, at random, that no surface was made for.

    Compared are the sets within reach, as `soft.soft_field` makes them of points: of the surface in between, and of one
    that is found there. What the signal says is checked with tips that lie on no lattice.

    Args:
        beyond: m, how far from the surface found there are the points that shall be out of reach.
        count: how many of them, and of tips, to draw at each. seed: of the draws. learnt: as for `sample_at`.
    """
    rng = np.random.default_rng(seed)
    largest = np.arccos(np.clip(-surfaces.downs[:, 2].max(), -1, 1))
    angles, azimuths = rng.uniform(0, largest, soft.sheets.heldout), rng.uniform(0, 2 * np.pi, soft.sheets.heldout)
    around, along = surfaces.points.shape[1:3]
    results = []
    for angle, azimuth in zip(angles, azimuths, strict=True):
        down = downwards(angle, azimuth)
        gravity, surface = STANDARD_GRAVITY * down, surfaces.at(down)
        solved = workspace_surface_at(chain, gravity, around, along, learnt)
        between, sampled = (finer(each, DENSER) for each in (surface, solved))
        lattice = soft_lattice([between, sampled], soft, soft.voxel)
        iou = overlap(*(soft_field(points, lattice, soft) for points in (between, sampled)))
        tips = sample_at(chain, gravity, around, along, rng, LOOK_EVERY, learnt=learnt).equilibrium.position
        targets = tips[rng.permutation(len(tips))[:count]], points_beyond(sampled, beyond, count, rng)
        reachable, called = ((surfaces.signal(surface, points) <= THRESHOLD).mean() for points in targets)
        results.append(HeldOut(angle, iou, float(reachable), float(called), azimuth))
        done(f"held-out {np.degrees(angle):.0f}°, {np.degrees(azimuth):.0f}°")
    return results
