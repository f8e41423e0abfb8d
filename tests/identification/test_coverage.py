"""How often the truth lies inside the reported 95 % intervals, over seeded repetitions at a reduced size.

Noise is the laboratory's, as the filter stage leaves it: 0.3 mm white per axis and 0.3°, positions low-passed at 20 Hz,
static tilts averaged over their frames. Without the low-pass, steps from frame to frame are noisy, and the velocity
term, which is relative to the measured step, then favours too much damping by 1 %, with an interval of 1 %.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation
from scipy.stats import binom
from scipy.stats import t as student

from tests.support.matched_plant import FRAME, curl, release, segments_of, small_model, tilt
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.identification.certainty import bootstrap, certainty
from trunkline.identification.experiment import prepare
from trunkline.identification.loss import LossWeights
from trunkline.identification.parameters import candidate_fields, set_fields
from trunkline.identification.problem import Bounds, Problem
from trunkline.identification.search import descend
from trunkline.identification.surrogate import surrogate
from trunkline.trials.trial import Trial

REPETITIONS, TRIALS, FRAMES = 20, 6, 60
NOISE = 0.3e-3, np.radians(0.3)  # m and rad, per axis
LOW_PASS = butter(4, 20.0, fs=1 / FRAME, output="sos")
MARGIN = 30  # frames, beyond which the low-pass's ends are not felt
WEIGHTS = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.03)


@dataclass
class Stage:
    """True values, and noise-free trials of a model that has them."""

    true: dict[str, float]
    trials: Callable[[mujoco.MjModel], list[Trial]]


def tilts(truth: mujoco.MjModel) -> list[Trial]:
    return [tilt(truth, angle) for angle in np.linspace(20, 90, TRIALS)]


def releases(truth: mujoco.MjModel) -> list[Trial]:
    bends = np.linspace(0.15, 0.35, TRIALS) * np.resize([1, -1], TRIALS)
    return [release(truth, bend, frames=FRAMES) for bend in bends]


def curls(truth: mujoco.MjModel) -> list[Trial]:
    """From gentle ones to some that reach the force range: the last four of six."""
    levels = np.linspace(20, 60, TRIALS)
    return [curl(truth, level, frames=FRAMES, tendon=index % 3) for index, level in enumerate(levels)]


STAGES = {
    "stiffness": Stage({"stiffness": 2.0, "hardening": 1.5}, tilts),
    "damping": Stage({"damping": 0.07, "tendon_friction": 0.5, "friction_time": 0.03}, releases),
    "control": Stage({"kp": 600.0, "kv": 25.0, "force_range": 1.6, "time_constant": 0.05}, curls),
}


def measured(trial: Trial, rng: np.random.Generator) -> Trial:
    """A noise-free trial as motion capture and filter see it."""
    moving, segments, _ = trial.positions.shape
    frames = FRAMES if moving == 1 else moving
    noise = rng.normal(0, NOISE[0], (frames + 2 * MARGIN, segments, 3))
    noise = sosfiltfilt(LOW_PASS, noise, axis=0)[MARGIN:-MARGIN]
    turns = rng.normal(0, NOISE[1], (frames, segments, 3))
    if moving == 1:
        noise, turns = noise.mean(axis=0, keepdims=True), turns.mean(axis=0, keepdims=True)
    turned = rotation_from_wxyz(trial.quaternions.reshape(-1, 4)) * Rotation.from_rotvec(turns.reshape(-1, 3))
    quaternions = wxyz_from_rotation(turned).reshape(trial.quaternions.shape)
    return replace(trial, positions=trial.positions + noise, quaternions=quaternions)


@dataclass
class Repetitions:
    """Errors of ln(value), half widths of their intervals, and bootstrap intervals around the truth.

    errors, widths: (REPETITIONS, P). resampled: (REPETITIONS, 2, P).
    """

    names: list[str]
    errors: np.ndarray
    widths: np.ndarray
    resampled: np.ndarray


# a stage's repetitions take a minute: its tests go to one worker, so that they run once
ONCE = [pytest.param(name, marks=pytest.mark.xdist_group(f"coverage {name}")) for name in STAGES]


@pytest.fixture(scope="module", params=ONCE)
def repetitions(request) -> Repetitions:
    stage, model = STAGES[request.param], small_model(4)
    truth = model.__copy__()
    set_fields(truth, candidate_fields(model, {name: np.array([value]) for name, value in stage.true.items()}))
    clean = stage.trials(truth)
    bounds = {name: Bounds(value / 10, value * 10) for name, value in stage.true.items()}
    exact, rng = np.log(list(stage.true.values())), np.random.default_rng(1)
    errors, widths, resampled = [], [], []
    for _ in range(REPETITIONS):
        experiments = [prepare(measured(trial, rng), model, FRAMES) for trial in clean]
        problem = Problem(model, experiments, segments_of(model), bounds, "positions", WEIGHTS)
        found = descend(problem, exact + rng.normal(0, 0.02, len(exact)), 12, 1e-6, lambda best: None)
        assert found.converged
        moves = surrogate(problem, found.vector).moves
        errors.append(found.vector - exact)
        widths.append(certainty(found.linear, moves=moves).half_width)
        resampled.append(bootstrap(found.linear, 1, moves) - exact)
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
