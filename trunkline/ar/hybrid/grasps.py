"""Where an object must be for the arm to wrap it: the grasp frame.

A spiral arm curls from its tip. Pulled beside an object, it lays itself round it from the tip on, and holds best where
the part beyond the place at which it touches first goes once round: with that place at s along the arm, of length L and
width w(s), round an object of diameter d,

    L - s = wrap · π (d + w((s + L) / 2)),

as the arm's axis goes round a circle of diameter d + w. The object's centre then lies at s, and beside the arm by
(d + w(s)) / 2 and a gap, to the side of the cable that is pulled: +x for dorsal pulls (tendon 1), -x for ventral ones
(tendons 2 and 3 alike). Its axis lies across the bending plane, along base y.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from trunkline.model.arm.geometry import ChainGeometry

Pull = Literal["dorsal", "ventral"]
CABLES: dict[str, np.ndarray] = {"dorsal": np.array([1.0, 0, 0]), "ventral": np.array([0, 1.0, 1.0])}


@dataclass
class Grasp:
    """wrap: turns of the arm round the object. gap: between arm and object at first, m. shortest: of L - s, m, for thin
    objects, which the very tip cannot hold. highest: the least s, m, for wide ones."""

    wrap: Annotated[float, Field(gt=0, le=3)]
    gap: Annotated[float, Field(ge=0, le=0.2)]
    shortest: Annotated[float, Field(ge=0, le=1)] = 0.05
    highest: Annotated[float, Field(ge=0, le=1)] = 0.1


def width_at(geometry: ChainGeometry, s: float) -> float:
    """The arm's width at `s` m from the mount, m."""
    ends = np.concatenate([[0], np.cumsum(geometry.lengths)])
    return float(np.interp(s, ends, np.append(geometry.widths, geometry.widths[-1] * geometry.ratio)))


def touch_at(geometry: ChainGeometry, diameter: float, grasp: Grasp) -> float:
    """s, m from the mount: where along the arm it touches an object of `diameter` m first."""
    length = geometry.length

    def beyond(s: float) -> float:
        return length - s - grasp.wrap * np.pi * (diameter + width_at(geometry, (s + length) / 2))

    s = brentq(beyond, 0, length) if beyond(0) > 0 else 0.0
    return float(np.clip(s, grasp.highest, length - grasp.shortest))


def object_in_base(geometry: ChainGeometry, diameter: float, grasp: Grasp, pull: Pull) -> np.ndarray:
    """Where the centre of an object of `diameter` m must be in the arm's base frame, m. Shape (3,)."""
    s = touch_at(geometry, diameter, grasp)
    side = 1.0 if pull == "dorsal" else -1.0
    return np.array([side * ((diameter + width_at(geometry, s)) / 2 + grasp.gap), 0.0, -s])


def pulls_of(pull: Pull, shortening: float) -> np.ndarray:
    """How much shorter than in the straight arm each cable is commanded, m; 0 for those paid out. Shape (3,)."""
    return CABLES[pull] * shortening
