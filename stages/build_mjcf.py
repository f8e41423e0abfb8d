"""Build the initial arm from geometry and material alone."""

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from trunkline.arm.material import unit_properties
from trunkline.arm.mjcf import Solver, Tendons, build_spec
from trunkline.arm.plots import arm_figure
from trunkline.arm.spiral import spiral_chain
from trunkline.config import settings
from trunkline.plots import save_figure
from trunkline.stage import output_folder, run_stage, write_json

ARTIFACTS = Path("artifacts/build_mjcf")


@settings
class Spiral:
    kind: Literal["spiral"]
    length: PositiveFloat
    base_width: PositiveFloat
    tip_width: PositiveFloat
    units: PositiveInt
    core_ratio: float = Field(gt=0, lt=1)
    tendons: int = Field(ge=0, le=12)
    hole_ratio: float = Field(gt=0, le=1)


@settings
class Material:
    modulus: PositiveFloat
    density: PositiveFloat
    damping_ratio: PositiveFloat


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
    arm: Spiral
    material: Material
    actuation: Actuation
    solver: SolverSettings


def main(config: Config) -> None:
    arm, material, actuation = config.arm, config.material, config.actuation
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units)
    properties = unit_properties(chain, material.modulus, material.density, arm.core_ratio, material.damping_ratio)
    mass = float(properties.masses.sum())
    tendons = Tendons(
        count=arm.tendons,
        radius_ratio=arm.hole_ratio,
        friction=actuation.friction,
        kp=actuation.kp,
        kv=2 * np.sqrt(actuation.kp * mass),  # critical damping, paper section on control parameters
        max_force=actuation.max_force,
        time_constant=actuation.time_constant,
    )
    spec = build_spec(chain, properties, tendons, Solver(**vars(config.solver)))
    model = spec.compile()
    with output_folder(ARTIFACTS) as folder:
        (folder / "arm.xml").write_text(spec.to_xml())
        save_figure(arm_figure(model), folder / "arm.png")
        write_json(
            folder / "metrics.json",
            {
                "length_m": chain.length,
                "mass_kg": mass,
                "units": chain.units,
                "ratio": chain.ratio,
                "joint_range_deg": np.degrees(chain.joint_range[0]),
                "stiffness_base": properties.stiffness[0],
                "damping_base": properties.damping[0],
            },
        )


if __name__ == "__main__":
    run_stage("build_mjcf", Config, main)
