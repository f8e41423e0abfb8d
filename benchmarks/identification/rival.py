"""A rival at work: what it tried, how good that was, and when."""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.identification.timing import Spent, Stopwatch


@dataclass
class Rival:
    """Its candidates' losses and when each was known; stops it at a target or out of time."""

    target: float = 0.0
    budget: float = np.inf
    best: float = np.inf
    vector: np.ndarray | None = None
    evaluations: int = 0
    history: list[tuple[float, Spent]] = field(default_factory=list)
    clock: Stopwatch = field(default_factory=Stopwatch)

    class Stop(Exception):
        """Reached the target, or ran out of time."""

    def note(self, vectors: np.ndarray, losses: np.ndarray) -> None:
        self.evaluations += len(losses)
        index = int(np.argmin(losses))
        spent = self.clock.read()
        if losses[index] < self.best:
            self.best, self.vector = float(losses[index]), vectors[index].copy()
            self.history.append((self.best, spent))
        if self.best <= self.target or spent.wall > self.budget:
            raise Rival.Stop

    def reached(self, loss: float) -> Spent | None:
        """When it first had a candidate of at most this loss."""
        return next((spent for best, spent in self.history if best <= loss), None)
