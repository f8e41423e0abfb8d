"""What rollouts come to: whether an object is held, and whether one that was let go rests on its surface."""

from dataclasses import dataclass
from typing import Annotated, Protocol

import mujoco
import numpy as np
from pydantic import Field

from trunkline.ar.hybrid.objects import touched
from trunkline.ar.hybrid.rollouts import Piece

Metres = Annotated[float, Field(gt=0, le=1)]
STILL = 0.01  # m by which it may move within LAST
LAST = 0.5  # s


class Criterion(Protocol):
    """What is asked of a plan."""

    def holds(self, motion: Piece) -> np.ndarray:
        """In which futures it comes true. Shape (B,)."""
        ...


def stays(moved: np.ndarray, away: np.ndarray, away_last: np.ndarray, sag: float, slip: float) -> np.ndarray:
    """Which objects stay in the arm: what it wraps has `moved` by less than `sag` against the mount, and from `away` to
    `away_last` by less than `slip` from the nearest unit, m. Shapes (B,)."""
    return (moved < sag) & (away_last < away + slip)


@dataclass(frozen=True)
class Holding:
    """What counts as held, from the time `since`, s, when the object loses its support or is lifted, to the end.

    Attributes:
        sag: m, by which what the arm wraps of the object may move against the mount, which the arm bears: it gives way
            and swings. What is lifted must be lifted by more.
        slip: m, by which it may move away from the nearest unit.
        lifted: m, by which it must be higher then than at first.
    """

    since: float
    sag: Metres = 0.08
    slip: Metres = 0.02
    lifted: Annotated[float, Field(ge=-1, le=1)] | None = None

    def holds(self, motion: Piece) -> np.ndarray:
        """Which futures hold the object. Shape (B,)."""
        first = int(np.argmin(np.abs(motion.time - self.since)))
        beside = motion.grip - motion.mount
        with np.errstate(invalid="ignore"):
            moved = np.linalg.norm(beside[:, -1] - beside[:, first], axis=1)
            stay = stays(moved, motion.away[:, first], motion.away[:, -1], self.sag, self.slip)
            if self.lifted is not None:
                stay &= motion.grip[:, first, 2] - motion.grip[:, 0, 2] > self.lifted
        return stay & motion.sound


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
