"""What each trial does to each parameter."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from trunkline.identification.fit.surrogate import Surrogate

FEWEST = 3  # trials; with fewer there is no interval without one


@dataclass
class Influence:
    """Of T trials on P parameters.

    trials, parameters: their names.
    moves: by how much a trial moves a parameter, in half widths of the interval that the others give it: from where
        it would be without the trial to where it would be with the trial at full weight; nan where the others do not
        tell the parameter. Shape (T, P).
    weights: of the trials in the fit, 1 but for outlying ones. Shape (T,).
    losses: of the trials, unweighted, over the median. Shape (T,).
    """

    trials: list[str]
    parameters: list[str]
    moves: np.ndarray
    weights: np.ndarray
    losses: np.ndarray

    def table(self) -> dict[str, dict[str, float | None]]:
        """For parameters.json: trial → parameter → move."""
        rows = [[float(move) if np.isfinite(move) else None for move in row] for row in self.moves]
        return {
            trial: dict(zip(self.parameters, row, strict=True)) for trial, row in zip(self.trials, rows, strict=True)
        }

    def deciding(self) -> dict[str, list[str]]:
        """Trials that move a parameter by more than its interval, or are outlying, and a sentence on each."""
        sentences = {}
        for trial, row, weight, loss in zip(self.trials, self.moves, self.weights, self.losses, strict=True):
            moved = [
                f"moves {name} by {abs(move):.1f} of its half widths"
                for name, move in zip(self.parameters, row, strict=True)
                if np.isfinite(move) and abs(move) > 1
            ]
            if weight < 1:
                moved.append(f"counts {weight:.2g} as much as the others")
            if moved:
                sentences[trial] = [*moved, f"its loss is {loss:.2g} times the median"]
        return sentences


def influence(surrogate: Surrogate, trials: list[str], parameters: list[str]) -> Influence:
    """Jackknife, with the half width from the trials that are left.

    An interval of all trials is as wide as the bad one makes it, and would never be exceeded.
    """
    count, weights = len(trials), surrogate.weights
    losses = surrogate.losses(np.zeros((1, surrogate.count)))[0]
    moves = np.full((count, len(parameters)), np.nan)
    for trial in range(count):
        others = np.delete(np.arange(count), trial)
        if len(others) < FEWEST - 1:
            break
        left = np.tile(weights, (2 + len(others), 1))
        left[:, trial] = 0.0
        left[0, trial] = 1.0
        left[2 + np.arange(len(others)), others] = 0.0
        full, without, *again = surrogate.minima(left)
        spread = np.std(again, axis=0) * np.sqrt(len(others) - 1)
        half = spread * stdtrit(len(others) - 1, 0.975)
        determined = surrogate.determines(left[1]) & (half > 0)
        moves[trial, determined] = ((full - without) / np.where(half > 0, half, 1.0))[determined]
    return Influence(trials, parameters, moves, weights, losses / max(float(np.median(losses)), 1e-300))
