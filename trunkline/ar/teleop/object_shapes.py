"""Objects as a grasp sees them: how they are grasped, where, and how far they reach down."""

import numpy as np

from trunkline.ar.hybrid.basket import Part, bar_height, parts_of
from trunkline.ar.teleop.messages import Obstacle, World, WorldObject
from trunkline.ar.teleop.vectors import Vector, add, rotate
from trunkline.frames import rotation_from_wxyz

WHOLE = np.eye(3)


def way_of_grasping(object: WorldObject) -> str:
    """A basket is grasped by its bar, whatever supports it; all else is as it hangs, and is in the arm since it did."""
    if object.shape == "basket":
        return "basket"
    return "standing" if object.support == "standing" else "hanging"


def grip_of(object: WorldObject) -> Vector:
    """The middle of what the arm wraps, base frame, m: a basket's bar, else the centre."""
    if object.shape != "basket":
        return object.position
    return add(object.position, rotate(object.quaternion, (0.0, 0.0, bar_height(object.basket, object.height))))


def below_grip(object: WorldObject) -> float:
    """How far its lowest point is below its grip, as it is turned, m."""
    if object.shape == "sphere":
        return object.diameter / 2
    turn = rotation_from_wxyz(np.array(object.quaternion)).as_matrix()
    lowest = min(float(turn[2] @ part.place) - _half_extent(part, turn) for part in _parts(object))
    return grip_of(object)[2] - object.position[2] - lowest


def beneath(place: Vector, world: World) -> Obstacle | None:
    """The highest obstacle that is beneath `place`, m; None where there is none."""
    x, y, z = place
    under = [
        obstacle
        for obstacle in world.obstacles
        if obstacle.low[0] <= x <= obstacle.high[0] and obstacle.low[1] <= y <= obstacle.high[1]
    ]
    lower = (obstacle for obstacle in under if obstacle.high[2] <= z)
    return max(lower, key=lambda obstacle: obstacle.high[2], default=None)


def distance_to(solid: WorldObject | Obstacle, point: Vector) -> float:
    """m from a point in the base frame to an object or obstacle, 0 within it; a cylinder counts as the box about it."""
    if isinstance(solid, Obstacle):
        beyond = np.maximum(np.subtract(solid.low, point), np.subtract(point, solid.high))
        return float(np.linalg.norm(np.maximum(beyond, 0.0)))
    aside = np.subtract(point, solid.position)
    if solid.shape == "sphere":
        return max(float(np.linalg.norm(aside)) - solid.diameter / 2, 0.0)
    aside = aside @ rotation_from_wxyz(np.array(solid.quaternion)).as_matrix()
    beyond = [np.abs((aside - part.place) @ part.turn) - part.half for part in _parts(solid)]
    return min(float(np.linalg.norm(np.maximum(sides, 0.0))) for sides in beyond)


def _parts(object: WorldObject) -> list[Part]:
    if object.shape == "basket":
        return list(parts_of(object.basket, object.diameter, object.height).values())
    half = np.array([object.diameter, object.diameter, object.height]) / 2
    return [Part("cylinder" if object.shape == "cylinder" else "box", half, np.zeros(3), WHOLE, 1.0)]


def _half_extent(part: Part, turn: np.ndarray) -> float:
    """Half its extent along the vertical, turned by `turn` (3, 3), m; without a toy's round edges."""
    x, y, z = np.abs(turn[2] @ part.turn) * part.half
    return float(np.hypot(x, y) + z if part.shape == "cylinder" else x + y + z)
