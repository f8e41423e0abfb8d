"""The shape of a tendon-driven chain of units, whatever curve it was cut from."""

from dataclasses import dataclass

import numpy as np


@dataclass
class ChainGeometry:
    """A straight chain of units, base first, hanging along -z.

    Attributes:
        lengths: length of each unit along the arm, m. Shape (n,).
        widths: outer diameter of each unit at its proximal end, m. Shape (n,).
        joint_range: largest bend of each joint in each direction, rad. Shape (n,).
        ratio: scale from a unit to the next, α; 1 for a constant diameter.
        sections: numbers of units of an arm that is made of several sections; none for others.
    """

    lengths: np.ndarray
    widths: np.ndarray
    joint_range: np.ndarray
    ratio: float
    sections: tuple[int, ...] = ()

    @property
    def units(self) -> int:
        return len(self.lengths)

    @property
    def length(self) -> float:
        return float(self.lengths.sum())

    def unit_at(self, distance: float) -> int:
        """Number, from 0, of the unit at `distance` (m) from the mount along the straight arm; the last one's end
        belongs to it."""
        return min(int(np.searchsorted(np.cumsum(self.lengths), distance * (1 - 1e-12))), self.units - 1)
