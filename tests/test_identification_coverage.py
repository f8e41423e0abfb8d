"""How often the truth lies inside the reported 95 % intervals, over seeded repetitions at a reduced size.

Noise is the laboratory's, as the filter stage leaves it: 0.3 mm white per axis and 0.3°, positions low-passed at 20 Hz.
Without the low-pass, steps from frame to frame are noisy, and the velocity term, which is relative to the measured
step, then favours too much damping by 1 %, with an interval of 1 %.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation
from scipy.stats import binom
from scipy.stats import t as student

from tests.matched_plant import FRAME, release, segments_of, small_model
from trunkline.arm.parameters import candidate_fields, set_fields
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.identification.certainty import certainty
from trunkline.identification.experiment import prepare
from trunkline.identification.loss import LossWeights
from trunkline.identification.problem import Bounds, Problem
from trunkline.identification.search import descend, linearise

REPETITIONS, TRIALS, FRAMES = 20, 6, 40
TRUE = {"damping": 0.07, "tendon_friction": 0.5, "friction_time": 0.03}
NOISE = 0.3e-3, np.radians(0.3)  # m and rad, per axis
LOW_PASS = butter(4, 20.0, fs=1 / FRAME, output="sos")
MARGIN = 30  # frames, beyond which the low-pass's ends are not felt


def measured(trial, rng: np.random.Generator):
    """A noise-free trial as motion capture and filter see it."""
    frames, segments, _ = trial.positions.shape
    noise = sosfiltfilt(LOW_PASS, rng.normal(0, NOISE[0], (frames + 2 * MARGIN, segments, 3)), axis=0)[MARGIN:-MARGIN]
    turned = rotation_from_wxyz(trial.quaternions.reshape(-1, 4)) * Rotation.from_rotvec(
        rng.normal(0, NOISE[1], (frames * segments, 3))
    )
    quaternions = wxyz_from_rotation(turned).reshape(trial.quaternions.shape)
    return replace(trial, positions=trial.positions + noise, quaternions=quaternions)


@pytest.fixture(scope="module")
def repetitions():
    """Errors of ln(value) and half widths of their intervals. Each (REPETITIONS, P)."""
    model = small_model(4)
    truth = model.__copy__()
    set_fields(truth, candidate_fields(model, {name: np.array([value]) for name, value in TRUE.items()}))
    bends = np.linspace(0.15, 0.35, TRIALS) * np.resize([1, -1], TRIALS)
    clean = [release(truth, bend, frames=FRAMES) for bend in bends]
    bounds = {name: Bounds(value / 10, value * 10) for name, value in TRUE.items()}
    weights = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.01)
    exact, rng = np.log(list(TRUE.values())), np.random.default_rng(1)
    errors, widths = [], []
    for _ in range(REPETITIONS):
        experiments = [prepare(measured(trial, rng), model, FRAMES) for trial in clean]
        problem = Problem(model, experiments, segments_of(model), bounds, "positions", weights)
        found = descend(problem, exact + rng.normal(0, 0.05, len(exact)), 10, 1e-6, lambda best: None)
        assert found.converged
        errors.append(found.vector - exact)
        widths.append(certainty(linearise(problem, found.vector)).half_width)
    return np.array(errors), np.array(widths)


def test_the_truth_is_inside_the_intervals_about_as_often_as_it_should(repetitions):
    """Each parameter's count in the band that holds 99.9 % of binomial draws of 20 with 95 %: 15 to 20 of 20.

    Intervals that are too wide cannot be told from right ones by counts so few: the next test looks at their width.
    """
    errors, widths = repetitions
    least, most = binom.interval(0.999, REPETITIONS, 0.95)
    inside = (np.abs(errors) < widths).sum(axis=0)
    assert ((least <= inside) & (inside <= most)).all(), dict(zip(TRUE, inside, strict=True))


def test_intervals_are_as_wide_as_the_scatter(repetitions):
    errors, widths = repetitions
    promised = widths.mean(axis=0) / student.ppf(0.975, TRIALS - 1)
    ratio = promised / np.sqrt((errors**2).mean(axis=0))  # about the truth: a bias counts
    assert ((ratio > 0.5) & (ratio < 2)).all(), dict(zip(TRUE, ratio, strict=True))
