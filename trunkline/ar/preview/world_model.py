"""The world as a client believes it, after what it sees: where things are, and what holds them after a plan."""

import hashlib
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from trunkline.ar.teleop.messages import Box, Thing, World

MOVED = 0.005  # m by which a thing must be seen elsewhere than believed


def make_world(boxes: tuple[Box, ...], things: tuple[Thing, ...] = ()) -> World:
    """With its digest."""
    return World(hashlib.sha256(repr((boxes, things)).encode()).hexdigest(), boxes, things)


def update_world(world: World, pose: np.ndarray, phases: Collection[str], lift: float) -> World:
    """The world with its one thing seen at `pose` (7,), NaN where nothing is seen.

    Args:
        phases: of a plan that has just been run to its end, none else. lift: m by which a grasp lifts.
    """
    if len(world.things) != 1 or not np.isfinite(pose).all():
        return world
    thing = world.things[0]
    x, y, z, a, b, c, d = (float(value) for value in pose)
    lifted = z - thing.position[2] > lift / 2
    support = "standing" if "release" in phases else "held" if "lift" in phases and lifted else thing.support
    if support == thing.support and np.linalg.norm(pose[:3] - thing.position) <= MOVED:
        return world
    now = replace(thing, position=(x, y, z), quaternion=(a, b, c, d), support=support)
    return make_world(world.boxes, (now,))
