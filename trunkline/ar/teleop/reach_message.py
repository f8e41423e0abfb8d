"""What is told of a target's reach."""

from typing import Literal, NamedTuple

from trunkline.ar.teleop.vectors import Vector


class Reading(NamedTuple):
    """`where` a point is, how far `outside_by`, m, and the nearest reachable point, the `offer`, where it is
    outside."""

    where: Literal["inside", "outside", "unknown"]
    outside_by: float = 0.0
    offer: Vector | None = None
