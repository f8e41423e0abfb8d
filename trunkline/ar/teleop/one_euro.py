"""The One-Euro filter: a low-pass whose cutoff grows with speed, so that a still hand is calm and a fast one not late.

    f_c = f_min + β |v|,    α = 1 / (1 + 1 / (2 π f_c Δt)),    x ← x + α (measured - x)

and the speed v goes through a low-pass of its own of cutoff f_d. Source: G. Casiez, N. Roussel, D. Vogel, "1€ Filter: A
Simple Speed-based Low-pass Filter for Noisy Input in Interactive Systems", CHI 2012. A position has one cutoff for its
three coordinates, from the length of its velocity, and an orientation one from its angular speed, so that neither
depends on axes.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from trunkline.ar.teleop.vectors import (
    Quaternion,
    Vector,
    add,
    angle_between,
    norm,
    scale,
    subtract,
    toward,
    unit,
)


@dataclass(frozen=True)
class OneEuro:
    """`min_cutoff` f_min and `derivative_cutoff` f_d in Hz; `beta` β in Hz per m/s, or per rad/s."""

    min_cutoff: Annotated[float, Field(gt=0, le=100)]
    beta: Annotated[float, Field(ge=0, le=1000)]
    derivative_cutoff: Annotated[float, Field(gt=0, le=100)]


@dataclass(frozen=True)
class Smoothed:
    """A pose as filtered: `position` (m) and `quaternion`, their low-passed `velocity` (m/s) and `spin` (rad/s)."""

    position: Vector
    quaternion: Quaternion
    velocity: Vector = (0.0, 0.0, 0.0)
    spin: float = 0.0


def smooth(
    last: Smoothed | None, position: Vector, quaternion: Quaternion, dt: float, place: OneEuro, turn: OneEuro
) -> Smoothed:
    """The filtered pose after a measured one, `dt` s after the `last`; as measured where there is no last one."""
    quaternion = unit(quaternion)
    if last is None:
        return Smoothed(position, quaternion)
    moved = scale(subtract(position, last.position), 1 / dt)
    share = _share(place.derivative_cutoff, dt)
    velocity = add(last.velocity, scale(subtract(moved, last.velocity), share))
    share = _share(place.min_cutoff + place.beta * norm(velocity), dt)
    placed = add(last.position, scale(subtract(position, last.position), share))
    turned = angle_between(last.quaternion, quaternion) / dt
    spin = last.spin + _share(turn.derivative_cutoff, dt) * (turned - last.spin)
    share = _share(turn.min_cutoff + turn.beta * abs(spin), dt)
    return Smoothed(placed, toward(last.quaternion, quaternion, share), velocity, spin)


def _share(cutoff: float, dt: float) -> float:
    return 1 / (1 + 1 / (2 * math.pi * cutoff * dt))
