"""Whether stated probabilities are true."""

import numpy as np
import pytest

from rehearsal.experiments.calibration import base_brier, brier, stated
from rehearsal.experiments.result import Result


def runs(probability: float, successes: int, failures: int) -> list[Result]:
    outcomes = [True] * successes + [False] * failures
    return [Result("grasp", seed, won, probability=probability, agreed=float((probability >= 0.5) == won), path_pct=2.0)
            for seed, won in enumerate(outcomes)]  # fmt: skip


def test_the_base_rate_is_the_best_constant():
    outcome = np.array([1.0, 1.0, 1.0, 0.0])
    constants = np.linspace(0, 1, 101)
    scores = [brier(np.full(4, p), outcome) for p in constants]
    assert base_brier(outcome) == pytest.approx(min(scores))
    assert constants[np.argmin(scores)] == pytest.approx(0.75)
    assert brier(outcome, outcome) == 0.0


def test_true_probabilities_beat_the_base_rate():
    rng = np.random.default_rng(0)
    probability = rng.uniform(size=20_000)
    outcome = (rng.uniform(size=20_000) < probability).astype(float)
    assert brier(probability, outcome) < base_brier(outcome)
    assert brier(1 - probability, outcome) > base_brier(outcome)


def test_runs_without_a_preview_do_not_count():
    results = [*runs(0.9, 9, 1), Result("grasp", 99, False)]
    probability, outcome = stated(results)
    assert len(outcome) == 10
