"""Targets: where both rays want the robot, tested against what it can reach and what stands in the way."""

import math
from dataclasses import replace

from trunkline.ar.teleop.alignment import Aligned, Wrist, align, base_quaternion, carried_heading
from trunkline.ar.teleop.messages import Offer, Target, Targets, World, WorldObject
from trunkline.ar.teleop.object_shapes import grip_of
from trunkline.ar.teleop.reach import Reach, Reading
from trunkline.ar.teleop.settings import Orientation, Teleop
from trunkline.ar.teleop.vectors import (
    DOWN,
    Vector,
    add,
    conjugate,
    cross,
    distance,
    dot,
    norm,
    rotate,
    scale,
    subtract,
)


def place(
    rigid: Vector,
    tip: Vector,
    pointing: Vector,
    limited: bool,
    wrist: Wrist,
    last: Aligned,
    world: World,
    reach: Reach,
    settings: Teleop,
) -> Targets:
    """Both targets (base frame, m) with their reach under the gravity that the arm will have there.

    A tip target that marks an object is where the arm grips it. Whether it can be grasped no map tells: plan and
    preview do.
    """
    object = marked(tip, world, settings.mark)
    tip = tip if object is None else grip_of(object)
    aligned = align(tip, rigid, pointing, wrist, last, settings.bending_plane)
    turn = base_quaternion(pointing, aligned.heading)
    back = conjugate(turn)
    reading = Reading("unknown")
    if object is None:
        reading = reach.soft(rotate(back, subtract(tip, rigid)), rotate(back, DOWN))
    offer = None if reading.offer is None else add(rigid, rotate(turn, reading.offer))
    return Targets(
        _target(rigid, reach.rigid(rigid, pointing), world),
        _target(tip, reading._replace(offer=offer), world),
        pointing,
        aligned.heading,
        aligned.half_plane,
        aligned.turned,
        limited,
        "" if object is None else object.name,
    )


def bring(
    object: WorldObject,
    rigid: Vector,
    pointing: Vector,
    limited: bool,
    wrist: Wrist,
    half_plane: int,
    world: World,
    reach: Reach,
) -> Targets:
    """Targets of an arm that holds an object: the mount goes to `rigid`, the wrist as joint 1 carries it, and the tip
    target is where what it grips comes to."""
    heading = carried_heading(rigid, wrist)
    there = base_quaternion(pointing, heading)
    here = base_quaternion(wrist.pointing, wrist.heading)
    beside = rotate(conjugate(here), subtract(grip_of(object), wrist.position))
    tip = add(rigid, rotate(there, beside))
    return Targets(
        _target(rigid, reach.rigid(rigid, pointing), world),
        _target(tip, Reading("unknown"), world),
        pointing,
        heading,
        half_plane,
        0.0,
        limited,
        object.name,
    )


def marked(tip: Vector, world: World, within: float) -> WorldObject | None:
    """The object nearest to the tip target, at most `within` m from it."""
    near = [object for object in world.objects if distance(tip, grip_of(object)) <= within]
    return min(near, key=lambda object: distance(tip, grip_of(object)), default=None)


def offered(targets: Targets, offer: Offer | None) -> Targets:
    """The targets with the assistant's offer, where it is for the object that they mark."""
    return replace(targets, better=offer) if offer is not None and offer.object == targets.object else targets


def _target(position: Vector, reading: Reading, world: World) -> Target:
    for obstacle in world.obstacles:
        if all(low <= x <= high for low, x, high in zip(obstacle.low, position, obstacle.high, strict=True)):
            return Target(position, "blocked", obstacle=obstacle.name)
    return Target(position, *reading)


def tilted(pointing: Vector, toward: Vector, dt: float, settings: Orientation) -> tuple[Vector, bool]:
    """Where the end effector points after `dt` s of following the direction `toward`, and whether that is tilted
    further than it may be: then it stays at the largest tilt in that direction."""
    tilt = math.acos(min(max(dot(toward, DOWN), -1.0), 1.0))
    limited = tilt > settings.most_tilt
    if limited:
        toward = _turned(DOWN, toward, settings.most_tilt)
    angle = math.acos(min(max(dot(pointing, toward), -1.0), 1.0))
    step = settings.rate * dt
    return (toward if angle <= step else _turned(pointing, toward, step)), limited


def _turned(a: Vector, b: Vector, angle: float) -> Vector:
    """`a` turned by `angle`, rad, towards `b`, both of unit length."""
    axis = cross(a, b)
    length = norm(axis)
    if length < 1e-12:  # opposite: any way is as short
        axis, length = (1.0, 0.0, 0.0), 1.0
    side = cross(scale(axis, 1 / length), a)
    result = add(scale(a, math.cos(angle)), scale(side, math.sin(angle)))
    return scale(result, 1 / norm(result))


def why_not(targets: Targets | None) -> str:
    """Why no plan can be asked for, in one line; "" where one can."""
    if targets is None:
        return "both targets are needed: hold a grip to set each"
    for name, target in _by_name(targets):
        if target.reach == "blocked":
            return f"{name} target is inside {target.obstacle}"
        if target.reach == "outside":
            offered = "; primary button takes the nearest point that is within" if target.offer else ""
            return f"{_by_how_much(name, target)}{offered}"
    if targets.turned is None:
        return "wrist cannot turn the arm's bending plane to the tip target"
    return ""


def out_of_reach(targets: Targets | None) -> str:
    """Which target is out of reach, in one line; "" where none is."""
    both = () if targets is None else _by_name(targets)
    return next((_by_how_much(name, target) for name, target in both if target.reach == "outside"), "")


def _by_name(targets: Targets) -> tuple[tuple[str, Target], ...]:
    return ("rigid", targets.rigid), ("tip", targets.tip)


def _by_how_much(name: str, target: Target) -> str:
    return f"{name} target is {1e3 * target.outside_by:.0f} mm out of reach"
