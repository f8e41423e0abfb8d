"""Settings that the three identification stages share, and what they make of them."""

from typing import Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from trunkline.config import settings

ParameterName = Literal[
    "stiffness", "damping", "tendon_friction", "joint_friction", "hardening", "kp", "kv", "force_range", "time_constant"
]


@settings
class Range:
    low: PositiveFloat
    high: PositiveFloat

    def __post_init__(self):
        if self.low >= self.high:
            raise ValueError(f"low: found {self.low}, expected less than high, {self.high}")


@settings
class Loss:
    kind: Literal["distances", "positions"]
    delta_position: PositiveFloat
    delta_velocity: PositiveFloat
    epsilon: PositiveFloat
    epsilon_velocity: PositiveFloat
    weight_position: NonNegativeFloat
    weight_velocity: NonNegativeFloat


@settings
class CoarseSettings:
    population: int = Field(ge=5)
    generations: PositiveInt
    tolerance: PositiveFloat
    step_factor: float = Field(ge=1, le=4)
    frames: PositiveInt
    polish_iterations: NonNegativeInt


@settings
class FineSettings:
    method: Literal["least_squares", "differential_evolution", "none"]
    range: float = Field(gt=0, lt=1)
    population: int = Field(ge=5)
    generations: PositiveInt
    iterations: PositiveInt
    tolerance: PositiveFloat


@settings
class IdentificationSettings:
    seed: NonNegativeInt
    frames: PositiveInt
    experiments: list[Literal["static_tilt", "release", "curl"]] = Field(min_length=1)
    reported: list[Literal["static_tilt", "release", "curl"]] = Field(min_length=1)
    loss: Loss
    parameters: dict[ParameterName, Range] = Field(min_length=1)
    per_joint: list[Literal["stiffness", "damping"]]
    coarse: CoarseSettings
    fine: FineSettings

    def __post_init__(self):
        if not set(self.experiments) <= set(self.reported):
            raise ValueError(f"reported: found {self.reported}, expected at least {self.experiments}")
        missing = set(self.per_joint) - set(self.parameters)
        if missing:
            raise ValueError(f"per_joint: found {sorted(missing)[0]!r}, expected one of {sorted(self.parameters)}")
