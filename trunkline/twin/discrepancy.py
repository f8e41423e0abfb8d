"""What the model lacks of the tip at rest: how large it may be, and draws of it.

No interval of a parameter holds it. The tip is off by a vector d across the arm, in both directions alike, with a
variance of

    v² = s_0² + s_g² g² + s_p² p²,

g how far gravity moves the tip and p how far the cables do. The constant s_0 is there because a model is off also
where its tip hardly moves: the rest shape, the place of the mount, the first millimetres of a pull. The three scales
are not known exactly; `trunkline/report/certificate/discrepancy.py` infers them from held-out trials.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Discrepancy:
    """scales: s_0, m, s_g and s_p, triples that are equally likely. Shape (S, 3). trials: they are inferred from."""

    scales: np.ndarray
    trials: int

    @property
    def rms(self) -> np.ndarray:
        """√E[s²] of each. Shape (3,)."""
        return np.sqrt(np.mean(self.scales**2, axis=0))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Triples s_0, s_g, s_p. Shape (count, 3)."""
        return self.scales[rng.integers(len(self.scales), size=count)]

    def deviation(self, ways: np.ndarray) -> np.ndarray:
        """Root mean square length of d, m, from g and p, m, of shape (N, 2). Shape (N,)."""
        return np.sqrt(lengths_of(ways) ** 2 @ self.rms**2)

    def offsets(self, ways: np.ndarray, arms: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draws of d, m, across the lines from the mount to the tips. Shape (count, N, 3).

        Args:
            ways: g and p, m. Shape (N, 2). arms: from the mount to the tip. Shape (N, 3).
        """
        scales = self.draw(count, rng)
        deviation = np.sqrt(scales**2 @ (lengths_of(ways) ** 2).T / 2)  # of each of both directions
        across = np.linalg.svd(np.nan_to_num(arms)[:, None, :])[2][:, 1:]  # (N, 2, 3); a twin without rest has no arm
        normal = rng.standard_normal((count, len(ways), 2))
        return deviation[..., None] * np.einsum("dnk,nkx->dnx", normal, across)


def lengths_of(ways: np.ndarray) -> np.ndarray:
    """What each scale multiplies: 1, g and p. From (N, 2) to (N, 3)."""
    return np.column_stack([np.ones(len(ways)), ways])
