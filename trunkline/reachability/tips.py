"""Tips of the soft arm at gravity angles between the sampled ones.

A sample's tip moves smoothly with the gravity angle while its tensions stay. Tips that other angles reach with
the same tensions are read off their samples (a linear fit to the nearest in tension space), and a polynomial in
the angle through them gives the tip in between.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trunkline.threads import thread_count

NEIGHBOURS = 8  # samples that a tip at other tensions is fitted to; the fit has 4 unknowns per coordinate
NODES = 4  # angles that the polynomial goes through


@dataclass
class TipSamples:
    """Equilibria of the soft arm by gravity angle.

    ``angles`` (A,) in rad, ascending; per angle, ``tips`` (N, 3) in m in the arm's base frame and ``tensions``
    (N, K) in N.
    """

    angles: NDArray
    tips: list[NDArray]
    tensions: list[NDArray]

    def hanging(self) -> int:
        """Index of the angle nearest to 0, at which the arm hangs straight down."""
        return int(np.abs(self.angles).argmin())

    def without(self, index: int) -> "TipSamples":
        """All angles but one."""
        keep = [i for i in range(len(self.angles)) if i != index]
        return TipSamples(self.angles[keep], [self.tips[i] for i in keep], [self.tensions[i] for i in keep])


class TipInterpolator:
    """Tips at any gravity angle within the sampled ones; fits between two angles are kept for the next call."""

    def __init__(self, samples: TipSamples, scatter: float):
        """``scatter``: tips whose neighbours disagree by more than this, in m, are left out."""
        self._samples = samples
        self._scatter = scatter
        self._trees = [cKDTree(_features(t)) for t in samples.tensions]
        self._fits: dict[tuple[int, int], tuple[NDArray, NDArray]] = {}

    def tips(self, angle: float) -> NDArray:
        """Tips (N, 3) in m at ``angle`` (rad): the samples themselves where there are some."""
        angles = self._samples.angles
        exact = np.flatnonzero(np.abs(angles - angle) < 1e-6)
        if exact.size:
            return self._samples.tips[exact[0]]
        above = int(np.clip(np.searchsorted(angles, angle), 1, len(angles) - 1))
        nodes = np.sort(np.argsort(np.abs(angles - angle), kind="stable")[:NODES])
        weights = _lagrange(angles[nodes], angle)
        found = []
        for source in (above - 1, above):
            fits = [self._fit(source, int(node)) for node in nodes]
            reliable = np.logical_and.reduce([ok for _, ok in fits])
            found.append(sum(w * tips for w, (tips, _) in zip(weights, fits, strict=True))[reliable])
        return np.concatenate(found)

    def _fit(self, source: int, target: int) -> tuple[NDArray, NDArray]:
        """Tips at angle ``target`` under the tensions of the samples at ``source``, and which to trust."""
        if (source, target) not in self._fits:
            tips = self._samples.tips
            if source == target:
                fit = tips[source], np.ones(len(tips[source]), dtype=bool)
            else:
                fit = self._local_fit(_features(self._samples.tensions[source]), target)
            self._fits[source, target] = fit
        return self._fits[source, target]

    def _local_fit(self, features: NDArray, target: int) -> tuple[NDArray, NDArray]:
        tree = self._trees[target]
        distance, index = tree.query(features, k=min(NEIGHBOURS, tree.n), workers=thread_count())
        tips = self._samples.tips[target][index]  # (N, k, 3)
        weight = 1.0 / (distance**2 + 1e-4 * (distance[:, -1:] ** 2 + 1e-12))
        weight /= weight.sum(axis=1, keepdims=True)
        mean = np.einsum("nk,nkc->nc", weight, tips)
        offset = tree.data[index] - features[:, None]
        center = np.einsum("nk,nkf->nf", weight, offset)
        spread, centered = offset - center[:, None], tips - mean[:, None]
        square = np.einsum("nk,nkf,nkg->nfg", weight, spread, spread)
        ridge = 1e-3 * np.trace(square, axis1=1, axis2=2)[:, None, None] + 1e-12
        slope = np.linalg.solve(square + ridge * np.eye(square.shape[1]),
                                np.einsum("nk,nkf,nkc->nfc", weight, spread, centered))
        residual = centered - np.einsum("nkf,nfc->nkc", spread, slope)
        rms = np.sqrt(np.einsum("nk,nkc->n", weight, residual**2))
        return mean - np.einsum("nf,nfc->nc", center, slope), rms <= self._scatter


def _features(tensions: NDArray) -> NDArray:
    """Tensions on a scale on which the arm bends about evenly: it curls most while they are small."""
    return np.sqrt(np.maximum(tensions, 0.0))


def _lagrange(nodes: NDArray, at: float) -> NDArray:
    """Weights (n,) of the values at ``nodes`` (n,) in the polynomial through them, taken at ``at``."""
    return np.array([np.prod([(at - b) / (a - b) for b in nodes if b != a]) for a in nodes])
