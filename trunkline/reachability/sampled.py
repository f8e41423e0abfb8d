"""The soft arm's tips as the data set of forward kinematics has them."""

from pathlib import Path

import numpy as np

from trunkline.dataset.columns import length_columns
from trunkline.dataset.samples import from_any_side, read_samples
from trunkline.errors import InputError
from trunkline.reachability.soft import SoftSettings
from trunkline.reachability.tips import ArmTips, Tips
from trunkline.statics.chain import Chain


def read_tips(path: Path, chain: Chain, soft: SoftSettings, seed: int) -> ArmTips:
    """Tips and lengths by gravity angle, from the samples at `path`; of samples under gravity from any side, fresh ones
    at the angles `soft.shown_deg` of a tilt, as far as the samples go.

    Raises:
        InputError: as `read_samples` does, or if no sample hangs straight down.
    """
    table = read_samples(path, chain.tendons)
    if from_any_side(table):
        largest = float(table["theta_g"].max())
        angles = np.radians(soft.shown_deg)
        angles = angles[angles <= largest + 1e-6]
        found = ArmTips(chain, angles, [], soft.directions, soft.steps, seed, largest)
        found.samples = [found.fresh(angle) for angle in angles]
        return found
    if table["theta_g"].abs().min() > 1e-6:
        raise InputError(f"{path}: found no gravity angle of 0, expected one: the hybrid map hangs straight down")
    groups = [group for _, group in table.groupby(table["theta_g"].round(9))]
    lengths = length_columns(chain.tendons)
    return ArmTips(
        chain=chain,
        angles=np.array([group["theta_g"].iloc[0] for group in groups]),
        samples=[Tips(group[["x", "y", "z"]].to_numpy(float), group[lengths].to_numpy(float)) for group in groups],
        directions=soft.directions,
        steps=soft.steps,
        seed=seed,
    )
