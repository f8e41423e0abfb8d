"""The arm before anything is measured: what every kind of it makes, and the settings that chains of units share."""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import UnitProperties
from trunkline.model.arm.mjcf import Actuation, Marker, Solver, Tendons, build_spec, unit_name
from trunkline.model.arm.tendons import MOST, Route, Tendon, described_routes, even_routes


@dataclass
class CadArm:
    """The model to begin with, and what it is made of in a few numbers, for metrics.json."""

    spec: mujoco.MjSpec
    metrics: dict[str, float]


@dataclass
class ChainArm(ABC):
    """An arm that is made of units. A kind of it is a dataclass in a file of this folder, see `kinds`.

    Attributes:
        length: m. units: how many it is cut into.
        damping_ratio: ζ.
        tendons: how many, evenly spread, or one description each. hole_ratio: distance of their holes from the axis
            over the unit's outer radius, where none is described.
        tip_load: kg that hangs at the tip.
        markers: name of a marker to its distance from the mount along the straight arm, m, or to where it
            sits beside the arm.
        actuation: guesses of this arm's motors, in place of those in config.yaml.
        joint_place: where a unit bends, as a share of its length: 0 at its upper end, as in the paper's chain.
    """

    length: Annotated[float, Field(ge=0.01, le=10)]
    units: Annotated[int, Field(ge=1, le=500)]
    damping_ratio: Annotated[float, Field(gt=0, le=100)]
    tendons: Annotated[int, Field(ge=0, le=MOST)] | Annotated[list[Tendon], Field(max_length=MOST)]
    hole_ratio: Annotated[float, Field(gt=0, le=1)]
    tip_load: Annotated[float, Field(ge=0, le=100)]
    markers: dict[str, Annotated[float, Field(gt=0, le=10)] | Marker]
    joint_place: Annotated[float, Field(ge=0, le=1)] = field(default=0.0, kw_only=True)
    actuation: Actuation | None = field(default=None, kw_only=True)

    def __post_init__(self):
        for name, place in self.markers.items():
            if name == "base" or re.fullmatch(r"unit_\d+", name):
                raise ValueError(f"markers.{name}: found the name of a body, expected another: the mount is `base`, "
                                 f"and the {self.units} units' centres have names, {unit_name(0)} to "
                                 f"{unit_name(self.units - 1)}, without an entry")
            if not isinstance(place, Marker) and place > self.length:
                raise ValueError(f"markers.{name}: found {place} m, expected at most the length of {self.length} m, "
                                 f"or {{distance: {place}}} of a marker that sticks out")

        for number, tendon in enumerate([] if isinstance(self.tendons, int) else self.tendons):
            if tendon.end > self.units:
                raise ValueError(f"tendons.{number}.end: found {tendon.end}, expected one of the {self.units} units, "
                                 f"or 0 for the last")
            if tendon.start >= (tendon.end or self.units):
                expected = f"a unit before the one where it is anchored, {tendon.end or self.units}, or 0 for the mount"
                raise ValueError(f"tendons.{number}.start: found {tendon.start}, expected {expected}")

    @abstractmethod
    def chain(self) -> ChainGeometry:
        """The units' shape."""

    @abstractmethod
    def properties(self, chain: ChainGeometry) -> UnitProperties:
        """The units' masses, stiffness and damping."""

    def _routes(self, chain: ChainGeometry) -> list[Route]:
        if isinstance(self.tendons, int):
            return even_routes(chain, self.tendons, self.hole_ratio)
        return described_routes(chain, self.tendons, self.hole_ratio)

    def build(self, actuation: Actuation, solver: Solver, models: Path) -> CadArm:
        """The arm from geometry and material alone. `models`, the folder of MJCF files, is idle.

        Raises:
            InputError: beside `commands: force` a tendon has a pretension; without it, units get shorter.
        """
        actuation = self.actuation or actuation
        forced = actuation.commands == "force"
        for number, tendon in enumerate([] if isinstance(self.tendons, int) or not forced else self.tendons):
            if tendon.pretension:
                problem = f"found {tendon.pretension:g} N beside `commands: force`, expected none"
                raise InputError(f"build_mjcf.arm.tendons.{number}.pretension: {problem}: a command of 0 pulls nothing")
        chain = self.chain()
        properties = self.properties(chain)
        if properties.axial_stiffness is not None and not forced:
            problem = "found axial_stiffness beside motors that are commanded by length, expected `commands: force`"
            raise InputError(f"build_mjcf.arm.sections: {problem}: units get shorter by the tension that is sent")
        mass = float(properties.masses.sum()) + self.tip_load
        tendons = Tendons(
            **vars(actuation),
            routes=self._routes(chain),
            described=not isinstance(self.tendons, int),
            kv=2 * np.sqrt((actuation.kp or 0) * mass),  # critical damping, paper section on control parameters
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
        markers = {name: at if isinstance(at, Marker) else Marker(at) for name, at in self.markers.items()}
        spec = build_spec(chain, properties, tendons, solver, self.tip_load, markers, self.joint_place)
        return CadArm(spec, metrics)
