"""Inference of what the model lacks (`trunkline/twin/discrepancy.py`) from trials that no fit has used.

A residual r of a trial at rest, of whose variance the other sources make u², has the likelihood of the length of a
vector across the arm with variance v² = s_0² + s_g² g² + s_p² p²,

    L = Π exp(-r² / (v² + u²)) / (v² + u²),

and with the prior 1 / (s_0 s_g s_p), which assumes nothing about a scale, L / (s_0 s_g s_p) is the distribution of the
scales (JCGM 101, 6.4.9, takes the same prior for a deviation). So with few trials the tip is more uncertain than their
residuals show.

Errors have longer tails than that where an arm is near to snapping from shape to shape: `holding` widens the scales
until so many of the trials are within their own radii as are to be, one of them more counted as missed (Vovk et al.
2005, split conformal prediction).
"""

from dataclasses import replace

import numpy as np

from trunkline.twin.discrepancy import Discrepancy, lengths_of

STEPS = 50  # of each scale: neighbors differ by 19 %, and 16 trials leave a scale open by more
SMALLEST, LARGEST = 1e-4, 0.5  # of g and p: the tip off by a tenth of a thousandth or by half of its way
NEAREST, FURTHEST = 1e-5, 0.05  # m, of the constant: a tenth of what cameras resolve, or a tenth of an arm
SAMPLES = 1000  # triples that stand for the distribution


def discrepancy(residuals: np.ndarray, ways: np.ndarray, variances: np.ndarray) -> Discrepancy:
    """Of what the residuals of N trials leave open.

    Args:
        residuals: lengths, m. Shape (N,).
        ways: g and p, m. Shape (N, 2).
        variances: of the other sources, m². Shape (N,).
    """
    scale = np.geomspace(SMALLEST, LARGEST, STEPS)
    axes = np.geomspace(NEAREST, FURTHEST, STEPS), scale, scale
    log = np.zeros((STEPS, STEPS, STEPS))
    for residual, lengths, variance in zip(residuals, lengths_of(ways), np.maximum(variances, 1e-12), strict=True):
        constant, gravity, cables = ((axis * length) ** 2 for axis, length in zip(axes, lengths, strict=True))
        total = constant[:, None, None] + gravity[:, None] + cables + variance
        log -= np.log(total) + residual**2 / total
    likelihood = np.exp(log - log.max()).ravel()  # with that prior, as scales are evenly spaced in their logarithm
    places = (np.arange(SAMPLES) + 0.5) / SAMPLES
    chosen = np.searchsorted(np.cumsum(likelihood), places * likelihood.sum())
    triples = [axis[index] for axis, index in zip(axes, np.unravel_index(chosen, log.shape), strict=True)]
    return Discrepancy(np.stack(triples, axis=1), len(residuals))


def holding(inferred: Discrepancy, residuals: np.ndarray, ways: np.ndarray, coverage: float) -> Discrepancy:
    """The same with scales so wide, and no narrower than they are, that the share `coverage` of the residuals (N,), m,
    is within the radius that they give: the arguments of `discrepancy`. Of few trials, all."""
    rng = np.random.default_rng(0)
    deviations = np.sqrt(inferred.scales**2 @ (lengths_of(ways) ** 2).T)  # (S, N)
    lengths = deviations * np.sqrt(rng.standard_exponential(deviations.shape))  # across the arm
    ratios = np.sort(residuals / np.quantile(lengths, coverage, axis=0))
    rank = min(int(np.ceil((len(ratios) + 1) * coverage)), len(ratios))
    return replace(inferred, scales=inferred.scales * max(float(ratios[rank - 1]), 1.0))
