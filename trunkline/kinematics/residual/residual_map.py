"""By how far an arm's tip rests beside its twin's, learnt from poses that were recorded.

The residual r, from the twin's tip to the measured one, is a Gaussian process of the pulls and of gravity (Rasmussen
and Williams 2006, chapters 2 and 5), its three coordinates alike and apart:

    k(x, x') = s² w(u) w(u') exp(-|u - u'|² / 2 a² - |g - g'|² / 2 b²),    w(u) = √(d² + |u|²),

u being pulls over the largest that was recorded, letting out counting as none, and g gravity over the standard one. So
the residual grows with the pulls, as models that were fitted to an arm at rest leave it. Cameras add noise.
The five numbers are those of the largest posterior density, under log-normal priors of wide spread.

A radius that holds the tip with a probability is the process's own deviation, stretched by how far poses were off that
were left out one by one: the least factor that is large enough for that share of them, one of them more counted as
missed (split conformal prediction, Vovk et al. 2005). It holds for poses that are drawn as those were.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY

# s and the noise as shares of the arm's length, a, b, d: where their priors have the middle, and how far these spread
MIDDLE = np.array([0.008, 0.001, 0.5, 1.0, 0.3])
SPREAD = np.array([1.0, 0.7, 0.7, 0.7, 0.7])
FEWEST = 15  # poses, below which there is no map
WORTH = 0.9  # of the errors without the map: poses that are left out have to be so much nearer with it


@dataclass(frozen=True)
class RestingPoses:
    """Of an arm at rest.

    pulls: of every motor from the straight arm, m. Shape (N, K). gravity: in the base frame, m/s². Shape (N, 3).
    """

    pulls: np.ndarray
    gravity: np.ndarray

    def __len__(self) -> int:
        return len(self.pulls)

    def __getitem__(self, rows) -> "RestingPoses":
        return RestingPoses(self.pulls[rows], self.gravity[rows])


@dataclass(frozen=True)
class ResidualMap:
    """poses: that were recorded. residuals: theirs, m. Shape (N, 3). numbers: s and the noise, m, a, b, d."""

    poses: RestingPoses
    residuals: np.ndarray
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
        middle = np.log(MIDDLE * [length, length, 1, 1, 1])

        def loss(logs: np.ndarray) -> float:
            factor = cho_factor(cls(poses, residuals, np.exp(logs))._noisy())
            fit = 0.5 * float(np.sum(residuals * cho_solve(factor, residuals)))
            prior = 0.5 * float(np.sum(((logs - middle) / SPREAD) ** 2))
            return fit + 3 * float(np.log(np.diag(factor[0])).sum()) + prior

        bounds = list(zip(middle - 4 * SPREAD, middle + 4 * SPREAD, strict=True))
        return cls(poses, residuals, np.exp(minimize(loss, middle, method="L-BFGS-B", bounds=bounds).x))

    def mean(self, poses: RestingPoses) -> np.ndarray:
        """By how far the tip rests beside the twin's, m. Shape (M, 3)."""
        return self._covariance(poses) @ np.linalg.solve(self._noisy(), self.residuals)

    def radius(self, poses: RestingPoses, share: float) -> np.ndarray:
        """Within which of the twin's tip, moved by `mean`, the tip rests with the probability `share`, m. Shape (M,).

        Raises:
            InputError: so few poses state no such probability.
        """
        errors, deviations = self.left_out()
        rank = int(np.ceil((len(errors) + 1) * share))
        if rank > len(errors):
            least = int(np.ceil(share / (1 - share)))
            raise InputError(f"poses: found {len(errors)}, expected {least} or more to state {100 * share:g} %")
        factor = np.sort(np.linalg.norm(errors, axis=1) / deviations)[rank - 1]
        return factor * self._deviation(poses)

    def left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Of each pose, from all others alone: how far `mean` is off, m (N, 3), and the deviation of a coordinate, m
        (N,) (Rasmussen and Williams 2006, 5.12)."""
        inverse = np.linalg.inv(self._noisy())
        precision = np.diag(inverse)
        return inverse @ self.residuals / precision[:, None], 1 / np.sqrt(precision)

    @property
    def is_worth_it(self) -> bool:
        """Whether poses that are left out are nearer with the map than without, in the root mean square."""
        errors, _ = self.left_out()
        return float(np.sqrt(np.mean(errors**2))) <= WORTH * float(np.sqrt(np.mean(self.residuals**2)))

    def _deviation(self, poses: RestingPoses) -> np.ndarray:
        """Of a coordinate of a measured residual, m. Shape (M,)."""
        across = self._covariance(poses)
        weight = self._weight(poses)
        scale, noise = self.numbers[:2]
        explained = np.einsum("mn,nm->m", across, np.linalg.solve(self._noisy(), across.T))
        return np.sqrt(np.maximum(scale**2 * weight**2 - explained, 0) + noise**2)

    def _noisy(self) -> np.ndarray:
        return self._covariance(self.poses) + self.numbers[1] ** 2 * np.eye(len(self.poses))

    def _covariance(self, poses: RestingPoses) -> np.ndarray:
        """Of residuals at `poses` with those that were recorded, m². Shape (M, N)."""
        scale, _, pull_length, gravity_length, _ = self.numbers
        squares = _squares(self._shares(poses), self._shares(self.poses)) / pull_length**2
        squares += _squares(poses.gravity, self.poses.gravity) / (STANDARD_GRAVITY * gravity_length) ** 2
        return scale**2 * self._weight(poses)[:, None] * self._weight(self.poses) * np.exp(-squares / 2)

    def _weight(self, poses: RestingPoses) -> np.ndarray:
        return np.sqrt(self.numbers[4] ** 2 + (self._shares(poses) ** 2).sum(axis=1))

    def _shares(self, poses: RestingPoses) -> np.ndarray:
        largest = max(float(self.poses.pulls.max(initial=0)), 1e-6)  # m
        return np.maximum(poses.pulls, 0) / largest


def _squares(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Squared distances of rows. (M, D) and (N, D) to (M, N)."""
    return ((a[:, None] - b[None]) ** 2).sum(axis=2)
