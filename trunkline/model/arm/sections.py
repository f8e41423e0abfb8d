"""A chain of sections, each of equal units of its own: a robot of several segments, straight where nothing pulls."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from trunkline.model.arm.cad import ChainArm
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import UnitProperties
from trunkline.model.arm.uniform import slender_properties


@dataclass
class Section:
    """length: m. units: how many it is cut into. width: m. mass: kg, of all of it.

    Either bending_stiffness, EI in N m², or joint_stiffness, K of each of its joints in N m/rad. axial_stiffness: EA in
    N, of a soft body that tendons shorten; None for one that keeps its length.
    """

    length: Annotated[float, Field(ge=0.001, le=10)]
    units: Annotated[int, Field(ge=1, le=500)]
    width: Annotated[float, Field(gt=0, le=2)]
    mass: Annotated[float, Field(gt=0, le=100)]
    bending_stiffness: Annotated[float, Field(gt=0, le=1e5)] | None = None
    joint_stiffness: Annotated[float, Field(gt=0, le=1e5)] | None = None
    axial_stiffness: Annotated[float, Field(gt=0, le=1e9)] | None = None

    def __post_init__(self):
        if (self.bending_stiffness is None) == (self.joint_stiffness is None):
            which = "neither" if self.joint_stiffness is None else "both"
            raise ValueError(f"found {which}, expected either bending_stiffness (EI) or joint_stiffness (K)")

    @property
    def stiffness(self) -> float:
        """K of each of its joints, N m/rad."""
        if self.joint_stiffness is not None:
            return self.joint_stiffness
        assert self.bending_stiffness is not None
        return self.bending_stiffness * self.units / self.length


@dataclass
class Sections(ChainArm):
    """sections: from the mount on. joint_range_deg: how far a joint bends."""

    kind: Literal["sections"]
    sections: Annotated[list[Section], Field(min_length=1, max_length=50)]
    joint_range_deg: Annotated[float, Field(gt=0, le=180)]
    length: Annotated[float, Field(ge=0.01, le=10)] = field(init=False, default=0.0)  # of all sections together
    units: Annotated[int, Field(ge=1, le=500)] = field(init=False, default=0)

    def __post_init__(self):
        self.length = sum(section.length for section in self.sections)
        self.units = sum(section.units for section in self.sections)
        super().__post_init__()
        soft = [section.axial_stiffness is not None for section in self.sections]
        if any(soft) and not all(soft):
            lacking = f"sections.{soft.index(False)}.axial_stiffness"
            raise ValueError(f"{lacking}: missing, expected it of all sections or of none")

    def _each(self, values: list[float]) -> np.ndarray:
        """A number of every section for each of its units. Shape (n,)."""
        return np.repeat(values, [section.units for section in self.sections])

    def chain(self) -> ChainGeometry:
        return ChainGeometry(
            lengths=self._each([section.length / section.units for section in self.sections]),
            widths=self._each([section.width for section in self.sections]),
            joint_range=np.full(self.units, np.radians(self.joint_range_deg)),
            ratio=1.0,
            sections=tuple(section.units for section in self.sections),
        )

    def properties(self, chain: ChainGeometry) -> UnitProperties:
        masses = self._each([section.mass / section.units for section in self.sections])
        stiffness = self._each([section.stiffness for section in self.sections])
        properties = slender_properties(chain, masses, stiffness, self.damping_ratio)
        axial = [section.axial_stiffness for section in self.sections if section.axial_stiffness is not None]
        return replace(properties, axial_stiffness=self._each(axial)) if axial else properties
