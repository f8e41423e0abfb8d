"""Where tendons run: a number of them, evenly spread, or one described after the other."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.model.arm.geometry import ChainGeometry

MOST = 48

Distance = Annotated[float, Field(gt=0, le=1)]


@dataclass
class Tendon:
    """One tendon of an arm's description.

    Attributes:
        angle: about the arm's axis from +x towards +y, deg.
        distance: of its holes from the axis, m, or that at the first and that at its end, evenly changing along the
            arm; where it is left out, the arm's `hole_ratio` of each unit's outer radius.
        end: the unit where it is anchored, counted from 1 at the mount; 0 for the last.
        start: the unit from whose hole on it bends the arm, counted likewise; 0 for the mount. Before that it runs
            where no bend changes its length, as in a sheath.
        pretension: with which it pulls on the straight arm while its command is 0, N.
    """

    angle: Annotated[float, Field(ge=-360, le=360)]
    distance: Distance | tuple[Distance, Distance] | None = None
    end: Annotated[int, Field(ge=0, le=500)] = 0
    start: Annotated[int, Field(ge=0, le=500)] = 0
    pretension: Annotated[float, Field(ge=0, le=1000)] = 0.0


@dataclass
class Route:
    """The way of a tendon, through one hole a unit to the unit where it is anchored.

    Attributes:
        angle: about the arm's axis from +x towards +y, rad.
        distances: of its holes from the axis, m: of the mount's, then of each unit's up to the last; from that of
            unit `start` on. Shape (e + 1 - start,).
        pretension: N.
        start: the unit, from 1, of its first hole; 0 for the mount.
    """

    angle: float
    distances: np.ndarray
    pretension: float = 0.0
    start: int = 0


def even_routes(chain: ChainGeometry, count: int, ratio: float) -> list[Route]:
    """Tendons to the last unit, evenly spread around the arm, the first over +x. `ratio`: distance of their holes from
    the axis over the unit's outer radius."""
    return [Route(2 * np.pi * index / count, _along(chain, ratio)) for index in range(count)]


def described_routes(chain: ChainGeometry, tendons: list[Tendon], ratio: float) -> list[Route]:
    """As `even_routes`, of tendons that a description lists; `ratio` is for those without a distance."""
    return [_route(chain, tendon, ratio) for tendon in tendons]


def _route(chain: ChainGeometry, tendon: Tendon, ratio: float) -> Route:
    end = tendon.end or chain.units
    if tendon.distance is None:
        distances = _along(chain, ratio)[: end + 1]
    elif isinstance(tendon.distance, tuple):
        below = np.append(0.0, np.cumsum(chain.lengths[:end]) - chain.lengths[:end] / 2)  # the mount's hole is at 0
        distances = np.interp(below, [below[tendon.start], below[-1]], tendon.distance)
    else:
        distances = np.full(end + 1, tendon.distance)
    return Route(np.radians(tendon.angle), distances[tendon.start :], tendon.pretension, tendon.start)


def _along(chain: ChainGeometry, ratio: float) -> np.ndarray:
    radii = ratio * chain.widths / 2
    return np.append(radii[0], radii)
