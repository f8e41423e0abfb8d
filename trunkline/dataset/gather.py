"""The whole data set: samples at all gravity angles, which of them validate, and the check against MuJoCo."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import mujoco
import numpy as np
import pandas as pd
from pydantic import Field

from trunkline.dataset.deviation import mujoco_deviation
from trunkline.dataset.table import Density, sample_table, split
from trunkline.settings import Seed
from trunkline.statics.chain import Chain


@dataclass
class Sampling:
    """See conf/fk_dataset/config.yaml.

    samples: in all, about. directions, steps: of the candidates at each angle, see `sampling.sample_angle`.
    check: samples that are compared with MuJoCo.
    """

    samples: Annotated[int, Field(ge=1000, le=10_000_000)]
    angles_deg: Annotated[list[Annotated[float, Field(ge=0, le=180)]], Field(min_length=2)]
    seed: Seed
    directions: Annotated[int, Field(ge=8, le=10000)]
    steps: Annotated[int, Field(ge=8, le=10000)]
    validate_share: Annotated[float, Field(gt=0, lt=1)]
    check: Annotated[int, Field(ge=1, le=100000)]

    def __post_init__(self) -> None:
        if any(after <= before for before, after in pairwise(self.angles_deg)):
            raise ValueError(f"angles_deg: found {self.angles_deg}, expected rising angles from 0 to 180")


@dataclass
class Gathered:
    """The table of samples with its column "split"; how dense tips are at each angle; the check, a row a sample."""

    table: pd.DataFrame
    densities: list[Density]
    deviation: pd.DataFrame


def gather(model: mujoco.MjModel, chain: Chain, sampling: Sampling, done: Callable[..., None]) -> Gathered:
    """Samples of equilibria of a model and its `chain`.

    Args:
        done: hears of each gravity angle how many samples there are by then, and how many it dropped.

    Raises:
        InputError: if too few samples are left for the check.
    """
    rng = np.random.default_rng(sampling.seed)
    angles = np.radians(sorted(sampling.angles_deg))
    tables, densities = [], []
    for angle in angles:
        count = sampling.samples // len(angles)
        table, density = sample_table(chain, angle, count, sampling.directions, sampling.steps, rng)
        tables.append(table)
        densities.append(density)
        done(kept=sum(map(len, tables)), dropped=density.failed + density.snapped)
    table = pd.concat(tables, ignore_index=True)
    table["split"] = split(len(table), sampling.validate_share, rng)
    print(f"fk_dataset: settling {sampling.check} samples in MuJoCo", flush=True)
    return Gathered(table, densities, mujoco_deviation(model, chain, table, sampling.check, rng))
