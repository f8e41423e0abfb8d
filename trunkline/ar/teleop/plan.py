"""A plan: what all ten axes do from when to when, and the digest that names it and nothing else."""

import hashlib
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CorrectionBounds:
    """By how much a plan may correct itself once it has arrived. target: of the tip, m, in the base frame. steps: at
    most. longest: m, by which all commands together may change in a step, and `steps` times that in all. astray: m from
    the target, beyond which the tip ends it."""

    target: tuple[float, float, float]
    steps: int
    longest: float
    astray: float


@dataclass(frozen=True)
class Plan:
    """Rows every `step` s: `joints` (T, 7), rad, and the motors' `commands` (T, K), m.

    `phases`: name and number of the first row of each. `package`, `world`: digests of those for which it was made.
    `correction`: of what comes after its end; None where it stays as it arrives.
    """

    step: float
    joints: np.ndarray
    commands: np.ndarray
    phases: tuple[tuple[str, int], ...]
    package: str
    world: str
    correction: CorrectionBounds | None = None

    @property
    def duration(self) -> float:
        """s."""
        return self.step * (len(self.joints) - 1)

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Joints (7,) and commands (K,) at `time`, s, linear between rows; the ends are held."""
        place = min(max(time / self.step, 0.0), len(self.joints) - 1.0)
        row = min(int(place), max(len(self.joints) - 2, 0))
        after, share = min(row + 1, len(self.joints) - 1), place - row
        return tuple((1 - share) * rows[row] + share * rows[after] for rows in (self.joints, self.commands))  # type: ignore[return-value]

    def digest(self) -> str:
        """SHA-256 of everything in it, in hexadecimal digits: another bit, another digest."""
        digest = hashlib.sha256()
        for rows in (self.joints, self.commands):
            digest.update(repr(rows.shape).encode() + np.ascontiguousarray(rows, dtype="<f8").tobytes())
        corrects = () if self.correction is None else (self.correction,)
        digest.update(repr((self.step, self.phases, self.package, self.world, *corrects)).encode())
        return digest.hexdigest()
