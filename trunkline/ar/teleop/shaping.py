"""Input shaping: a command convolved with a few impulses, so that the swing that each starts ends with the last.

For a mode of period T (damped) and damping ratio ζ, K = exp(-ζ π / √(1 - ζ²)):

    ZV:  1 / (1 + K) · [1, K]              at 0, T / 2
    ZVD: 1 / (1 + K)² · [1, 2 K, K²]       at 0, T / 2, T

ZVD also bears a period that is a little off. A shaper for several modes is the convolution of theirs.
Source: N. C. Singer, W. P. Seering, "Preshaping Command Inputs to Reduce System Vibration", ASME J. Dyn. Syst. Meas.
Control 112 (1990).
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

Kind = Literal["none", "zv", "zvd"]


@dataclass(frozen=True)
class Shaping:
    """`kind` of shaper, for the slowest `modes` swings of the arm."""

    kind: Kind
    modes: Annotated[int, Field(ge=1, le=6)]


class Shaper(NamedTuple):
    """Impulses: `times`, s, from 0 and ascending, and their `shares`, which sum to 1. Shape (n,)."""

    times: np.ndarray
    shares: np.ndarray

    @property
    def delay(self) -> float:
        """By how much later a shaped command arrives, s."""
        return float(self.times[-1])


def mode_shaper(period: float, damping: float, kind: Kind) -> Shaper:
    """For one mode: its damped `period`, s, and `damping` ratio, 0 to 1."""
    if kind == "none":
        return Shaper(np.zeros(1), np.ones(1))
    k = np.exp(-damping * np.pi / np.sqrt(1 - damping**2))
    shares = np.array([1.0, k]) if kind == "zv" else np.array([1.0, 2 * k, k * k])
    return Shaper(period / 2 * np.arange(len(shares)), shares / shares.sum())


def shaper_of(periods: np.ndarray, dampings: np.ndarray, kind: Kind) -> Shaper:
    """For several modes, (n,) each."""
    shaper = Shaper(np.zeros(1), np.ones(1))
    for period, damping in zip(periods, dampings, strict=True):
        mode = mode_shaper(period, damping, kind)
        times = np.add.outer(shaper.times, mode.times).ravel()
        order = np.argsort(times, kind="stable")
        shaper = Shaper(times[order], np.multiply.outer(shaper.shares, mode.shares).ravel()[order])
    return shaper


def shaped(rows: np.ndarray, step: float, shaper: Shaper) -> np.ndarray:
    """Rows (T, K), `step` s apart, convolved with the shaper: linear between rows, and held at their ends.

    Longer than `rows` by the shaper's delay; every value lies between the rows' least and greatest, and so do rates.
    """
    more = int(np.ceil(shaper.delay / step))
    time = step * np.arange(len(rows) + more)
    row_time = step * np.arange(len(rows))
    result = np.zeros((len(time), rows.shape[1]))
    for at, share in zip(shaper.times, shaper.shares, strict=True):
        for column in range(rows.shape[1]):
            result[:, column] += share * np.interp(time - at, row_time, rows[:, column])
    return result
