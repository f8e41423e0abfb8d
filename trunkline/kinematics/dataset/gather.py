"""The whole data set: samples under all gravities, which of them validate, and the check against MuJoCo."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
import pandas as pd
from pydantic import Field

from trunkline.errors import InputError
from trunkline.kinematics.dataset.deviation import mujoco_deviation
from trunkline.kinematics.dataset.gravities import Gravities
from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.dataset.table import Density, sample_table, split
from trunkline.model.statics.chain import Chain
from trunkline.settings import Seed


@dataclass
class Sampling:
    """See conf/fk_dataset/config.yaml.

    samples: in all, about. gravity: from where it pulls. stroke: m, how far motors draw in at most, for an arm of
    several sections; None for as far as their force goes. check: samples that are compared with MuJoCo.
    """

    samples: Annotated[int, Field(ge=1000, le=10_000_000)]
    gravity: Gravities
    stroke: Annotated[float, Field(gt=0, le=1)] | None
    seed: Seed
    validate_share: Annotated[float, Field(gt=0, lt=1)]
    check: Annotated[int, Field(ge=1, le=100000)]


@dataclass
class GatheredSamples:
    """The table of samples with its column "split"; how dense tips are under each gravity; the check, a row a
    sample."""

    table: pd.DataFrame
    densities: list[Density]
    deviation: pd.DataFrame


def gather(model: mujoco.MjModel, chain: Chain, sampling: Sampling, done: Callable[..., None]) -> GatheredSamples:
    """Samples of equilibria of a model and its `chain`.

    Args:
        done: hears of each gravity how many samples there are by then, and how many it dropped.

    Raises:
        InputError: if too few samples are left for the check, or an arm of one section has a stroke.
    """
    if sampling.stroke is not None and len(sections(chain)) == 1:
        raise InputError(f"fk_dataset.stroke: found {sampling.stroke:g}, expected null for an arm of one section")
    if sampling.stroke is not None and chain.by_force:
        expected = "expected null where motors are commanded by force: their `max_force` is how far they pull"
        raise InputError(f"fk_dataset.stroke: found {sampling.stroke:g} m, {expected}")
    deepest = None if sampling.stroke is None else np.full(chain.tendons, sampling.stroke)
    rng = np.random.default_rng(sampling.seed)
    gravity, downs = sampling.gravity, sampling.gravity.downs
    tables, densities = [], []
    for down in downs:
        count = sampling.samples // len(downs)
        table, density = sample_table(chain, down, count, gravity.directions, gravity.steps, rng, deepest)
        tables.append(table)
        densities.append(density)
        done(kept=sum(map(len, tables)), dropped=density.failed + density.snapped)
    table = pd.concat(tables, ignore_index=True)
    table["split"] = split(len(table), sampling.validate_share, rng)
    print(f"fk_dataset: settling {sampling.check} samples in MuJoCo", flush=True)
    return GatheredSamples(table, densities, mujoco_deviation(model, chain, table, sampling.check, rng))
