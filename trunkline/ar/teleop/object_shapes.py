"""Things as a grasp sees them: how they are grasped, where, and how far they reach down."""

import numpy as np

from trunkline.ar.hybrid.basket import Part, bar_height, parts_of
from trunkline.ar.teleop.messages import Box, Thing, World
from trunkline.ar.teleop.vectors import Vector, add, rotate
from trunkline.frames import rotation_from_wxyz

WHOLE = np.eye(3)


def way_of_grasping(thing: Thing) -> str:
    """A basket is grasped by its bar, whatever supports it; all else is as it hangs, and is in the arm since it did."""
    if thing.shape == "basket":
        return "basket"
    return "standing" if thing.support == "standing" else "hanging"


def grip_of(thing: Thing) -> Vector:
    """The middle of what the arm wraps, base frame, m: a basket's bar, else the centre."""
    if thing.shape != "basket":
        return thing.position
    return add(thing.position, rotate(thing.quaternion, (0.0, 0.0, bar_height(thing.basket, thing.height))))


def below_grip(thing: Thing) -> float:
    """How far its lowest point is below its grip, as it is turned, m."""
    if thing.shape == "sphere":
        return thing.diameter / 2
    turn = rotation_from_wxyz(np.array(thing.quaternion)).as_matrix()
    lowest = min(float(turn[2] @ part.place) - _half_extent(part, turn) for part in _parts(thing))
    return grip_of(thing)[2] - thing.position[2] - lowest


def beneath(place: Vector, world: World) -> Box | None:
    """The highest solid that is beneath `place`, m; None where there is none."""
    x, y, z = place
    under = [box for box in world.boxes if box.low[0] <= x <= box.high[0] and box.low[1] <= y <= box.high[1]]
    return max((box for box in under if box.high[2] <= z), key=lambda box: box.high[2], default=None)


def _parts(thing: Thing) -> list[Part]:
    if thing.shape == "basket":
        return list(parts_of(thing.basket, thing.diameter, thing.height).values())
    half = np.array([thing.diameter, thing.diameter, thing.height]) / 2
    return [Part("cylinder" if thing.shape == "cylinder" else "box", half, np.zeros(3), WHOLE, 1.0)]


def _half_extent(part: Part, turn: np.ndarray) -> float:
    """Half its extent along the vertical, turned by `turn` (3, 3), m; without a toy's round edges."""
    x, y, z = np.abs(turn[2] @ part.turn) * part.half
    return float(np.hypot(x, y) + z if part.shape == "cylinder" else x + y + z)
