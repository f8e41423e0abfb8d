"""Which plant the lab has on its bench: the settings that say so, and the one place that builds it."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from demo.plants.bench import Plant
from demo.plants.cousin import Cousin, CousinSettings
from demo.plants.stranger import Stranger, StrangerSettings
from trunkline.model.arm.spiral import spiral_chain
from trunkline.settings import Seed, settings

PlantSettings = Annotated[CousinSettings | StrangerSettings, Field(discriminator="kind")]


@dataclass
class ArmChoice:
    """The drawing. length, base_width, tip_width: m. tracked: numbers from 1 of the units that carry markers."""

    length: Annotated[float, Field(ge=0.01, le=10)]
    base_width: Annotated[float, Field(gt=0, le=2)]
    tip_width: Annotated[float, Field(gt=0, le=2)]
    units: Annotated[int, Field(ge=1, le=500)]
    tendons: Annotated[int, Field(ge=3, le=12)]  # fewer cannot bend the arm to every side
    tracked: Annotated[list[Annotated[int, Field(ge=1, le=500)]], Field(min_length=1)]


@settings
class Choice:
    """What of the lab's settings decides which plant it has; `seed` draws its scatter."""

    seed: Seed
    arm: ArmChoice
    plant: PlantSettings

    def __post_init__(self):
        arm = self.arm
        expect(arm.tip_width < arm.base_width, "arm.tip_width", arm.tip_width, f"less than {arm.base_width}")
        tracked = max(arm.tracked) <= arm.units and distinct(arm.tracked)
        expect(tracked, "arm.tracked", arm.tracked, f"distinct units from 1 to {arm.units}")


def plant_of(choice: Choice) -> Plant:
    """The plant that is made from this drawing: the same one for whoever asks."""
    arm, rng = choice.arm, np.random.default_rng(choice.seed).spawn(1)[0]
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units)
    kind = Cousin if isinstance(choice.plant, CousinSettings) else Stranger
    return kind(chain, choice.plant, arm.tendons, rng)


def expect(holds: bool, key: str, value, expected: str) -> None:
    """Refuse a setting that breaks a rule between fields, naming its key."""
    if not holds:
        raise ValueError(f"{key}: found {value}, expected {expected}")


def distinct(values: list) -> bool:
    return len(set(values)) == len(values)
