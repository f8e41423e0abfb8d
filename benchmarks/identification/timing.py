"""Time on the clock and of all threads together."""

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass
class Spent:
    """Seconds on the clock, and of all threads together."""

    wall: float
    cpu: float

    def __add__(self, other: "Spent") -> "Spent":
        return Spent(self.wall + other.wall, self.cpu + other.cpu)

    def __str__(self) -> str:
        return f"{self.wall:.1f} s (CPU {self.cpu:.1f} s)"


class Stopwatch:
    def __init__(self):
        self._wall, self._cpu = time.perf_counter(), _cpu_time()

    def read(self) -> Spent:
        return Spent(time.perf_counter() - self._wall, _cpu_time() - self._cpu)


def _cpu_time() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def alternate(rivals: dict[str, Callable[[], int]], repeats: int) -> dict[str, Spent]:
    """Best time per step of each; every rival returns how many steps it took. One round more warms up."""
    best = {name: Spent(np.inf, np.inf) for name in rivals}
    for turn in range(repeats + 1):
        for name, run in rivals.items():
            clock = Stopwatch()
            steps = run()
            spent = clock.read()
            if turn:
                best[name].wall = min(best[name].wall, spent.wall / steps)
                best[name].cpu = min(best[name].cpu, spent.cpu / steps)
    return best
