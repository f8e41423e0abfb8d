"""By how far an arm's tip rests beside its twin's, learnt from poses that were recorded.

The residual r, from the twin's tip to the measured one, is a Gaussian process of the pulls and of gravity (Rasmussen
and Williams 2006, chapters 2 and 5), its three coordinates alike and apart:

    k(x, x') = s² w(u) w(u') exp(-|u - u'|² / 2 a² - |g - g'|² / 2 b²),    w(u) = √(d² + |u|²),

u being pulls over the largest that was recorded, longer tendons counting as none, and g gravity over the standard one.
So the residual grows with the pulls, as models that were fitted to an arm at rest leave it. Poses add noise. The five
numbers are those of the largest posterior density, under log-normal priors of wide spread. Near where an arm snaps from
one shape to another, or where it had not come to rest, a pose tells nothing of its neighbours: what is missed by more
than `FAR` times the usual where it is left out has as much more noise, and the numbers are sought anew. Poses that were
recorded several times count once, with their mean.

How far off it still is, poses say that are left out one by one: `trunkline/report/certificate` makes a radius of that.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium

# s and the noise as shares of the arm's length, a, b, d: where their priors have the middle, and how far these spread
MIDDLE = np.array([0.008, 0.001, 0.5, 1.0, 0.3])
SPREAD = np.array([1.0, 0.7, 0.7, 0.7, 0.7])
FEWEST = 15  # different poses, below which there is no map
SAME_PULL, SAME_GRAVITY = 2e-3, 0.5  # m of each motor, and m/s², up to which poses are one that was repeated
TABLE = ("pulls", "gravity", "residuals", "noisier", "numbers")
FAR, USUAL, ROUNDS = 2.5, 1.538, 3  # deviations; of a vector's length its median over a coordinate's deviation
WORTH = 0.9  # of the errors without the map: poses that are left out have to be so much nearer with it


@dataclass(frozen=True)
class RestingPoses:
    """Of an arm at rest.

    pulls: straight arm's path length less the command of every motor, or less the tendon's path where that is slack, m.
    Shape (N, K). gravity: in the base frame, m/s². Shape (N, 3).
    """

    pulls: np.ndarray
    gravity: np.ndarray

    @classmethod
    def of(cls, chain: Chain, rest: Equilibrium, gravity: np.ndarray) -> "RestingPoses":
        """Those of the twin's `rest`, so that it is the same pose however far slack tendons are let out."""
        return cls.of_commands(chain, rest.commands, gravity)

    @classmethod
    def of_commands(cls, chain: Chain, commands: np.ndarray, gravity: np.ndarray) -> "RestingPoses":
        """Those of motors at `commands`, m (N, K), that let no tendon out further than its path."""
        return cls(chain.straight_lengths - commands, gravity)

    def __len__(self) -> int:
        return len(self.pulls)

    def repeats(self) -> list[np.ndarray]:
        """The rows of each pose, those that were recorded several times together."""
        left, groups = np.arange(len(self)), []
        while len(left):
            first = left[0]
            pulls = np.abs(np.maximum(self.pulls[left], 0) - np.maximum(self.pulls[first], 0)).max(axis=1, initial=0)
            apart = np.linalg.norm(self.gravity[left] - self.gravity[first], axis=1)
            same = (pulls <= SAME_PULL) & (apart <= SAME_GRAVITY)
            groups.append(left[same])
            left = left[~same]
        return groups

    def __getitem__(self, rows) -> "RestingPoses":
        return RestingPoses(self.pulls[rows], self.gravity[rows])


@dataclass(frozen=True)
class ResidualMap:
    """poses: that were recorded. residuals: theirs, m. Shape (N, 3). noisier: times that each has the noise of others.
    Shape (N,). numbers: s and the noise, m, a, b, d."""

    poses: RestingPoses
    residuals: np.ndarray
    noisier: np.ndarray
    numbers: np.ndarray

    @classmethod
    def fit(cls, poses: RestingPoses, residuals: np.ndarray, length: float) -> "ResidualMap":
        """Args: length: of the arm, m. residuals: m, in the base frame. Shape (N, 3).

        Raises:
            InputError: there are too few poses, or a residual is not finite.
        """
        if len(poses) < FEWEST:
            raise InputError(f"poses: found {len(poses)}, expected {FEWEST} or more to tell how a twin is off")
        if not np.isfinite(residuals).all():
            bad = np.flatnonzero(~np.isfinite(residuals).all(axis=1))[0]
            raise InputError(f"pose {bad}: found the residual {residuals[bad].tolist()} m, expected finite numbers")
        learnt = cls(poses, residuals, np.ones(len(poses)), MIDDLE)
        for _ in range(ROUNDS):
            learnt = learnt._likeliest(length)
            missed = np.linalg.norm(learnt.left_out(), axis=1)
            usual = max(float(np.median(missed)) / USUAL, 1e-9)
            learnt = replace(learnt, noisier=np.maximum(missed / (FAR * usual), 1.0))
        return learnt

    @classmethod
    def supposed(cls, poses: RestingPoses, residuals: np.ndarray, length: float) -> "ResidualMap":
        """Of poses too few to tell the numbers: these where the priors have their middle; arguments as of `fit`."""
        return cls(poses, residuals, np.ones(len(poses)), MIDDLE * [length, length, 1, 1, 1])

    def extended(self, poses: RestingPoses, residuals: np.ndarray) -> "ResidualMap":
        """With further poses and their residuals, m (N, 3), and the same numbers."""
        every = RestingPoses(*(np.concatenate(both) for both in (
            (self.poses.pulls, poses.pulls), (self.poses.gravity, poses.gravity),
        )))  # fmt: skip
        noisier = np.concatenate([self.noisier, np.ones(len(poses))])
        return ResidualMap(every, np.concatenate([self.residuals, residuals]), noisier, self.numbers)

    def _likeliest(self, length: float) -> "ResidualMap":
        """The same poses with the numbers of the largest posterior density. length: of the arm, m."""
        residuals, middle = self.residuals, np.log(MIDDLE * [length, length, 1, 1, 1])

        def loss(logs: np.ndarray) -> float:
            factor = cho_factor(replace(self, numbers=np.exp(logs))._noisy())
            fit = 0.5 * float(np.sum(residuals * cho_solve(factor, residuals)))
            prior = 0.5 * float(np.sum(((logs - middle) / SPREAD) ** 2))
            return fit + 3 * float(np.log(np.diag(factor[0])).sum()) + prior

        bounds = list(zip(middle - 4 * SPREAD, middle + 4 * SPREAD, strict=True))
        return replace(self, numbers=np.exp(minimize(loss, middle, method="L-BFGS-B", bounds=bounds).x))

    def mean(self, poses: RestingPoses) -> np.ndarray:
        """By how far the tip rests beside the twin's, m. Shape (M, 3)."""
        return self._weight(poses)[:, None] * (self._alike(poses) @ self.heights)

    def left_out(self) -> np.ndarray:
        """Of each pose, how far `mean` is off where all others alone are learnt from, m (Rasmussen and Williams 2006,
        5.12). Shape (N, 3)."""
        inverse = np.linalg.inv(self._noisy())
        return inverse @ self.residuals / np.diag(inverse)[:, None]

    @property
    def is_worth_it(self) -> bool:
        """Whether poses that are left out are nearer with the map than without, in the median."""
        errors = self.errors_mm()
        return errors["left_out"] <= WORTH * errors["twin"]

    def unknown(self, poses: RestingPoses) -> np.ndarray:
        """Share of a residual's variance that is left there, from 0, where poses tell all, to 1, where they tell
        nothing and the tip is the twin's. Shape (M,)."""
        weight, scale = self._weight(poses), self.numbers[0]
        across = scale**2 * weight[:, None] * self._weight(self.poses) * self._alike(poses)
        explained = np.einsum("mn,nm->m", across, np.linalg.solve(self._noisy(), across.T))
        return np.clip(1 - explained / (scale * weight) ** 2, 0, 1)

    def unknown_left_out(self) -> np.ndarray:
        """`unknown` of each pose where all others alone are learnt from. Shape (N,)."""
        noise = (self.numbers[1] * self.noisier) ** 2
        variance = 1 / np.diag(np.linalg.inv(self._noisy())) - noise
        return np.clip(variance / (self.numbers[0] * self._weight(self.poses)) ** 2, 0, 1)

    def errors_mm(self) -> dict:
        """How many poses there are, and the median of how far the tip is from the twin's, mm, as it is ("twin") and
        where all others alone are learnt from ("left_out")."""
        parts = {"twin": self.residuals, "left_out": self.left_out()}
        medians = {name: 1e3 * float(np.median(np.linalg.norm(part, axis=1))) for name, part in parts.items()}
        return {"poses": len(self.poses)} | medians

    @property
    def largest(self) -> float:
        """m, of the pulls that were recorded, which the process takes as one."""
        return max(float(self.poses.pulls.max(initial=0)), 1e-6)

    @cached_property
    def heights(self) -> np.ndarray:
        """What the exponential of each recorded pose is multiplied with, m. Shape (N, 3)."""
        explained = np.linalg.solve(self._noisy(), self.residuals)
        return self.numbers[0] ** 2 * self._weight(self.poses)[:, None] * explained

    def shares(self, poses: RestingPoses) -> np.ndarray:
        """Pulls over the largest that was recorded, longer tendons counting as none. Shape (M, K)."""
        return np.maximum(poses.pulls, 0) / self.largest

    def features(self, poses: RestingPoses) -> np.ndarray:
        """u / a and g / b. Shape (M, K + 3)."""
        _, _, pull_length, gravity_length, _ = self.numbers
        return np.concatenate(
            [self.shares(poses) / pull_length, poses.gravity / (STANDARD_GRAVITY * gravity_length)], axis=1
        )

    def table(self) -> dict:
        """As JSON has it."""
        return {
            "pulls": np.round(self.poses.pulls, 7).tolist(),
            "gravity": np.round(self.poses.gravity, 6).tolist(),
            "residuals": np.round(self.residuals, 7).tolist(),
            "noisier": np.round(self.noisier, 4).tolist(),
            "numbers": [float(f"{number:.6g}") for number in self.numbers],
        }

    @classmethod
    def from_table(cls, table: dict) -> "ResidualMap":
        """Raises: KeyError, TypeError, ValueError: it is no such table."""
        pulls, gravity, residuals, noisier, numbers = (np.array(table[name], float) for name in TABLE)
        if pulls.ndim != 2 or gravity.shape != (len(pulls), 3) or residuals.shape != gravity.shape:
            raise ValueError(f"residual map of shapes {pulls.shape}, {gravity.shape}, {residuals.shape}")
        if numbers.shape != MIDDLE.shape or not (numbers > 0).all() or not np.isfinite(numbers).all():
            raise ValueError(f"residual map with the numbers {numbers.tolist()}")
        if noisier.shape != (len(pulls),) or not (noisier >= 1).all():
            raise ValueError(f"residual map with poses noisier by {noisier.tolist()}")
        if not all(np.isfinite(part).all() for part in (pulls, gravity, residuals, noisier)):
            raise ValueError("residual map with numbers that are not finite")
        return cls(RestingPoses(pulls, gravity), residuals, noisier, numbers)

    def _noisy(self) -> np.ndarray:
        (scale, noise), weight = self.numbers[:2], self._weight(self.poses)
        return scale**2 * np.outer(weight, weight) * self._alike(self.poses) + np.diag((noise * self.noisier) ** 2)

    def _alike(self, poses: RestingPoses) -> np.ndarray:
        """The exponentials of `poses` and those that were recorded, at most 1. Shape (M, N)."""
        apart = self.features(poses)[:, None] - self.features(self.poses)
        return np.exp(-(apart**2).sum(axis=2) / 2)

    def _weight(self, poses: RestingPoses) -> np.ndarray:
        return np.sqrt(self.numbers[4] ** 2 + (self.shares(poses) ** 2).sum(axis=1))


def moved(rest: Equilibrium, chain: Chain, gravity: np.ndarray, learnt: ResidualMap | None) -> Equilibrium:
    """Where the arm has its tips that rests as its twin in N equilibria.

    Args:
        gravity: base frame, m/s². Shape (3,) or (N, 3). learnt: None where no poses tell of the arm.
    """
    if learnt is None:
        return rest
    poses = RestingPoses.of(chain, rest, np.broadcast_to(gravity, rest.position.shape))
    return replace(rest, position=rest.position + learnt.mean(poses))
