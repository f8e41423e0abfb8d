"""Bending-plane alignment: the wrist turns so that the tip target lies in a plane in which the arm bends.

The arm bends in half-planes about its axis, at angles α_k from tendon 1: dorsal (one cable) at 0, ventral (the two
others together) at π. With φ the azimuth of the tip target about the axis and ψ_0 the heading that the arm would have
with the wrist as it is, half-plane k asks the wrist to turn by

    Δ_k = wrap(φ - α_k - ψ_0) + 2 π n,    q_7 - Δ_k within the limits of joint 7,

and the one of least |Δ_k| is taken. The one in use stays until another needs less by the hysteresis.
"""

import math
from typing import NamedTuple

from trunkline.ar.teleop.settings import BendingPlane
from trunkline.ar.teleop.vectors import (
    DOWN,
    IDENTITY,
    Quaternion,
    Vector,
    about,
    add,
    conjugate,
    least_rotation,
    multiply,
    rotate,
    scale,
    subtract,
    wrapped,
)
from trunkline.kinematics.panda.kinematics import DH_A, DH_ALPHA, DH_D, FLANGE, Q_MAX, Q_MIN

X: Vector = (1.0, 0.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
_A, _D, _ALPHA = (tuple(map(float, values)) for values in (DH_A, DH_D, DH_ALPHA))
WRIST = (float(Q_MIN[6]), float(Q_MAX[6]))  # rad


class Wrist(NamedTuple):
    """The mount as the joints hold it: `position` (m) and `pointing` in the base frame, `heading` and joint `angle`
    (rad)."""

    position: Vector
    pointing: Vector
    heading: float
    angle: float


class Aligned(NamedTuple):
    """`heading` (rad) that brings the target into half-plane number `half_plane`, and by which the wrist is `turned`
    for it; None where no half-plane is within the wrist's limits."""

    heading: float
    half_plane: int
    turned: float | None


def base_quaternion(pointing: Vector, heading: float) -> Quaternion:
    """Of the soft arm's base frame in the rigid base's: -z along `pointing`, turned about z by `heading` from the
    frame that the least rotation brings there from straight down."""
    return multiply(least_rotation(DOWN, pointing), about(Z, heading))


def flange_turn() -> Quaternion:
    """Of the soft arm's base frame in the flange's: half a turn about x, as the arm hangs from the flange along its
    z."""
    return about(X, math.pi)


def wrist_of(joints: tuple[float, ...], mount_offset: float) -> Wrist:
    """Forward kinematics of one pose, as `trunkline.kinematics.panda.kinematics` has it for many."""
    position, turn = (0.0, 0.0, 0.0), IDENTITY
    for a, d, alpha, q in zip(_A, _D, _ALPHA, joints, strict=True):
        position = add(position, rotate(turn, (a, 0.0, 0.0)))
        turn = multiply(turn, about(X, alpha))
        position = add(position, rotate(turn, (0.0, 0.0, d)))
        turn = multiply(turn, about(Z, q))
    pointing = rotate(turn, Z)
    position = add(position, scale(pointing, FLANGE + mount_offset))
    return Wrist(position, pointing, heading_of(pointing, multiply(turn, flange_turn())), joints[6])


def heading_of(pointing: Vector, base: Quaternion) -> float:
    """The heading of a soft arm whose base frame is turned by `base`, rad."""
    if pointing[2] > 1 - 1e-9:  # straight up: any least rotation would do
        return 0.0
    x = rotate(conjugate(least_rotation(DOWN, pointing)), rotate(base, X))
    return math.atan2(x[1], x[0])


def align(tip: Vector, mount: Vector, pointing: Vector, wrist: Wrist, last: Aligned, settings: BendingPlane) -> Aligned:
    """The heading for a tip target `tip` when the mount is at `mount` (both in m, rigid base frame).

    Joint 1 is taken to carry the wrist around the base to the new mount, which turns the arm with it; what joints 2 to
    6 do to the heading besides, the plan's inverse kinematics settles.
    """
    away = rotate(conjugate(least_rotation(DOWN, pointing)), subtract(tip, mount))
    if math.hypot(away[0], away[1]) < settings.axis:
        return last
    present = carried_heading(mount, wrist)
    azimuth = math.atan2(away[1], away[0])
    turn_options = [least_turn(wrapped(azimuth - angle - present), wrist.angle) for angle in settings.half_planes]
    turns = {half_plane: turn for half_plane, turn in enumerate(turn_options) if turn is not None}
    if not turns:
        return Aligned(last.heading, last.half_plane, None)
    best = min(turns, key=lambda half_plane: abs(turns[half_plane]))
    if last.half_plane in turns and abs(turns[last.half_plane]) <= abs(turns[best]) + settings.hysteresis:
        best = last.half_plane
    return Aligned(wrapped(azimuth - settings.half_planes[best]), best, turns[best])


def carried_heading(mount: Vector, wrist: Wrist) -> float:
    """The heading, rad, that the arm has when joint 1 has carried the wrist around the base to the mount at `mount`."""
    carried = math.atan2(mount[1], mount[0]) - math.atan2(wrist.position[1], wrist.position[0])
    return wrapped(wrist.heading + carried)


def least_turn(turn: float, angle: float) -> float | None:
    """`turn`, or whole turns more or less, the least for which joint 7 at `angle` stays within its limits; all in rad.

    The soft arm's z is opposite to the flange's, so joint 7 turns the other way than the heading.
    """
    able = [t for t in (turn, turn - 2 * math.pi, turn + 2 * math.pi) if WRIST[0] <= angle - t <= WRIST[1]]
    return min(able, key=abs, default=None)
