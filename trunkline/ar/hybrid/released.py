"""What counts as let go: a thing rests on the surface on which it was meant to be."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.ar.hybrid.objects import touched
from trunkline.ar.hybrid.rollouts import Piece

STILL = 0.01  # m by which it may move within LAST
LAST = 0.5  # s


@dataclass(frozen=True)
class RestCriterion:
    """On a level board, at the end of a motion.

    Attributes:
        since: s, when the arm begins to open; from then on what rests is no higher.
        low, high: corners of the board, m. Shape (3,).
        model: of whom the motion is.
    """

    since: float
    low: np.ndarray
    high: np.ndarray
    model: mujoco.MjModel

    def holds(self, motion: Piece) -> np.ndarray:
        """Of which futures it rests there: its centre is over the board, it stands still, nothing carries it off, and
        the arm has let go of it. Shape (B,)."""
        first, late = (int(np.argmin(np.abs(motion.time - time))) for time in (self.since, motion.time[-1] - LAST))
        place = motion.object[:, :, :3]
        with np.errstate(invalid="ignore"):
            over = ((place[:, -1, :2] >= self.low[:2]) & (place[:, -1, :2] <= self.high[:2])).all(axis=1)
            height = place[:, -1, 2]
            down = (height > self.high[2]) & (height < place[:, first, 2] + STILL)
            still = np.linalg.norm(place[:, -1] - place[:, late], axis=1) < STILL
        return over & down & still & ~touched(self.model, motion.qpos[:, -1]) & motion.sound
