"""By how far a robot's tip at rest is elsewhere than the twin's, beside what the arm's parameters leave open."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.twin.discrepancy import Discrepancy


@dataclass(frozen=True)
class BaseAlignment:
    """How well the frame in which the tip is seen is aligned with the robot's base, root mean square: `shift` of the
    base's origin, m, and `turn_deg` about it, in any direction."""

    shift: Annotated[float, Field(ge=0, le=1)]
    turn_deg: Annotated[float, Field(ge=0, le=100)]

    def draw(self, draws: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Shifts, m, and rotation vectors, rad. Each (draws, 3)."""
        shift, turn = rng.standard_normal((2, draws, 3)) / np.sqrt(3)
        return self.shift * shift, np.radians(self.turn_deg) * turn


@dataclass(frozen=True)
class Hanging:
    """Where the straight arm was seen to hang, as the twin leans by that: `tip` in the base frame (3,), m, which then
    had its origin at `mount` (3,), m, and was turned by `rotation` (3, 3)."""

    tip: np.ndarray
    mount: np.ndarray
    rotation: np.ndarray

    def lean_errors(self, shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Rotation vectors in the base frame, rad, by which the twin leans too far where the frame in which the tip was
        seen is shifted and turned so. Shapes (draws, 3)."""
        off = (shift + np.cross(turn, self.mount + self.rotation @ self.tip)) @ self.rotation
        return np.cross(self.tip, off) / (self.tip @ self.tip)


@dataclass(frozen=True)
class TipShift:
    """By how far the tip of the arm rests beside the twin's at `times` (n,), s: `shifts` (n, 3), world, m."""

    times: np.ndarray
    shifts: np.ndarray

    def at(self, time: np.ndarray) -> np.ndarray:
        """At `time` (F,), s, linear in between, the ends held, m. Shape (F, 3)."""
        return np.stack([np.interp(time, self.times, axis) for axis in self.shifts.T], axis=1)


@dataclass(frozen=True)
class TipUnknown:
    """Of a tip of which nobody knows by how far it may be elsewhere: the `reason` why. shift: as of `TipUncertainty`,
    as plans are made with it there too."""

    reason: str
    shift: TipShift | None = None


@dataclass(frozen=True)
class TipUncertainty:
    """Of a tip at rest, where futures alone do not say it.

    Attributes:
        discrepancy: what the model lacks.
        ways: how far gravity and cables move the tip, m. Shape (2,).
        friction: half the band in which friction can hold the tip, world, m; 0 where futures rub. Shape (3,).
        alignment: of the frame in which it is shown.
        rotation: of the arm's base frame in the world. Shape (3, 3).
        hanging: None where nobody has seen that.
        shift: by how far the tip rests beside the twin's along the plan, None where no poses of the arm tell.
        unknown: share of the variance that these poses do not tell of, 1 without.
        left: what is lacking where they tell all, None without.
    """

    discrepancy: Discrepancy
    ways: np.ndarray
    friction: np.ndarray
    alignment: BaseAlignment
    rotation: np.ndarray
    hanging: Hanging | None = None
    shift: TipShift | None = None
    unknown: float = 1.0
    left: Discrepancy | None = None

    def offsets(self, mount: np.ndarray, tip: np.ndarray, draws: int, rng: np.random.Generator) -> np.ndarray:
        """Of a tip at `tip` (3,) from a mount at `mount` (3,), world, m. Shape (draws, 3), m."""
        twin, mapped, pose = np.sqrt(self.unknown), np.sqrt(1 - self.unknown), (self.ways[None], (tip - mount)[None])
        lacking = twin * self.discrepancy.offsets(*pose, draws, rng)[:, 0]
        rubbing = twin * rng.uniform(-1, 1, (draws, 1)) * self.friction
        if self.left is not None:
            lacking = lacking + mapped * self.left.offsets(*pose, draws, np.random.default_rng(draws))[:, 0]
        shift, turn = self.alignment.draw(draws, rng)
        shown = shift + np.cross(turn, tip)
        if self.hanging is not None:
            lean = self.hanging.lean_errors(shift, turn)
            shown = shown - np.cross(lean, (tip - mount) @ self.rotation) @ self.rotation.T
        return lacking + rubbing + shown
