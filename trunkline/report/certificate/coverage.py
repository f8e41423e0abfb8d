"""How often the tip is within the radius that a certificate states: poses that no trial has, on the arm itself.

Half of the pulled poses are reached from straight and half from beyond. A pose counts only if the arm rests in it; one
in which the twin finds no rest counts as not within. The share comes with Wilson's interval of 95 % (E. B. Wilson,
Probable inference, the law of succession, and statistical inference, JASA 22 (1927) 209).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from trunkline.model.statics.chain import Chain
from trunkline.report.certificate.budget import COVERAGE, Budget
from trunkline.report.certificate.poses import StaticPoses

# m of pull (N, K), gravity in the base frame, m/s² (N, 3), and whether from beyond (N,), to tips at rest (N, 3), m
Bring = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass
class Coverage:
    """Of N poses. inside: whether the tip was within the stated radius. pulled: whether a motor pulled. Shape (N,).
    unrested: of how many further ones the arm did not rest, which therefore tell nothing."""

    inside: np.ndarray
    pulled: np.ndarray
    unrested: int = 0

    def metrics(self) -> dict:
        """Shares of all poses and, apart, of those with a pull, as an arm that only hangs is nearer to its twin."""
        pulled = {"pulled": share_of(self.inside[self.pulled])} if self.pulled.any() else {}
        return share_of(self.inside) | {"stated": COVERAGE, "unrested": self.unrested} | pulled


def share_of(inside: np.ndarray) -> dict:
    """The share of `inside` (N,), N at least 1, that is true, and Wilson's interval of 95 %."""
    interval = binomtest(int(inside.sum()), len(inside)).proportion_ci(0.95, "wilson")
    return {"share": float(np.mean(inside)), "low": interval.low, "high": interval.high, "poses": len(inside)}


def from_beyond(pulled: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Which half of the poses that are pulled is reached from beyond, at random. From (N,) to (N,)."""
    back = np.zeros(len(pulled), bool)
    chosen = rng.permutation(np.flatnonzero(pulled))
    back[chosen[: len(chosen) // 2]] = True
    return back


def pulls_of(chain: Chain, poses: StaticPoses) -> np.ndarray:
    """What each motor draws in beyond the straight arm's path, m, less than 0 where it is slack. Shape (N, K)."""
    return chain.straight_lengths - poses.commands


def is_inside(tips: np.ndarray, stated: Budget) -> np.ndarray:
    """Whether tips (N, 3), m, lie within the stated radius: not where the twin does not rest. Shape (N,)."""
    off = np.linalg.norm(tips - stated.tips, axis=1)
    return np.isfinite(stated.radius) & (off <= stated.radius)


def covered(chain: Chain, poses: StaticPoses, stated: Budget, bring: Bring, rng: np.random.Generator) -> Coverage:
    """What comes of it when the arm is brought to `poses`, for which `stated` is the budget."""
    pulls = pulls_of(chain, poses)
    pulled = np.max(pulls, axis=1, initial=0.0) > 0
    tips = bring(pulls, poses.gravity, from_beyond(pulled, rng))
    rested = np.isfinite(tips).all(axis=1)
    return Coverage(is_inside(tips, stated)[rested], pulled[rested], int((~rested).sum()))
