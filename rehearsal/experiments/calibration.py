"""Whether stated probabilities are true: the Brier score beside that of always saying the base rate.

    B = mean (p - y)²,    B_base = mean (ȳ - y)² = ȳ (1 - ȳ),

p the stated probability, y 1 for a success, else 0 (G. W. Brier, "Verification of forecasts expressed in terms of
probability", Monthly Weather Review 78 (1950) 1-3). A preview that says more than the base rate has the smaller B.
"""

import numpy as np

from rehearsal.experiments.result import Result


def stated(results: list[Result]) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities and outcomes of the runs that have one. Shape (n,) each."""
    probable = [result for result in results if np.isfinite(result.probability)]
    outcomes = [float(result.success) for result in probable]
    return np.array([result.probability for result in probable]), np.array(outcomes)


def brier(probability: np.ndarray, outcome: np.ndarray) -> float:
    """Of n probabilities and outcomes, 0 or 1."""
    return float(np.mean((probability - outcome) ** 2))


def base_brier(outcome: np.ndarray) -> float:
    """Of always saying the share of successes."""
    return float(np.mean(outcome) * (1 - np.mean(outcome)))
