"""Reach, live: whether a target can be reached now, and the nearest point that can, by the maps of `reachability`."""

import math
from typing import Protocol

import numpy as np

from trunkline.ar.teleop.reach_message import Reading
from trunkline.ar.teleop.signed_map import SignedMap, read, shell
from trunkline.ar.teleop.surface_reach import SheetReach
from trunkline.ar.teleop.tilt_reach import TiltReach
from trunkline.ar.teleop.vectors import DOWN, Vector, dot
from trunkline.errors import InputError

TILT = math.radians(1.0)  # by which the mount may be off straight down; the rigid map knows no other


class Reach(Protocol):
    """What tells whether targets can be reached."""

    def rigid(self, mount: Vector, pointing: Vector) -> Reading:
        """Of the mount at `mount`, m, the end effector `pointing` along a unit vector, both in the rigid base frame."""
        ...

    def soft(self, tip: Vector, gravity: Vector) -> Reading:
        """Of the tip at `tip`, m, under gravity along a unit vector, both in the soft arm's base frame."""
        ...


class MapReach:
    """The mount's by the map for an end effector straight down, "unknown" elsewhere; the tip's under gravity from any
    side, or of one tilt, as the package has it."""

    def __init__(self, rigid: SignedMap, soft: SheetReach | TiltReach) -> None:
        """
        Args:
            rigid: in the rigid base frame.
        """
        self._rigid, self._soft = rigid, soft
        self._rigid_points = shell(rigid, rigid.values)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "MapReach":
        """From what `reachability` writes into grids.npz, or `unity.unpacked.maps_of` reads from a package: `rigid` and
        its lattice; `sheets_points`, `sheets_downs`, `sheets_matrix` and `soft_tolerance` where gravity comes from any
        side, else `soft_<angle>`, `soft_angles` and their lattice.

        Raises:
            InputError: one of them is missing.
        """
        sheets = "sheets_points" in arrays
        of_soft = ("sheets_downs", "sheets_matrix", "soft_tolerance") if sheets else ("soft_angles",)
        lattices = ("rigid_origin", "rigid_spacing") + (() if sheets else ("soft_origin", "soft_spacing"))
        for key in ("rigid", *of_soft, *lattices):
            if key not in arrays:
                raise InputError(f"maps: found no {key!r}, expected what the stage reachability writes")

        def lattice(name: str, group: str) -> SignedMap:
            x, y, z = (float(value) for value in arrays[f"{group}_origin"])
            values = np.ascontiguousarray(arrays[name], dtype=np.float32)
            return SignedMap(values, (x, y, z), float(arrays[f"{group}_spacing"]))

        if sheets:
            points, (downs, matrix, tolerance) = arrays["sheets_points"], (arrays[key] for key in of_soft)
            return cls(lattice("rigid", "rigid"), SheetReach(points, downs, matrix, float(tolerance)))
        names = sorted(name for name, values in arrays.items() if name.startswith("soft_") and np.ndim(values) == 3)
        soft = TiltReach([lattice(name, "soft") for name in names], arrays["soft_angles"])
        return cls(lattice("rigid", "rigid"), soft)

    def rigid(self, mount: Vector, pointing: Vector) -> Reading:
        _require("mount", mount)
        if dot(pointing, DOWN) < math.cos(TILT):
            return Reading("unknown")
        return read(self._rigid.slope, self._rigid_points, mount)

    def soft(self, tip: Vector, gravity: Vector) -> Reading:
        _require("tip", tip)
        _require("gravity", gravity)
        return self._soft.read(tip, gravity)


def _require(name: str, point: Vector) -> None:
    """Raises InputError where it is no place."""
    x, y, z = point
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise InputError(f"{name}: found ({x:g}, {y:g}, {z:g}), expected finite numbers")
