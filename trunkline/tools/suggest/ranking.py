"""Which trials to record, one after the other: each the best once those before it are recorded.

The expected loss is Φ = Σ tr(W C) over the stages, with C = (known + Σ M)⁻¹: a linear criterion (L-optimality;
A-optimality where W is a multiple of the identity; V- or I-optimality where it is that of predictions). The sequence is
greedy, an exact design grown point by point.
"""

from dataclasses import dataclass

import numpy as np

from trunkline.tools.suggest.candidates import Candidate
from trunkline.tools.suggest.information import StageInformation


@dataclass
class Suggestion:
    """candidate: what to record. before, after: the expected loss Φ without and with it, after those suggested before.
    chosen: the names of those, and its own."""

    candidate: Candidate
    before: float
    after: float
    chosen: list[str]

    @property
    def gain(self) -> float:
        """Share of the expected loss' root that it takes away."""
        return 1 - float(np.sqrt(self.after / self.before)) if self.before > 0 else 0.0


def expected_loss(stages: list[StageInformation], weights: list[np.ndarray], chosen: list[str]) -> float:
    """Φ once `chosen` are recorded."""
    losses = (np.trace(w @ stage.covariance(chosen)) for stage, w in zip(stages, weights, strict=True))
    return float(sum(losses))


def after_each(
    stages: list[StageInformation], weights: list[np.ndarray], offered: list[Candidate], chosen: list[str]
) -> np.ndarray:
    """Φ once `chosen` and one of the candidates `offered` are recorded. Shape (C,)."""
    total = np.zeros(len(offered))
    for stage, weight in zip(stages, weights, strict=True):
        information = np.linalg.inv(stage.covariance(chosen))
        nothing = np.zeros_like(information)
        matrices = information + np.stack([stage.added.get(candidate.name, nothing) for candidate in offered])
        total += np.einsum("ij,cji->c", weight, np.linalg.inv(matrices))
    return total


def suggest(
    stages: list[StageInformation], weights: list[np.ndarray], offered: list[Candidate], count: int,
    per_minute: bool = False,
) -> list[Suggestion]:  # fmt: skip
    """Up to `count` of the candidates `offered`, fewer where none shrinks the loss any more; no one twice.

    Args:
        per_minute: whether the best is what gains the most a minute, not a trial.
    """
    suggestions: list[Suggestion] = []
    chosen: list[str] = []
    before = expected_loss(stages, weights, chosen)
    left = [candidate for candidate in offered if any(candidate.name in stage.added for stage in stages)]
    while left and len(suggestions) < count:
        after = after_each(stages, weights, left, chosen)
        minutes = np.array([candidate.minutes for candidate in left]) if per_minute else 1.0
        best = int(np.argmax((np.sqrt(before) - np.sqrt(after)) / minutes))
        if after[best] >= before * (1 - 1e-9):
            break
        candidate = left.pop(best)
        chosen = [*chosen, candidate.name]
        suggestions.append(Suggestion(candidate, before, float(after[best]), chosen))
        before = float(after[best])
    return suggestions
