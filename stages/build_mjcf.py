"""Build the initial arm from geometry and material alone."""

import re
from pathlib import Path
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from trunkline.arm.geometry import ChainGeometry
from trunkline.arm.material import UnitProperties, unit_properties
from trunkline.arm.mjcf import Solver, Tendons, build_spec, unit_name
from trunkline.arm.spiral import spiral_chain
from trunkline.arm.uniform import uniform_chain, uniform_properties
from trunkline.figures.arm import arm_figure
from trunkline.figures.style import save_figure
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.settings import settings

ARTIFACTS = Path("artifacts/build_mjcf")


@settings
class Arm:
    length: PositiveFloat
    units: PositiveInt
    damping_ratio: PositiveFloat
    tendons: int = Field(ge=0, le=12)
    hole_ratio: float = Field(gt=0, le=1)
    tip_load: NonNegativeFloat
    segments: dict[str, PositiveFloat]

    def __post_init__(self):
        for name, distance in self.segments.items():
            if name == "base" or re.fullmatch(r"unit_\d+", name):
                raise ValueError(f"segments.{name}: found the name of a body, expected another: the mount is `base`, "
                                 f"and the {self.units} units' centres have names, {unit_name(0)} to "
                                 f"{unit_name(self.units - 1)}, without an entry")
            if distance > self.length:
                raise ValueError(f"segments.{name}: found {distance} m, expected at most the length of "
                                 f"{self.length} m")


@settings
class Spiral(Arm):
    kind: Literal["spiral"]
    base_width: PositiveFloat
    tip_width: PositiveFloat
    modulus: PositiveFloat
    density: PositiveFloat
    core_ratio: float = Field(gt=0, lt=1)


@settings
class Uniform(Arm):
    kind: Literal["uniform"]
    width: PositiveFloat
    unit_masses: list[PositiveFloat]
    bending_stiffness: PositiveFloat | None = None
    joint_stiffness: PositiveFloat | None = None
    joint_range_deg: float = Field(gt=0, le=180)

    def __post_init__(self):
        super().__post_init__()
        if (self.bending_stiffness is None) == (self.joint_stiffness is None):
            found = "neither" if self.joint_stiffness is None else "both"
            raise ValueError(f"found {found}, expected either bending_stiffness (EI) or joint_stiffness (K)")
        if len(self.unit_masses) not in (1, self.units):
            raise ValueError(f"unit_masses: found {len(self.unit_masses)}, expected one for all units, or "
                             f"one for each of the {self.units}")


@settings
class Actuation:
    friction: float = Field(ge=0)
    kp: PositiveFloat
    max_force: PositiveFloat
    time_constant: PositiveFloat


@settings
class SolverSettings:
    timestep: float = Field(gt=0, le=0.01)
    armature: float = Field(ge=0)
    limit_solref: tuple[float, float]
    limit_solimp: tuple[float, float, float, float, float]
    friction_solref: tuple[float, float]
    friction_solimp: tuple[float, float, float, float, float]


@settings
class Config:
    arm: Annotated[Spiral | Uniform, Field(discriminator="kind")]
    actuation: Actuation
    solver: SolverSettings


def spiral(arm: Spiral) -> tuple[ChainGeometry, UnitProperties]:
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units)
    return chain, unit_properties(chain, arm.modulus, arm.density, arm.core_ratio, arm.damping_ratio)


def uniform(arm: Uniform) -> tuple[ChainGeometry, UnitProperties]:
    chain = uniform_chain(arm.length, arm.width, arm.units, np.radians(arm.joint_range_deg))
    stiffness = arm.joint_stiffness or arm.bending_stiffness / chain.lengths[0]
    return chain, uniform_properties(chain, arm.unit_masses, stiffness, arm.damping_ratio)


def initial_spec(config: Config) -> tuple[mujoco.MjSpec, ChainGeometry, UnitProperties]:
    """The arm from geometry and material alone, and what it is made of."""
    arm, actuation = config.arm, config.actuation
    chain, properties = spiral(arm) if isinstance(arm, Spiral) else uniform(arm)
    mass = float(properties.masses.sum()) + arm.tip_load
    tendons = Tendons(
        count=arm.tendons,
        radius_ratio=arm.hole_ratio,
        friction=actuation.friction,
        kp=actuation.kp,
        kv=2 * np.sqrt(actuation.kp * mass),  # critical damping, paper section on control parameters
        max_force=actuation.max_force,
        time_constant=actuation.time_constant,
    )
    solver = Solver(**vars(config.solver))
    return build_spec(chain, properties, tendons, solver, arm.tip_load, arm.segments), chain, properties


def main(config: Config) -> None:
    spec, chain, properties = initial_spec(config)
    model = spec.compile()
    with output_folder(ARTIFACTS) as folder:
        (folder / "arm.xml").write_text(spec.to_xml())
        save_figure(arm_figure(model), folder / "arm.png")
        write_json(
            folder / "metrics.json",
            {
                "length_m": chain.length,
                "mass_kg": float(properties.masses.sum()) + config.arm.tip_load,
                "units": chain.units,
                "ratio": chain.ratio,
                "joint_range_deg": np.degrees(chain.joint_range[0]),
                "stiffness_base": properties.stiffness[0],
                "damping_base": properties.damping[0],
            },
        )


if __name__ == "__main__":
    run_stage("build_mjcf", Config, main)
