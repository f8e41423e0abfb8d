"""All contacts of a step: the arm with the object and with the world, the object with the world.

A unit of the arm touches as a flat disc with round edges, which lies in its middle: a point for each shape, of the
object as of the world, the nearest one, so that it slides and rolls without corners. The arm does not touch itself, nor
the Panda anything.
"""

from typing import NamedTuple

import numpy as np

from rehearsal.robot.compiled import kernel
from rehearsal.robot.contact import touch
from rehearsal.robot.rigid_object import rotation, spin_of, transposed
from rehearsal.robot.shapes import distance, nearest
from trunkline.model.statics.vectors import cross, plus, turned


class Discs(NamedTuple):
    """Of U units. link (U,). height (U,): of the centre above the link's joint (negative), m. radius, edge (U,): m.

    hardness, stiffness, damping (U,): of contacts, N/m^1.5, N/m, N s/m. loss: s/m.
    on_object (U,), on_world (U, W): friction.
    """

    link: np.ndarray
    height: np.ndarray
    radius: np.ndarray
    edge: np.ndarray
    hardness: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    loss: float
    on_object: np.ndarray
    on_world: np.ndarray


class ContactWorld(NamedTuple):
    """W fixed shapes. kind (W,), half (W, 3) m, edge (W,) m, place (W, 3) m: `shapes.Shape`s that are not turned.

    Contacts with the object: hardness N/m^1.5, stiffness N/m, damping N s/m, loss s/m, friction (W,).
    """

    kind: np.ndarray
    half: np.ndarray
    edge: np.ndarray
    place: np.ndarray
    hardness: float
    stiffness: float
    damping: float
    loss: float
    friction: np.ndarray


class Contacts(NamedTuple):
    """What contacts remember from step to step, and the forces of the last one, N, on the first named of the two.

    object (U, S, 3): the arm's bristles on the object's shapes, in the object's frame, which turns with what is held.
    world (U, W, 3), lying (P, W, 3): the arm's and the object's on the world. near (U, S + W, 3): where a disc was
    nearest, from its centre, m, first to the object's shapes, then to the world.
    arm_object (U, 3), arm_world (U, W, 3), object_world (W, 3): forces, in the world.
    """

    object: np.ndarray
    world: np.ndarray
    lying: np.ndarray
    near: np.ndarray
    arm_object: np.ndarray
    arm_world: np.ndarray
    object_world: np.ndarray


@kernel
def touch_all(h, discs, world, object, motion, contacts, work, turn, place):
    """Force and torque on the object about its centre; forces on the arm's links go into work.pushed.

    Args:
        work: of the stranger's kernel; `moving` holds velocities against the world, in the arm's frame.
        turn, place: rows and tuple, the arm's frame in the world.
    """
    back = transposed(turn)
    pose = rotation(motion.quaternion)
    unpose = transposed(pose)
    centre = (motion.place[0], motion.place[1], motion.place[2])
    speed = (motion.speed[0], motion.speed[1], motion.speed[2])
    spin = spin_of(object, motion, pose)
    shapes = len(object.kind)
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    contacts.arm_object[:] = 0.0
    contacts.arm_world[:] = 0.0
    contacts.object_world[:] = 0.0
    for u in range(len(discs.link)):
        i = discs.link[u]
        f = work.frames[i]
        axis = (f[0, 2], f[1, 2], f[2, 2])
        local = plus((work.joints[i, 0], work.joints[i, 1], work.joints[i, 2]), discs.height[u], axis)
        disc, axis = plus(turned(turn, local), 1.0, place), turned(turn, axis)
        m = work.moving[i]
        turning, moving = (m[0], m[1], m[2]), (m[3], m[4], m[5])
        size = discs.radius[u] + discs.edge[u]

        for s in range(shapes):
            out = _rows(object.turn[s])
            within = transposed(out)
            inside = turned(within, plus(turned(unpose, plus(disc, -1.0, centre)), -1.0, _row(object.shift[s])))
            away, _ = distance(object.kind[s], object.half[s], object.edge[s], inside)
            if away < size:
                near, away, gradient = nearest(
                    object.kind[s], object.half[s], object.edge[s], inside, turned(within, turned(unpose, axis)),
                    discs.radius[u], turned(within, turned(unpose, _row(contacts.near[u, s]))),
                )  # fmt: skip
                near = turned(pose, turned(out, near))
                _write(contacts.near[u, s], near)
            depth = discs.edge[u] - away
            if away >= size or depth <= 0:
                contacts.object[u, s] = 0.0
                continue
            normal = turned(pose, turned(out, gradient))
            point = plus(plus(disc, 1.0, near), -(discs.edge[u] - 0.5 * depth), normal)
            lever = plus(point, -1.0, centre)
            at = turned(back, plus(point, -1.0, place))
            mine = turned(turn, plus(moving, 1.0, cross(turning, at)))
            velocity = plus(plus(mine, -1.0, speed), -1.0, cross(spin, lever))
            pushed, bristle = touch(
                h, depth, normal, velocity, turned(pose, _row(contacts.object[u, s])), discs.hardness[u], discs.loss,
                discs.stiffness[u], discs.damping[u], discs.on_object[u],
            )  # fmt: skip
            _write(contacts.object[u, s], turned(unpose, bristle))
            for a in range(3):
                contacts.arm_object[u, a] += pushed[a]
            _push(work.pushed[i], at, turned(back, pushed))
            force, torque = plus(force, -1.0, pushed), plus(torque, -1.0, cross(lever, pushed))

        for w in range(len(world.kind)):
            inside = plus(disc, -1.0, _row(world.place[w]))
            away, _ = distance(world.kind[w], world.half[w], world.edge[w], inside)
            if away < size:
                near, away, normal = nearest(
                    world.kind[w], world.half[w], world.edge[w], inside, axis, discs.radius[u],
                    _row(contacts.near[u, shapes + w]),
                )  # fmt: skip
                _write(contacts.near[u, shapes + w], near)
            depth = discs.edge[u] - away
            if away >= size or depth <= 0:
                contacts.world[u, w] = 0.0
                continue
            point = plus(plus(disc, 1.0, near), -(discs.edge[u] - 0.5 * depth), normal)
            at = turned(back, plus(point, -1.0, place))
            velocity = turned(turn, plus(moving, 1.0, cross(turning, at)))
            pushed, bristle = touch(
                h, depth, normal, velocity, _row(contacts.world[u, w]), discs.hardness[u], discs.loss,
                discs.stiffness[u], discs.damping[u], discs.on_world[u, w],
            )  # fmt: skip
            _write(contacts.world[u, w], bristle)
            _write(contacts.arm_world[u, w], pushed)
            _push(work.pushed[i], at, turned(back, pushed))

    lying, twisting = lie(h, world, object, contacts, pose, centre, speed, spin)
    return plus(force, 1.0, lying), plus(torque, 1.0, twisting)


@kernel
def lie(h, world, object, contacts, pose, centre, speed, spin):
    """Force and torque on the object of what it lies on or runs into."""
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for p in range(len(object.points)):
        lever = turned(pose, _row(object.points[p]))
        point = plus(centre, 1.0, lever)
        for w in range(len(world.kind)):
            away, normal = distance(
                world.kind[w], world.half[w], world.edge[w], plus(point, -1.0, _row(world.place[w]))
            )
            depth = object.radius - away
            if depth <= 0:
                contacts.lying[p, w] = 0.0
                continue
            arm = plus(lever, -(object.radius - 0.5 * depth), normal)
            pushed, bristle = touch(
                h, depth, normal, plus(speed, 1.0, cross(spin, arm)), _row(contacts.lying[p, w]), world.hardness,
                world.loss, world.stiffness, world.damping, world.friction[w],
            )  # fmt: skip
            _write(contacts.lying[p, w], bristle)
            for a in range(3):
                contacts.object_world[w, a] += pushed[a]
            force, torque = plus(force, 1.0, pushed), plus(torque, 1.0, cross(arm, pushed))
    return force, torque


@kernel
def _push(pushed, at, force):
    """Add a force at a point, both in the arm's frame, to a spatial force at its origin."""
    moment = cross(at, force)
    for a in range(3):
        pushed[a] += moment[a]
        pushed[3 + a] += force[a]


@kernel
def _row(array):
    return array[0], array[1], array[2]


@kernel
def _rows(matrix):
    return _row(matrix[0]), _row(matrix[1]), _row(matrix[2])


@kernel
def _write(array, vector):
    array[0], array[1], array[2] = vector[0], vector[1], vector[2]
