"""How often the truth lies inside the reported 95 % intervals, over seeded repetitions at a reduced size.

From near the truth, so that the intervals alone are tried; `python -m studies.coverage` searches over the whole range.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import binom
from scipy.stats import t as student

from tests.support.matched_plant import FRAME, markers_of, small_model
from tests.support.noisy_trials import STAGES, TRIALS, WEIGHTS, measured, with_values
from trunkline.identification.fit.intervals import bootstrap, certainty
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.fit.search import descend
from trunkline.identification.fit.surrogate import surrogate
from trunkline.identification.simulate.experiment import prepare

REPETITIONS, FRAMES = 20, 60
STEPS = 4  # of a frame
RESAMPLINGS = 5000  # of which some five lie beyond each end of an interval


@dataclass
class Repetitions:
    """Errors of ln(value), half widths of their intervals, and bootstrap intervals around the truth.

    errors, widths: (REPETITIONS, P). resampled: (REPETITIONS, 2, P).
    """

    names: list[str]
    errors: np.ndarray
    widths: np.ndarray
    resampled: np.ndarray


@pytest.fixture(scope="module", params=STAGES)
def repetitions(request) -> Repetitions:
    stage, model = STAGES[request.param], small_model(4)
    model.opt.timestep = FRAME / STEPS
    clean = stage.trials(with_values(model, stage.true), FRAMES)
    bounds = {name: Bounds(value / 10, value * 10) for name, value in stage.true.items()}
    exact, rng = np.log(list(stage.true.values())), np.random.default_rng(1)
    errors, widths, resampled = [], [], []
    for _ in range(REPETITIONS):
        experiments = [prepare(measured(trial, rng), model, FRAMES) for trial in clean]
        problem = Problem(model, experiments, markers_of(model), bounds, "positions", WEIGHTS)
        result = descend(problem, exact + rng.normal(0, 0.02, len(exact)), 24, 1e-6, lambda best: None)
        assert result.converged
        around = surrogate(problem, result.vector, result.residuals)
        linear = linearise(problem, result.vector, result.residuals)
        errors.append(result.vector - exact)
        widths.append(certainty(linear, around=around).half_width)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("trunkline.identification.fit.intervals.RESAMPLINGS", RESAMPLINGS)
            resampled.append(bootstrap(linear, 1, around) - exact)
    return Repetitions(list(stage.true), np.array(errors), np.array(widths), np.array(resampled))


def as_often_as_it_should(inside: np.ndarray) -> np.ndarray:
    """Whether counts lie in the band that holds 99.9 % of binomial draws of 20 with 95 %: 15 to 20 of 20."""
    least, most = binom.interval(0.999, REPETITIONS, 0.95)
    return (least <= inside) & (inside <= most)


def test_the_truth_is_inside_the_intervals_about_as_often_as_it_should(repetitions):
    """Intervals that are too wide cannot be told from right ones by counts so few: the next test looks at that."""
    inside = (np.abs(repetitions.errors) < repetitions.widths).sum(axis=0)
    assert as_often_as_it_should(inside).all(), dict(zip(repetitions.names, inside, strict=True))


def test_intervals_are_as_wide_as_the_scatter(repetitions):
    promised = repetitions.widths.mean(axis=0) / student.ppf(0.975, TRIALS - 1)
    ratio = promised / np.sqrt((repetitions.errors**2).mean(axis=0))  # about the truth: a bias counts
    assert ((ratio > 0.5) & (ratio < 2)).all(), dict(zip(repetitions.names, ratio, strict=True))


def test_the_bootstrap_agrees_with_the_intervals(repetitions):
    low, high = repetitions.resampled[:, 0], repetitions.resampled[:, 1]
    inside = ((low < 0) & (high > 0)).sum(axis=0)
    assert as_often_as_it_should(inside).all(), dict(zip(repetitions.names, inside, strict=True))
    ratio = np.median((high - low) / 2 / repetitions.widths, axis=0)
    assert ((ratio > 0.75) & (ratio < 1.25)).all(), dict(zip(repetitions.names, ratio, strict=True))
