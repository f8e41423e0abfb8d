"""A free rigid body: what is grasped. And the string from which it may hang."""

from typing import NamedTuple

import numpy as np

from rehearsal.robot.compiled import kernel
from trunkline.model.statics.vectors import cross, dot, plus, turned


class RigidObject(NamedTuple):
    """A body of S shapes, its frame in its centre of mass, its axes principal.

    kind (S,), half (S, 3), edge (S,): as of `shapes.Shape`. shift (S, 3): m, of their centres. turn (S, 3, 3): the
    body's frame ← theirs. mass: kg. inertia (3,): kg m².
    points (P, 3): m, with which it touches the world, balls of `radius` m.
    eye (3,): m, where the string is tied. hook (3,): m, in the world, over which its loop hangs. string: m, its length.
    tautness: N/m. loss: N s/m. lip: m by which the string must be slack to leave the hook.
    """

    kind: np.ndarray
    half: np.ndarray
    edge: np.ndarray
    shift: np.ndarray
    turn: np.ndarray
    mass: float
    inertia: np.ndarray
    points: np.ndarray
    radius: float
    eye: np.ndarray
    hook: np.ndarray
    string: float
    tautness: float
    loss: float
    lip: float


class Motion(NamedTuple):
    """Of an object. place (3,): of its centre, m. quaternion (4,): w first, world ← object. speed (3,): m/s.
    momentum (3,): angular, about its centre, N m s, in the world. hanging (1,): 1 while its string is on the hook."""

    place: np.ndarray
    quaternion: np.ndarray
    speed: np.ndarray
    momentum: np.ndarray
    hanging: np.ndarray


@kernel
def rotation(quaternion):
    """Rows of the rotation matrix of a quaternion (4,), w first."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


@kernel
def transposed(matrix):
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return (a, d, g), (b, e, h), (c, f, i)


@kernel
def spin_of(object, motion, turn):
    """Angular velocity, rad/s, in the world. turn: rows of the object's rotation."""
    local = turned(transposed(turn), (motion.momentum[0], motion.momentum[1], motion.momentum[2]))
    return turned(turn, (local[0] / object.inertia[0], local[1] / object.inertia[1], local[2] / object.inertia[2]))


@kernel
def move_object(object, motion, force, torque, gravity, h):
    """A step of h s: momenta first, so that they are kept to rounding, then the pose by the new velocities.

    The rotation goes by the angular velocity in the middle of the step, as momentum turns it: second order in h.

    Args:
        force, torque: tuples, N and N m about the centre. gravity (3,): m/s².
    """
    for a in range(3):
        motion.speed[a] += h * (force[a] / object.mass + gravity[a])
        motion.place[a] += h * motion.speed[a]
        motion.momentum[a] += h * torque[a]
    first = spin_of(object, motion, rotation(motion.quaternion))
    middle = _turned_by(motion.quaternion, first, 0.5 * h)
    spin = spin_of(object, motion, rotation(middle))
    motion.quaternion[:] = _turned_by(motion.quaternion, spin, h)


@kernel
def _turned_by(quaternion, spin, h):
    """The quaternion after turning for h s by `spin`, rad/s, in the world."""
    rate = np.sqrt(dot(spin, spin))
    share = 0.5 * h if rate * h < 1e-9 else np.sin(0.5 * rate * h) / rate
    w, (x, y, z) = np.cos(0.5 * rate * h), (share * spin[0], share * spin[1], share * spin[2])
    qw, qx, qy, qz = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    new = np.empty(4)
    new[0] = w * qw - x * qx - y * qy - z * qz
    new[1] = w * qx + x * qw + y * qz - z * qy
    new[2] = w * qy - x * qz + y * qw + z * qx
    new[3] = w * qz + x * qy - y * qx + z * qw
    return new / np.sqrt(np.sum(new * new))


@kernel
def pull_string(object, motion, turn, spin):
    """Force on the object, and its torque about the centre, of a string that only pulls. Slack, it leaves the hook."""
    if motion.hanging[0] == 0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    arm = turned(turn, (object.eye[0], object.eye[1], object.eye[2]))
    along = (
        motion.place[0] + arm[0] - object.hook[0], motion.place[1] + arm[1] - object.hook[1],
        motion.place[2] + arm[2] - object.hook[2],
    )  # fmt: skip
    length = np.sqrt(dot(along, along))
    if object.string - length > object.lip:
        motion.hanging[0] = 0
    if length <= object.string:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    velocity = plus((motion.speed[0], motion.speed[1], motion.speed[2]), 1.0, cross(spin, arm))
    rate = dot(velocity, along) / length
    tension = max(object.tautness * (length - object.string) + object.loss * rate, 0.0)
    force = (-tension * along[0] / length, -tension * along[1] / length, -tension * along[2] / length)
    return force, cross(arm, force)
