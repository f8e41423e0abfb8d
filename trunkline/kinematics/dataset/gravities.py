"""The directions of gravity at which samples are drawn: angles of one tilt, as in the paper, from any side, or none."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from trunkline.frames import downwards

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))  # rad, between two points of a Fibonacci lattice


@dataclass
class GravityRays:
    """At each gravity: directions, steps: of the candidates, see `sampling.sample_at`."""

    directions: Annotated[int, Field(ge=8, le=10000)]
    steps: Annotated[int, Field(ge=8, le=10000)]


@dataclass
class Tilts(GravityRays):
    """The mount tilts about base +y alone, by so many degrees: the paper's form."""

    kind: Literal["tilt"]
    angles_deg: Annotated[list[Annotated[float, Field(ge=0, le=180)]], Field(min_length=2)]

    def __post_init__(self) -> None:
        if any(after <= before for before, after in pairwise(self.angles_deg)):
            raise ValueError(f"angles_deg: found {self.angles_deg}, expected rising angles from 0 to 180")

    @property
    def downs(self) -> np.ndarray:
        """Directions of gravity in the base frame. Shape (G, 3)."""
        return downwards(np.radians(self.angles_deg), np.zeros(len(self.angles_deg)))


@dataclass
class Directions(GravityRays):
    """Gravity from any side: `count` directions, spread evenly up to `largest_deg` from the straight arm."""

    kind: Literal["direction"]
    count: Annotated[int, Field(ge=8, le=100_000)]
    largest_deg: Annotated[float, Field(gt=0, le=180)]

    @property
    def downs(self) -> np.ndarray:
        """Directions of gravity in the base frame. Shape (G, 3)."""
        return spread(self.count, np.radians(self.largest_deg))


@dataclass
class Weightless(GravityRays):
    """No gravity: for an arm so stiff or so light that its session says `gravity: none`."""

    kind: Literal["none"]

    @property
    def downs(self) -> np.ndarray:
        """A direction of no length. Shape (1, 3)."""
        return np.zeros((1, 3))


Gravities = Annotated[Tilts | Directions | Weightless, Field(discriminator="kind")]


def spread(count: int, largest: float, crowd: bool = False) -> np.ndarray:
    """`count` directions evenly over the cap of those up to `largest` rad from the straight arm: a Fibonacci lattice.

    The first is that of the hanging arm. With `crowd`, they lie the nearer together the nearer to the border, where
    interpolation has neighbours on one side alone: shares a of the cap's area become sin(π a / 2), as Chebyshev's
    nodes.

    Returns:
        Unit vectors in the base frame. Shape (count, 3).
    """
    index = np.arange(count)
    area = index / max(1, count - 1)
    share = (1 - np.cos(largest)) * (np.sin(np.pi / 2 * area) if crowd else area)
    return downwards(np.arccos(1 - share), GOLDEN_ANGLE * index)
