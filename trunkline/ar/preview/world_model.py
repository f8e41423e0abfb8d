"""The world as a client believes it, after what it sees: where objects are, and what holds them after a plan."""

import hashlib
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from trunkline.ar.teleop.messages import Obstacle, World, WorldObject

MOVED = 0.005  # m by which an object must be seen elsewhere than believed


def make_world(obstacles: tuple[Obstacle, ...], objects: tuple[WorldObject, ...] = ()) -> World:
    """With its digest."""
    return World(hashlib.sha256(repr((obstacles, objects)).encode()).hexdigest(), obstacles, objects)


def update_world(world: World, pose: np.ndarray, phases: Collection[str], lift: float) -> World:
    """The world with its one object seen at `pose` (7,), NaN where nothing is seen.

    Args:
        phases: of a plan that has just been run to its end, none else. lift: m by which a grasp lifts at least.
    """
    if len(world.objects) != 1 or not np.isfinite(pose).all():
        return world
    object = world.objects[0]
    x, y, z, a, b, c, d = (float(value) for value in pose)
    lifted = z - object.position[2] > lift / 2
    support = "standing" if "release" in phases else "held" if "lift" in phases and lifted else object.support
    if support == object.support and np.linalg.norm(pose[:3] - object.position) <= MOVED:
        return world
    now = replace(object, position=(x, y, z), quaternion=(a, b, c, d), support=support)
    return make_world(world.obstacles, (now,))
