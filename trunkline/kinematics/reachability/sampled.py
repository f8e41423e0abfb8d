"""The soft arm's tips as the data set of forward kinematics has them."""

from pathlib import Path

import numpy as np
import pandas as pd

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.dataset.columns import DOWN, command_columns, length_columns, tension_columns
from trunkline.kinematics.dataset.samples import from_any_side, read_samples, weightless
from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.reachability.soft import SoftSettings
from trunkline.kinematics.reachability.tips import ArmTips, Tips, held_by
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.statics.chain import Chain


def read_tips(
    path: Path, chain: Chain, soft: SoftSettings, seed: int, learnt: ResidualMap | None = None
) -> ArmTips:
    """Tips and lengths by gravity angle, from the samples at `path`; of samples under gravity from any side, fresh ones
    at the angles `soft.shown_deg` of a tilt, as far as the samples go; of samples without gravity, those that train.
    With what is `learnt` of the arm, they are its tips and no longer the twin's, of which the samples are.

    Raises:
        InputError: as `read_samples` does, or if no sample hangs straight down, or gravity pulls from any side at an
            arm of several sections.
    """
    table = read_samples(path, chain.tendons, "split", *tension_columns(chain.tendons))
    lengths = length_columns(chain.tendons)

    def tips_of(rows: pd.DataFrame) -> Tips:
        tensions = rows[tension_columns(chain.tendons)].to_numpy(float)
        tendon_lengths = held_by(chain, rows[lengths].to_numpy(float), tensions)
        positions = rows[["x", "y", "z"]].to_numpy(float)
        if learnt is not None:
            commands = rows[command_columns(chain.tendons)].to_numpy(float)
            gravity = STANDARD_GRAVITY * rows[DOWN].to_numpy(float)
            positions = positions + learnt.mean(RestingPoses.of_commands(chain, commands, gravity))
        return Tips(positions, tendon_lengths)

    if weightless(table):
        trains = table["split"] == "train"
        samples, unseen = [tips_of(table[trains])], tips_of(table[~trains])
        return ArmTips(chain, np.zeros(1), samples, soft.directions, soft.steps, seed, unseen=unseen, learnt=learnt)
    if from_any_side(table):
        if len(sections(chain)) > 1:
            raise InputError(f"{path}: found gravity from any side, expected tilts or none: it has several sections")
        largest = float(table["theta_g"].max())
        angles = np.radians(soft.shown_deg)
        angles = angles[angles <= largest + 1e-6]
        source = ArmTips(chain, angles, [], soft.directions, soft.steps, seed, largest, learnt=learnt)
        source.samples = [source.fresh(angle) for angle in angles]
        return source
    if table["theta_g"].abs().min() > 1e-6:
        raise InputError(f"{path}: found no gravity angle of 0, expected one: the hybrid map hangs straight down")
    groups = [group for _, group in table.groupby(table["theta_g"].round(9))]
    shortest = table[command_columns(chain.tendons)].to_numpy().min(axis=0)
    return ArmTips(
        chain=chain,
        angles=np.array([group["theta_g"].iloc[0] for group in groups]),
        samples=[tips_of(group) for group in groups],
        directions=soft.directions,
        steps=soft.steps,
        seed=seed,
        deepest=None if chain.by_force else chain.straight_lengths - shortest,
        learnt=learnt,
    )
