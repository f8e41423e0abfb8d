"""How good the sheets are: at directions of gravity that have none, against equilibria that are found there."""

from collections.abc import Callable

import numpy as np

from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.dataset.sampling import sample_at, sheet_at
from trunkline.kinematics.reachability.reach_signal import THRESHOLD, HeldOut, points_beyond
from trunkline.kinematics.reachability.soft import SoftSettings, soft_field, soft_lattice
from trunkline.kinematics.reachability.tips import LOOK_EVERY
from trunkline.kinematics.reachability.workspace_surface import Sheets, finer
from trunkline.kinematics.sdf.grid import overlap
from trunkline.model.statics.chain import Chain

DENSER = 4  # times, of sheets whose sets are compared


def check_sheets(
    sheets: Sheets,
    chain: Chain,
    soft: SoftSettings,
    *,
    beyond: float,
    count: int,
    seed: int,
    done: Callable[[str], None],
) -> list[HeldOut]:
    """Sheets at `soft.sheets.heldout` directions of gravity, at random, that no sheet was made for.

    Compared are the sets within reach, as `soft.soft_field` makes them of points: of the sheet in between, and of one
    that is found there. What the signal says is checked with tips that lie on no lattice.

    Args:
        beyond: m, how far from the surface found there are the points that shall be out of reach.
        count: how many of them, and of tips, to draw at each. seed: of the draws.
    """
    rng = np.random.default_rng(seed)
    largest = np.arccos(np.clip(-sheets.downs[:, 2].max(), -1, 1))
    angles, azimuths = rng.uniform(0, largest, soft.sheets.heldout), rng.uniform(0, 2 * np.pi, soft.sheets.heldout)
    around, along = sheets.points.shape[1:3]
    results = []
    for angle, azimuth in zip(angles, azimuths, strict=True):
        down = downwards(angle, azimuth)
        gravity, sheet = STANDARD_GRAVITY * down, sheets.at(down)
        between, own = (finer(one, DENSER) for one in (sheet, sheet_at(chain, gravity, around, along)))
        lattice = soft_lattice([between, own], soft, soft.voxel)
        iou = overlap(*(soft_field(points, lattice, soft) for points in (between, own)))
        tips = sample_at(chain, gravity, around, along, rng, LOOK_EVERY).equilibrium.position
        asked = tips[rng.permutation(len(tips))[:count]], points_beyond(own, beyond, count, rng)
        reachable, called = ((sheets.signal(sheet, points) <= THRESHOLD).mean() for points in asked)
        results.append(HeldOut(angle, iou, float(reachable), float(called), azimuth))
        done(f"held-out {np.degrees(angle):.0f}°, {np.degrees(azimuth):.0f}°")
    return results
