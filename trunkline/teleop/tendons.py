"""The tendons' commands for a tip target in the arm's bending plane, by the network.

The network wants a whole tip pose, the user gives a position: of an arm that only bends, the one says the other. In the
plane the tip's orientation is a turn by the bend about the base's y. The network is asked for the target at many bends,
and the one for which it foresees the tip nearest to the target is taken; the tip may pass the target by some mm.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from trunkline.errors import InputError
from trunkline.teleop.reach import SYMMETRY
from trunkline.teleop.vectors import Vector

Ask = Callable[[np.ndarray], dict[str, np.ndarray]]  # as `trunkline.ik.ask.ask`, of one network
BENDS = np.radians(np.arange(-330.0, 331.0, 2.0))  # of the tip about the base's y; a spiral curls further than a turn
AZIMUTH = math.radians(5.0)  # by which gravity may be out of a tendon's plane; the network knows no other
STRAIGHT_DOWN = math.radians(1.0)  # gravity angle below which gravity has no azimuth


class Bent(NamedTuple):
    """`commands` of the motors (K,), m, and where the network foresees the `tip`, m, in the base frame."""

    commands: np.ndarray
    tip: np.ndarray


def bend(ask: Ask, tip: Vector, gravity: Vector, tolerance: float) -> Bent:
    """Commands that bring the tip to `tip`, m, within `tolerance` m, under `gravity` (unit vector), all in the base
    frame.

    Raises:
        InputError: no bend comes so near, or gravity comes from a side that the network does not know.
    """
    level = math.hypot(gravity[0], gravity[1])
    angle, turns = math.atan2(level, -gravity[2]), 0
    if angle > STRAIGHT_DOWN:
        azimuth = math.atan2(gravity[1], gravity[0])
        turns = round(azimuth / SYMMETRY)
        off = level * abs(math.sin(azimuth - turns * SYMMETRY))
        if off > math.sin(AZIMUTH):
            degrees = math.degrees(azimuth - turns * SYMMETRY)
            raise InputError(f"gravity: comes {degrees:.0f}° beside a tendon's plane, which the package does not know")
    cos, sin = math.cos(-turns * SYMMETRY), math.sin(-turns * SYMMETRY)
    target = np.array([cos * tip[0] - sin * tip[1], sin * tip[0] + cos * tip[1], tip[2]])
    # The plane of the target, which is the base's x-z plane but for the symmetry above.
    plane = math.atan2(target[1], target[0])
    poses = np.zeros((len(BENDS), 8))
    poses[:, 0], poses[:, 1:4] = angle, target
    poses[:, 4], poses[:, 5:7] = np.cos(BENDS / 2), np.outer(np.sin(BENDS / 2), [-math.sin(plane), math.cos(plane)])
    answer = ask(poses)
    missed = np.linalg.norm(answer["tip"] - target, axis=1)
    best = int(np.argmin(missed))
    if missed[best] > tolerance:
        nearest = f"{1e3 * missed[best]:.0f} mm"
        raise InputError(f"out of reach: the soft arm's tip comes no nearer to its target than {nearest}")
    x, y, z = (float(value) for value in answer["tip"][best])
    foreseen = np.array([cos * x + sin * y, -sin * x + cos * y, z])
    # A tendon that stands where another one did does what that one did.
    return Bent(np.roll(answer["commands"][best].astype(float), turns), foreseen)
