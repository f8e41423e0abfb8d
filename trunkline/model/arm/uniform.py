"""A chain of equal units: a hose, a rod or a stack of discs, straight when cut, of one diameter."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from trunkline.model.arm.cad import ChainArm
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import UnitProperties, joint_damping


@dataclass
class Uniform(ChainArm):
    """width: m. unit_masses: kg, one for all units or one each. joint_range_deg: how far a joint bends.

    Either bending_stiffness, EI in N m², or joint_stiffness, K of every joint in N m/rad.
    """

    kind: Literal["uniform"]
    width: Annotated[float, Field(gt=0, le=2)]
    unit_masses: list[Annotated[float, Field(gt=0, le=100)]]
    joint_range_deg: Annotated[float, Field(gt=0, le=180)]
    bending_stiffness: Annotated[float, Field(gt=0, le=1e5)] | None = None
    joint_stiffness: Annotated[float, Field(gt=0, le=1e5)] | None = None

    def __post_init__(self):
        super().__post_init__()
        if (self.bending_stiffness is None) == (self.joint_stiffness is None):
            which = "neither" if self.joint_stiffness is None else "both"
            raise ValueError(f"found {which}, expected either bending_stiffness (EI) or joint_stiffness (K)")
        if len(self.unit_masses) not in (1, self.units):
            raise ValueError(f"unit_masses: found {len(self.unit_masses)}, expected one for all units, or "
                             f"one for each of the {self.units}")

    def chain(self) -> ChainGeometry:
        return uniform_chain(self.length, self.width, self.units, np.radians(self.joint_range_deg))

    def properties(self, chain: ChainGeometry) -> UnitProperties:
        stiffness = self.joint_stiffness or self.bending_stiffness / chain.lengths[0]
        return uniform_properties(chain, self.unit_masses, stiffness, self.damping_ratio)


def uniform_chain(length: float, width: float, units: int, joint_range: float) -> ChainGeometry:
    """`units` equal units of an arm of `length` and `width` (m); α = 1. `joint_range`: rad, how far a joint bends."""
    return ChainGeometry(
        lengths=np.full(units, length / units),
        widths=np.full(units, width),
        joint_range=np.full(units, joint_range),
        ratio=1.0,
    )


def uniform_properties(
    chain: ChainGeometry, masses: list[float], stiffness: float, damping_ratio: float
) -> UnitProperties:
    """What is known of every unit: solid cylinders of the given masses, one stiffness for all joints.

    Damping is D = 2ζ √(K m) ℓ as on the spiral, m being the mean unit's mass.

    Args:
        masses: kg, one for every unit, or one for each of them.
        stiffness: K of every joint, N m/rad: EI/ℓ where the bending stiffness EI of the arm is known.
        damping_ratio: ζ.
    """
    each = np.broadcast_to(np.asarray(masses, dtype=float), (chain.units,)).copy()
    return slender_properties(chain, each, np.full(chain.units, stiffness), damping_ratio)


def slender_properties(
    chain: ChainGeometry, masses: np.ndarray, stiffness: np.ndarray, damping_ratio: float
) -> UnitProperties:
    """As `uniform_properties`, of units that have masses, kg, and joints that have stiffness, N m/rad, of their own.
    Each of shape (n,)."""
    radius = chain.widths / 2
    return UnitProperties(
        masses=masses,
        transverse_inertia=masses * (radius**2 / 4 + chain.lengths**2 / 12),
        axial_inertia=masses * radius**2 / 2,
        stiffness=stiffness,
        damping=joint_damping(stiffness, masses.mean(), chain.lengths[0], damping_ratio),
    )
