"""What the model lacks, from how far it is off in trials that no fit has seen.

No interval of a parameter holds it. It grows with how far the arm is bent: the tip is off by a vector d across the arm,
in both directions alike, with a variance of

    v² = s_g² g² + s_p² p²,

g how far gravity moves the tip and p how far the cables do. The scales s_g and s_p are not known; a residual r of a
trial at rest, of whose variance the other sources make u², has the likelihood of the length of such a vector,

    L = Π exp(-r² / (v² + u²)) / (v² + u²),

and with the prior 1 / (s_g s_p), which of a scale says nothing, L / (s_g s_p) is their distribution (JCGM 101, 6.4.9,
takes the same prior for a deviation). So few trials make the tip uncertain by more than their residuals show.
"""

from dataclasses import dataclass

import numpy as np

STEPS = 160  # of each scale
SMALLEST, LARGEST = 1e-4, 0.5  # of a scale: the tip off by a tenth of a thousandth or by half of its way


@dataclass
class Discrepancy:
    """scales: that were tried. Shape (STEPS,). likelihood: of each pair s_g, s_p, with the prior; sums to 1. Shape
    (STEPS, STEPS). trials: that tell of it."""

    scales: np.ndarray
    likelihood: np.ndarray
    trials: int

    @property
    def rms(self) -> np.ndarray:
        """√E[s²] of both. Shape (2,)."""
        squares = self.scales**2
        return np.sqrt([squares @ self.likelihood.sum(axis=1), squares @ self.likelihood.sum(axis=0)])

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Pairs s_g, s_p. Shape (count, 2)."""
        chosen = rng.choice(self.likelihood.size, size=count, p=self.likelihood.ravel())
        return np.stack([self.scales[index] for index in np.unravel_index(chosen, self.likelihood.shape)], axis=1)


def discrepancy(residuals: np.ndarray, ways: np.ndarray, variances: np.ndarray) -> Discrepancy:
    """Of what the residuals of N trials leave open.

    Args:
        residuals: lengths, m. Shape (N,).
        ways: g and p, m. Shape (N, 2).
        variances: of the other sources, m². Shape (N,).
    """
    scales = np.geomspace(SMALLEST, LARGEST, STEPS)
    squares = (scales[:, None] * ways[:, 0]) ** 2, (scales[:, None] * ways[:, 1]) ** 2
    total = squares[0][:, None] + squares[1][None] + np.maximum(variances, 1e-12)
    log = -(np.log(total) + residuals**2 / total).sum(axis=2)
    likelihood = np.exp(log - log.max())  # with that prior, as the scales are evenly spaced in their logarithm
    return Discrepancy(scales, likelihood / likelihood.sum(), len(residuals))
