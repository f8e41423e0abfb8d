"""What geometry and material say about an arm before anything is measured: masses, stiffness, damping."""

from dataclasses import dataclass

import numpy as np

from trunkline.model.arm.geometry import ChainGeometry

TPU_95A_MODULUS = 26e6  # Pa, tensile modulus of a TPU of Shore hardness 95A, filament makers' sheets
TPU_95A_DENSITY = 1210.0  # kg/m³, the same sheets


@dataclass
class UnitProperties:
    """Per unit, base first; every array has shape (n,).

    Attributes:
        masses: kg.
        transverse_inertia, axial_inertia: about the unit's centre, kg m².
        stiffness: bending stiffness K_i of the joint at its proximal end, N m/rad.
        damping: D_i of that joint, N m s/rad.
        axial_stiffness: EA, N; None of units that keep their lengths.
    """

    masses: np.ndarray
    transverse_inertia: np.ndarray
    axial_inertia: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    axial_stiffness: np.ndarray | None = None


def wedge_fill(chain: ChainGeometry) -> np.ndarray:
    """Share of a unit's cylinder that is material, shape (n,).

    Neighbours touch at the rim when the joint is fully bent, so the gap at radius r is r Δθ wide, all round;
    its mean over the disc of radius R is 2/3 R Δθ.
    """
    return 1 - 2 / 3 * chain.widths / 2 * chain.joint_range / chain.lengths


def unit_properties(
    chain: ChainGeometry, modulus: float, density: float, core_ratio: float, damping_ratio: float
) -> UnitProperties:
    """CAD values of every unit.

    K = EI/L of the elastic core (paper eq. 2), a round rod of `core_ratio` times the unit's width; on a
    spiral that is K_0 α^{3(i-1)} (paper eq. 3). Damping scales with α³ too.

    Args:
        modulus: Young's modulus E, Pa.
        density: kg/m³.
        core_ratio: diameter of the elastic core over that of the unit.
        damping_ratio: ζ.
    """
    radius = chain.widths / 2
    masses = density * np.pi * radius**2 * chain.lengths * wedge_fill(chain)
    second_moment = np.pi * (core_ratio * chain.widths) ** 4 / 64
    stiffness = modulus * second_moment / chain.lengths
    return UnitProperties(
        masses=masses,
        transverse_inertia=masses * (radius**2 / 4 + chain.lengths**2 / 12),
        axial_inertia=masses * radius**2 / 2,
        stiffness=stiffness,
        damping=joint_damping(stiffness, masses, chain.lengths[0], damping_ratio),
    )


def joint_damping(stiffness: np.ndarray, masses: np.ndarray, length: float, damping_ratio: float) -> np.ndarray:
    """D = 2ζ √(K m) ℓ (paper eq. 4, with the first unit's length ℓ as the lever that makes it N m s/rad)."""
    return 2 * damping_ratio * np.sqrt(stiffness * masses) * length
