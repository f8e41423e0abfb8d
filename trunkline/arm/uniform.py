"""A chain of equal units: a hose, a rod or a stack of discs, straight when cut, of one diameter."""

import numpy as np

from trunkline.arm.geometry import ChainGeometry
from trunkline.arm.material import UnitProperties, joint_damping


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
    masses = np.broadcast_to(np.asarray(masses, dtype=float), (chain.units,)).copy()
    radius = chain.widths / 2
    stiffness = np.full(chain.units, stiffness)
    return UnitProperties(
        masses=masses,
        transverse_inertia=masses * (radius**2 / 4 + chain.lengths**2 / 12),
        axial_inertia=masses * radius**2 / 2,
        stiffness=stiffness,
        damping=joint_damping(stiffness, masses.mean(), chain.lengths[0], damping_ratio),
    )
