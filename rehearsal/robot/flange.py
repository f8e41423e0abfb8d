"""The Panda as it moves the arm: joints that follow commands, and how the arm's base moves with them.

Each joint is a servo of second order, q̈ = ω² (u - q) - 2 ζ ω q̇, that keeps the joint's limits of acceleration and
velocity and stops at its ends. What the arm and its load do to the joints is not felt.
"""

from typing import NamedTuple

import numpy as np

from rehearsal.robot.compiled import kernel
from trunkline.kinematics.panda.kinematics import DH_A, DH_ALPHA, DH_D
from trunkline.model.statics.vectors import cross, plus

COS, SIN = np.round(np.cos(DH_ALPHA), 15), np.round(np.sin(DH_ALPHA), 15)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NOWHERE = (0.0, 0.0, 0.0)


class Servos(NamedTuple):
    """frequency: ω, rad/s. ratio: ζ. lowest, highest (7,): rad. velocity, acceleration (7,): limits, rad/s, rad/s²."""

    frequency: float
    ratio: float
    lowest: np.ndarray
    highest: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class Mount(NamedTuple):
    """The arm's frame in the Panda's frame 7. turn (3, 3): columns are the arm's axes. place (3,): m."""

    turn: np.ndarray
    place: np.ndarray


@kernel
def accelerate_joints(servos, joints, target, h):
    """Set the accelerations joints[2] (7,) that hold for the next h s. joints (3, 7): rad, rad/s, rad/s²."""
    w = servos.frequency
    for j in range(len(target)):
        q, v = joints[0, j], joints[1, j]
        a = w * w * (target[j] - q) - 2 * servos.ratio * w * v
        a = min(max(a, -servos.acceleration[j]), servos.acceleration[j])
        faster = min(max(v + h * a, -servos.velocity[j]), servos.velocity[j])
        if (q + h * faster > servos.highest[j] and faster > 0) or (q + h * faster < servos.lowest[j] and faster < 0):
            faster = 0.0
        joints[2, j] = (faster - v) / h


@kernel
def move_joints(joints, h):
    """Angles and velocities after h s."""
    for j in range(joints.shape[1]):
        joints[1, j] += h * joints[2, j]
        joints[0, j] += h * joints[1, j]


@kernel
def carry(mount, joints):
    """How the arm's frame lies and moves in the Panda's base frame.

    Returns:
        turn: rows of the rotation, Panda's base frame ← arm's frame. place: m. spin, speed: of the arm's frame, rad/s
            and m/s. spinning, speeding: their rates, rad/s² and m/s². All in the Panda's base frame.
    """
    x, y, z = IDENTITY
    place, spin, speed, spinning, speeding = NOWHERE, NOWHERE, NOWHERE, NOWHERE, NOWHERE
    for j in range(joints.shape[1]):
        c, s = COS[j], SIN[j]
        y, z = plus((c * y[0], c * y[1], c * y[2]), s, z), plus((c * z[0], c * z[1], c * z[2]), -s, y)
        offset = plus((DH_A[j] * x[0], DH_A[j] * x[1], DH_A[j] * x[2]), DH_D[j], z)
        place, speed, speeding = _at(offset, place, spin, speed, spinning, speeding)
        q, v, a = joints[0, j], joints[1, j], joints[2, j]
        spinning = plus(plus(spinning, a, z), v, cross(spin, z))
        spin = plus(spin, v, z)
        c, s = np.cos(q), np.sin(q)
        x, y = plus((c * x[0], c * x[1], c * x[2]), s, y), plus((c * y[0], c * y[1], c * y[2]), -s, x)
    offset = _sum3(mount.place, x, y, z)
    place, speed, speeding = _at(offset, place, spin, speed, spinning, speeding)
    t = mount.turn
    a, b, d = _sum3(t[:, 0], x, y, z), _sum3(t[:, 1], x, y, z), _sum3(t[:, 2], x, y, z)
    turn = ((a[0], b[0], d[0]), (a[1], b[1], d[1]), (a[2], b[2], d[2]))
    return turn, place, spin, speed, spinning, speeding


@kernel
def _at(offset, place, spin, speed, spinning, speeding):
    """Place, velocity and acceleration of a point of a body, `offset` from one whose are given."""
    turning = cross(spin, offset)
    speeding = plus(plus(speeding, 1.0, cross(spinning, offset)), 1.0, cross(spin, turning))
    return plus(place, 1.0, offset), plus(speed, 1.0, turning), speeding


@kernel
def _sum3(weights, x, y, z):
    return plus(plus((weights[0] * x[0], weights[0] * x[1], weights[0] * x[2]), weights[1], y), weights[2], z)
