"""Reach of the tip by the maps of one tilt: grids of signed distances, linear between the gravity angles beside the
present one, as `trunkline/kinematics/reachability/reach_signal.py` defines it."""

import math

import numpy as np

from trunkline.ar.teleop.reach_message import Reading
from trunkline.ar.teleop.signed_map import SignedMap, read, shell
from trunkline.ar.teleop.vectors import Vector, add, scale
from trunkline.errors import InputError

SYMMETRY = 2 * math.pi / 3  # three tendons alike: the maps turned by it are the maps
STRAIGHT_DOWN = math.radians(1.0)  # gravity angle below which gravity has no azimuth
AZIMUTH = math.radians(5.0)  # by which gravity may be out of a tendon's plane


class TiltReach:
    """What no map tells is "unknown": gravity that is not in the plane of a tendon, or beyond the last angle."""

    def __init__(self, maps: list[SignedMap], angles: np.ndarray) -> None:
        """
        Args:
            maps: in the soft arm's base frame, on one lattice, at gravity `angles`, rad, ascending.
        """
        if len(maps) != len(angles) or len(maps) < 2 or (np.diff(angles) <= 0).any():
            raise InputError(f"soft maps: found {len(maps)} maps at angles {list(angles)}, expected as many, ascending")
        self._maps, self._angles = maps, [float(angle) for angle in angles]
        self._points = [
            shell(low, np.maximum(low.values, high.values)) for low, high in zip(maps, maps[1:], strict=False)
        ]

    def read(self, tip: Vector, gravity: Vector) -> Reading:
        """As `reach.Reach.soft`."""
        level = math.hypot(gravity[0], gravity[1])
        angle = math.atan2(level, -gravity[2])
        turn = 0.0
        if angle > STRAIGHT_DOWN:
            azimuth = math.atan2(gravity[1], gravity[0])
            turn = SYMMETRY * round(azimuth / SYMMETRY)
            # The nearer the axis, the less its direction says: what counts is how far gravity is out of the plane.
            if level * abs(math.sin(azimuth - turn)) > math.sin(AZIMUTH):
                return Reading("unknown")
        if angle > self._angles[-1]:
            return Reading("unknown")
        upper = next((i for i in range(1, len(self._angles) - 1) if angle <= self._angles[i]), len(self._angles) - 1)
        low, high = self._maps[upper - 1], self._maps[upper]
        share = (angle - self._angles[upper - 1]) / (self._angles[upper] - self._angles[upper - 1])
        share = min(max(share, 0.0), 1.0)

        def signal(point: Vector) -> tuple[float, Vector]:
            (below, down), (above, up) = low.slope(point), high.slope(point)
            return below + share * (above - below), add(scale(down, 1 - share), scale(up, share))

        reading = read(signal, self._points[upper - 1], _about_z(tip, -turn))
        return reading if reading.offer is None else reading._replace(offer=_about_z(reading.offer, turn))


def _about_z(point: Vector, angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return c * point[0] - s * point[1], s * point[0] + c * point[1], point[2]
