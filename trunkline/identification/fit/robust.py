"""A loss that is robust over trials: one whose loss is far above the others' counts less, the further the less."""

import numpy as np

from trunkline.identification.fit.surrogate import Surrogate

COMPARED = 3  # trials of a kind, at least, to tell what is usual
SETTLED, ITERATIONS = 1e-3, 20  # of weights


def usual_losses(losses: np.ndarray, kinds: list[str], bends: np.ndarray) -> np.ndarray:
    """The loss that each trial may have, (T,): the median of its kind, and the more the farther the arm is bent.

    What a model lacks grows with the bend: a trial of twice the median one's is expected to be twice as far off. Were
    it not, the deepest trials of a good session would count least.

    Args:
        losses: (T,). bends: mean squared distance from the straight arm, m². Shape (T,).

    Returns:
        Infinite for a kind of which there are too few trials to tell. Shape (T,).
    """
    names, usual = np.array(kinds), np.full(len(kinds), np.inf)
    for kind in set(kinds):
        same_kind = names == kind
        if same_kind.sum() >= COMPARED:
            deeper = bends[same_kind] / max(float(np.median(bends[same_kind])), 1e-300)
            usual[same_kind] = np.median(losses[same_kind]) * np.maximum(deeper, 1.0)
    return usual


def trial_weights(losses: np.ndarray, usual: np.ndarray, outlying: float) -> np.ndarray:
    """w = min(1, c m / L)² of losses L (T,), with c = `outlying` and the usual losses m (T,). Shape (T,).

    A redescending M-estimate (Hampel et al. 1986), of which trials up to c m keep weight 1: the pull of a bad trial on
    the parameters vanishes as its loss grows, and a session without one is fitted as if there were no weights.
    """
    return np.minimum(1.0, outlying * usual / np.maximum(losses, 1e-300)) ** 2


def robust_loss(losses: np.ndarray, usual: np.ndarray, outlying: float) -> float:
    """Σ ρ(L / m) over losses (T,), whose derivatives are those weights: ρ(x) = x up to c, and 2c - c² / x beyond."""
    ratio = losses / usual
    return float(np.where(ratio <= outlying, ratio, 2 * outlying - outlying**2 / np.maximum(ratio, outlying)).sum())


def reweighted(
    surrogate: Surrogate, kinds: list[str], bends: np.ndarray, outlying: float
) -> tuple[np.ndarray, np.ndarray]:
    """The weights (T,) that belong to the minimum that they give, and that minimum's place (P,), by the surrogate.

    A bad trial draws the minimum to itself, where it may look no worse than the others. So one attempt begins at the
    minimum of all trials, another at the best of those without one of them: where the sum of all losses but the
    largest is least. The one with the smaller robust loss counts; what is usual is told by the latter.
    """
    trials = len(kinds)
    starts = surrogate.minima(np.concatenate([np.ones((1, trials)), 1 - np.eye(trials)]))
    losses = surrogate.losses(starts)
    best = int(np.argmin(losses.sum(axis=1) - losses.max(axis=1)))
    usual = usual_losses(losses[best], kinds, bends)
    candidates = [_settle(surrogate, starts[index], kinds, bends, outlying) for index in (0, best)]
    return min(candidates, key=lambda end: robust_loss(surrogate.losses(end[1][None])[0], usual, outlying))


def _settle(
    surrogate: Surrogate, place: np.ndarray, kinds: list[str], bends: np.ndarray, outlying: float
) -> tuple[np.ndarray, np.ndarray]:
    """Weights and minimum in turns, from a place on."""
    weights = np.zeros(len(kinds))
    for _ in range(ITERATIONS):
        losses = surrogate.losses(place[None])[0]
        before, weights = weights, trial_weights(losses, usual_losses(losses, kinds, bends), outlying)
        place = surrogate.minima(weights[None])[0]
        if np.abs(weights - before).max() < SETTLED:
            break
    return weights, place
