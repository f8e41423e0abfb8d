"""A basket: a box with a level bar above it, by which the arm carries it, as a hand does by a handle.

The bar lies along y. Two posts at its ends carry it on the box, which is as long as the bar. Most of the mass is in the
box, spread evenly; the rest is in bar and posts, by their lengths.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

HANDLE = 0.1  # of the mass, in bar and posts
POST = 0.004  # m, radius of a post
UPRIGHT = np.eye(3)
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # turns z to y


@dataclass(frozen=True)
class Basket:
    """Sizes beside the bar's diameter and the box's height.

    Attributes:
        width: of the box along x, m.
        length: of box and bar along y, m.
        rise: of the bar's axis above the box, m. The straight arm hangs beside the bar, its end above the box.
    """

    width: Annotated[float, Field(ge=0.02, le=0.5)] = 0.12
    length: Annotated[float, Field(ge=0.05, le=0.5)] = 0.16
    rise: Annotated[float, Field(ge=0.05, le=0.5)] = 0.22

    def require_room(self, diameter: float) -> None:
        """Raises ValueError if the arm would not fit under a bar of `diameter` m."""
        if self.rise < diameter:
            raise ValueError(f"basket.rise: found {self.rise} m, expected at least the bar's diameter, {diameter} m")


@dataclass(frozen=True)
class Part:
    """A convex part of an object.

    Attributes:
        half: half its sizes along its own axes, m; a cylinder's own z is its axis. Shape (3,).
        place: of its centre in the object's frame, m. Shape (3,).
        turn: matrix, the object's frame ← its own, which maps axes to axes. Shape (3, 3).
        share: of the object's mass.
    """

    shape: Literal["cylinder", "box"]
    half: np.ndarray
    place: np.ndarray
    turn: np.ndarray
    share: float

    def variance(self) -> np.ndarray:
        """Mean square distance of its mass from its centre along the object's axes, m². Shape (3,)."""
        variance = self.half**2 / 3 if self.shape == "box" else self.half**2 / [4, 4, 3]
        return np.abs(self.turn) @ variance


def centre_height(basket: Basket, height: float) -> float:
    """m, of the centre of mass above that of a box of `height` m."""
    rod, top = _rod(basket), height / 2
    return rod * (basket.length * (top + basket.rise) + 2 * basket.rise * (top + basket.rise / 2))


def bar_height(basket: Basket, height: float) -> float:
    """m, of the bar's axis above the centre of mass."""
    return height / 2 + basket.rise - centre_height(basket, height)


def _rod(basket: Basket) -> float:
    """Share of the mass in a metre of bar or post."""
    return HANDLE / (basket.length + 2 * basket.rise)


def parts_of(basket: Basket, diameter: float, height: float) -> dict[str, Part]:
    """Bar, posts and box in the frame of the centre of mass, z up.

    Args:
        diameter: of the bar, m. height: of the box, m.
    """
    width, length, rise = basket.width, basket.length, basket.rise
    rod, centre = _rod(basket), centre_height(basket, height)
    bar, post = np.array([diameter, diameter, length]) / 2, np.array([POST, POST, rise / 2])
    box, aside, top = np.array([width, length, height]) / 2, length / 2 - POST, height / 2
    return {
        "bar": Part("cylinder", bar, np.array([0, 0, bar_height(basket, height)]), LEVEL, rod * length),
        "post_1": Part("cylinder", post, np.array([0, -aside, top + rise / 2 - centre]), UPRIGHT, rod * rise),
        "post_2": Part("cylinder", post, np.array([0, aside, top + rise / 2 - centre]), UPRIGHT, rod * rise),
        "box": Part("box", box, np.array([0, 0, -centre]), UPRIGHT, 1 - HANDLE),
    }


def unit_inertia(parts: dict[str, Part]) -> np.ndarray:
    """Moments of inertia of 1 kg about the axes, m². Shape (3,)."""
    spread = np.sum([part.share * (part.variance() + part.place**2) for part in parts.values()], axis=0)
    return spread.sum() - spread
