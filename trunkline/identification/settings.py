"""Settings that the three identification stages share, and what they make of them."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from trunkline.identification.parameters import PARAMETERS
from trunkline.settings import settings
from trunkline.trials.experiments import ExperimentName

ParameterName = Literal[
    "stiffness", "hardening", "joint_friction", "damping", "tendon_friction", "friction_time",
    "kp", "kv", "force_range", "time_constant", "mount_tilt_x", "mount_tilt_y", "mount_twist",
]  # fmt: skip


@settings
class Range:
    low: FiniteFloat
    high: FiniteFloat

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
class LeastSquaresSettings:
    method: Literal["least_squares"]
    starts: NonNegativeInt
    descents: PositiveInt
    iterations: PositiveInt
    tolerance: PositiveFloat


@settings
class DifferentialEvolutionSettings:
    method: Literal["differential_evolution"]
    population: int = Field(ge=5)
    population_per_parameter: NonNegativeInt
    generations: PositiveInt
    tolerance: PositiveFloat


Optimizer = Annotated[LeastSquaresSettings | DifferentialEvolutionSettings, Field(discriminator="method")]


@settings
class RoughSettings:
    step_factor: float = Field(ge=1, le=4)
    frames: PositiveInt
    trials: PositiveInt


@settings
class PolishSettings:
    iterations: PositiveInt
    tolerance: PositiveFloat


@settings
class IdentificationSettings:
    seed: NonNegativeInt
    frames: PositiveInt
    command_delay: float = Field(ge=0, le=1)
    experiments: list[ExperimentName] = Field(min_length=1)
    reported: list[ExperimentName] = Field(min_length=1)
    rest_shape: Literal["unchanged", "measured"]
    markers: Literal["unchanged", "measured"]
    loss: Loss
    parameters: dict[ParameterName, Range] = Field(min_length=1)
    optimizer: Optimizer
    rough: RoughSettings
    polish: PolishSettings
    per_joint: list[Literal["stiffness", "damping"]]
    per_joint_range: float = Field(gt=0, lt=1)
    per_joint_deviation: PositiveFloat
    fine: Optimizer
    cross_validation_folds: NonNegativeInt

    def __post_init__(self):
        if not set(self.experiments) <= set(self.reported):
            raise ValueError(f"reported: found {self.reported}, expected at least {self.experiments}")
        if self.cross_validation_folds == 1:
            raise ValueError("cross_validation_folds: found 1, expected 0 (none) or at least 2")
        for name, span in self.parameters.items():
            if span.low <= 0 and not PARAMETERS[name].signed:
                raise ValueError(f"parameters.{name}.low: found {span.low}, expected more than 0")
