"""The arms that the lab can have on its bench, and the one place that builds them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from demo.bench import Plant
from demo.cousin import Cousin, CousinSettings
from demo.stranger import Stranger, StrangerSettings
from trunkline.arm.spiral import spiral_chain

PlantSettings = Annotated[CousinSettings | StrangerSettings, Field(discriminator="kind")]


@dataclass
class Arm:
    """The drawing. length, base_width, tip_width: m. tracked: numbers from 1 of the units that carry markers."""

    length: Annotated[float, Field(ge=0.01, le=10)]
    base_width: Annotated[float, Field(gt=0, le=2)]
    tip_width: Annotated[float, Field(gt=0, le=2)]
    units: Annotated[int, Field(ge=1, le=500)]
    tendons: Annotated[int, Field(ge=3, le=12)]  # fewer cannot bend the arm to every side
    tracked: Annotated[list[Annotated[int, Field(ge=1, le=500)]], Field(min_length=1)]


def build_plant(arm: Arm, settings: CousinSettings | StrangerSettings, rng: np.random.Generator) -> Plant:
    """The plant that is made from this drawing; `rng` draws its scatter."""
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units)
    kind = Cousin if isinstance(settings, CousinSettings) else Stranger
    return kind(chain, settings, arm.tendons, rng)
