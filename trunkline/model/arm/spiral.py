"""The logarithmic spiral ρ = a e^{bθ} of SpiRobs (Wang et al. 2024), unrolled into a chain of similar units."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from trunkline.errors import InputError
from trunkline.model.arm.cad import ChainArm
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import UnitProperties, unit_properties

GROWTH_BRACKET = (1e-3, 10.0)  # b of any arm that one could print: 1e-3 is nearly a circle


@dataclass
class Spiral(ChainArm):
    """base_width, tip_width: m. modulus: Pa. density: kg/m³. core_ratio: core diameter over the unit's."""

    kind: Literal["spiral"]
    base_width: Annotated[float, Field(gt=0, le=2)]
    tip_width: Annotated[float, Field(gt=0, le=2)]
    modulus: Annotated[float, Field(ge=1e3, le=1e12)]
    density: Annotated[float, Field(ge=1, le=30000)]
    core_ratio: Annotated[float, Field(gt=0, lt=1)]

    def chain(self) -> ChainGeometry:
        return spiral_chain(self.length, self.base_width, self.tip_width, self.units)

    def properties(self, chain: ChainGeometry) -> UnitProperties:
        return unit_properties(chain, self.modulus, self.density, self.core_ratio, self.damping_ratio)


def _length(growth: float, base_width: float, tip_width: float) -> float:
    """Length of the unrolled spiral, L(b) = √(1+b²)/b · (W-w)/2 · (e^{2πb}+1)/(e^{2πb}-1), m."""
    coth = 1 / np.tanh(np.pi * growth)
    return np.sqrt(1 + growth**2) / growth * (base_width - tip_width) / 2 * coth


def growth_rate(length: float, base_width: float, tip_width: float) -> float:
    """The spiral's b for an arm of this length and these widths (m).

    Raises:
        InputError: if no logarithmic spiral has these dimensions.
    """
    shortest, longest = (_length(b, base_width, tip_width) for b in GROWTH_BRACKET[::-1])
    if not shortest < length < longest:
        raise InputError(
            f"arm.length: found {length} m, expected between {shortest:.4g} and {longest:.4g} m "
            f"for widths of {base_width} to {tip_width} m"
        )
    return brentq(lambda b: _length(b, base_width, tip_width) - length, *GROWTH_BRACKET, xtol=1e-14)


def spiral_chain(length: float, base_width: float, tip_width: float, units: int) -> ChainGeometry:
    """Cut the spiral into `units` similar units that close on each other when fully bent.

    Δθ = ln(W/w)/(b n) is the angle that a unit takes of the spiral, and so the joint range; α = e^{-bΔθ}.

    Args:
        length, base_width, tip_width: L, W, w in m, W > w.
    """
    if not base_width > tip_width:
        raise InputError(f"arm.tip_width: found {tip_width} m, expected less than arm.base_width, {base_width} m")
    growth = growth_rate(length, base_width, tip_width)
    unit_angle = np.log(base_width / tip_width) / (growth * units)
    ratio = float(np.exp(-growth * unit_angle))
    scaling = ratio ** np.arange(units)
    first_length = length * (1 - ratio) / (1 - ratio**units)
    return ChainGeometry(
        lengths=first_length * scaling,
        widths=base_width * scaling,
        joint_range=np.full(units, unit_angle),
        ratio=ratio,
    )
