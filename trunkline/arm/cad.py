"""The arm before anything is measured: what every kind of it makes, and the settings that chains of units share."""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.arm.geometry import ChainGeometry
from trunkline.arm.material import UnitProperties
from trunkline.arm.mjcf import Actuation, Solver, Tendons, build_spec, unit_name


@dataclass
class CadArm:
    """The model to begin with, and what it is made of in a few numbers, for metrics.json."""

    spec: mujoco.MjSpec
    metrics: dict[str, float]


@dataclass
class Chain(ABC):
    """An arm that is made of units. A kind of it is a dataclass in a file of this folder, see `kinds`.

    Attributes:
        length: m. units: how many it is cut into.
        damping_ratio: ζ.
        tendons: how many. hole_ratio: distance of their holes from the axis over the unit's outer radius.
        tip_load: kg that hangs at the tip.
        segments: name of a tracked point to its distance from the mount along the straight arm, m.
        joint_place: where a unit bends, as a share of its length: 0 at its upper end, as in the paper's chain.
    """

    length: Annotated[float, Field(ge=0.01, le=10)]
    units: Annotated[int, Field(ge=1, le=500)]
    damping_ratio: Annotated[float, Field(gt=0, le=100)]
    tendons: Annotated[int, Field(ge=0, le=12)]
    hole_ratio: Annotated[float, Field(gt=0, le=1)]
    tip_load: Annotated[float, Field(ge=0, le=100)]
    segments: dict[str, Annotated[float, Field(gt=0, le=10)]]
    joint_place: Annotated[float, Field(ge=0, le=1)] = field(default=0.0, kw_only=True)

    def __post_init__(self):
        for name, distance in self.segments.items():
            if name == "base" or re.fullmatch(r"unit_\d+", name):
                raise ValueError(f"segments.{name}: found the name of a body, expected another: the mount is `base`, "
                                 f"and the {self.units} units' centres have names, {unit_name(0)} to "
                                 f"{unit_name(self.units - 1)}, without an entry")
            if distance > self.length:
                raise ValueError(f"segments.{name}: found {distance} m, expected at most the length of "
                                 f"{self.length} m")

    @abstractmethod
    def chain(self) -> ChainGeometry:
        """The units' shape."""

    @abstractmethod
    def properties(self, chain: ChainGeometry) -> UnitProperties:
        """The units' masses, stiffness and damping."""

    def build(self, actuation: Actuation, solver: Solver, models: Path) -> CadArm:
        """The arm from geometry and material alone. `models`, the folder of MJCF files, is idle."""
        chain = self.chain()
        properties = self.properties(chain)
        mass = float(properties.masses.sum()) + self.tip_load
        tendons = Tendons(
            **vars(actuation),
            count=self.tendons,
            radius_ratio=self.hole_ratio,
            kv=2 * np.sqrt(actuation.kp * mass),  # critical damping, paper section on control parameters
        )
        metrics = {
            "length_m": chain.length,
            "mass_kg": mass,
            "units": chain.units,
            "ratio": chain.ratio,
            "joint_range_deg": np.degrees(chain.joint_range[0]),
            "stiffness_base": properties.stiffness[0],
            "damping_base": properties.damping[0],
        }
        spec = build_spec(chain, properties, tendons, solver, self.tip_load, self.segments, self.joint_place)
        return CadArm(spec, metrics)
