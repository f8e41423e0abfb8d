"""Intervals against linear models whose answer is known, and where the data say nothing."""

import json

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from tests.identification.test_recovery import identified
from tests.support.matched_plant import curl, small_model
from trunkline.identification.fit.intervals import bootstrap, certainty, weakest_in_words
from trunkline.identification.fit.linearisation import Linearisation
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.results.parameter_table import parameter_table, undetermined
from trunkline.pipeline.stage import write_json

SHARED, OWN = 0.6, 0.3  # standard deviations of what a cluster's residuals have in common, and of each


def straight_line(clusters: int, rows: int = 5) -> tuple[Linearisation, np.ndarray, np.ndarray]:
    """A line fitted to points in clusters: it, and the exact errors (2,) with and without regard to clusters."""
    rng = np.random.default_rng(4)
    designs = np.stack([rng.uniform(-1, 1, (clusters, 1)).repeat(rows, 1), np.ones((clusters, rows))], axis=2)
    noise = rng.normal(0, SHARED, (clusters, 1)) + rng.normal(0, OWN, (clusters, rows))
    design = designs.reshape(-1, 2)
    estimate = np.linalg.lstsq(design, -noise.ravel(), rcond=None)[0]  # of residuals design @ z + noise
    linear = Linearisation(estimate, list(designs @ estimate + noise), list(designs))
    inverse = np.linalg.inv(design.T @ design)
    omega = SHARED**2 * np.ones((rows, rows)) + OWN**2 * np.eye(rows)
    clustered = inverse @ sum(d.T @ omega @ d for d in designs) @ inverse
    return linear, np.sqrt(np.diag(clustered)), np.sqrt(np.diag(inverse) * (SHARED**2 + OWN**2))


def test_clustered_errors_are_the_exact_ones():
    linear, exact, naive = straight_line(clusters=600)
    assert (exact > 1.9 * naive).all()  # else the test could not tell the two apart
    result = certainty(linear)
    np.testing.assert_allclose(result.standard_error, exact, rtol=0.08)  # ± 1/√(2·600) is one standard deviation
    np.testing.assert_allclose(result.half_width, 1.964 * result.standard_error, rtol=1e-3)  # t of 599 degrees


def test_errors_are_those_of_fits_without_each_trial():
    linear, *_ = straight_line(clusters=7)
    designs, target = np.stack(linear.jacobians), np.stack(linear.jacobians) @ linear.vector - linear.residuals
    fits = []
    for left_out in range(7):
        others = [t for t in range(7) if t != left_out]
        fits.append(np.linalg.lstsq(designs[others].reshape(-1, 2), target[others].ravel(), rcond=None)[0])
    expected = np.sqrt(6 / 7 * ((fits - np.mean(fits, axis=0)) ** 2).sum(axis=0))
    result = certainty(linear)
    np.testing.assert_allclose(result.standard_error, expected, rtol=1e-9)
    columns = designs.reshape(-1, 2)
    assert result.condition == pytest.approx(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)))


def test_few_trials_that_tell_unequally_much_do_not_promise_too_much():
    """Six trials, of which the last holds most of the information: a plain sandwich finds 0.77 of the scatter."""
    rng = np.random.default_rng(3)
    design = np.repeat([0.3, 0.4, 0.5, 0.6, 0.8, 1.5], 4).reshape(6, 4, 1)
    estimates, errors = [], []
    for _ in range(400):
        noise = rng.normal(0, SHARED, (6, 1)) + rng.normal(0, OWN, (6, 4))
        estimate = -(design[..., 0] * noise).sum() / (design**2).sum()
        result = certainty(Linearisation(np.array([estimate]), list(design[..., 0] * estimate + noise), list(design)))
        estimates.append(estimate)
        errors.append(result.standard_error[0])
    assert 0.85 < np.mean(errors) / np.std(estimates) < 1.4


def test_the_bootstrap_agrees_with_the_exact_errors():
    linear, exact, _ = straight_line(clusters=600)
    low, high = bootstrap(linear, seed=1)
    np.testing.assert_allclose((high - low) / 2, 1.96 * exact, rtol=0.1)
    np.testing.assert_allclose((high + low) / 2, linear.vector, atol=0.15 * exact.max())


@pytest.mark.parametrize("trials", [6, 12])
def test_the_bootstrap_of_equal_designs_is_students_interval_of_a_mean(trials):
    """Trials of the same Jacobian, each with an estimate of its own; of six, plain percentiles reach 0.65 as far."""
    steps = norm.ppf((np.arange(trials) + 0.5) / trials)
    linear = Linearisation(np.array([3.0]), [-steps[[t]] for t in range(trials)], [np.ones((1, 1))] * trials)
    low, high = bootstrap(linear, seed=1)
    expected = student.ppf(0.975, trials - 1) * steps.std(ddof=1) / np.sqrt(trials)
    assert (high - low) / 2 == pytest.approx(expected, rel=0.05)
    assert (high + low) / 2 == pytest.approx(3.0, abs=0.05 * expected)


def test_the_weakest_direction_is_named():
    assert weakest_in_words(["a", "b", "c"], np.array([0.7, -0.7, 0.1])) == "a and b trade off"
    assert weakest_in_words(["a", "b"], np.array([0.05, 0.99])) == "b is determined least"


def test_a_force_range_that_no_pull_reaches_is_undetermined():
    model = small_model(4)
    names = ("kp", "force_range")
    bounds = {name: Bounds(0.8 * PARAMETERS[name].read(model), 2 * PARAMETERS[name].read(model)) for name in names}
    trials = [curl(model, level, frames=60, noise=3e-4, seed=k, tendon=k) for k, level in enumerate((4, 6, 8))]
    result = identified(trials, model, bounds, optimizer=LeastSquares(0, 1, 4, 1e-3))
    assert result.certainty.standard_error[1] == result.certainty.half_width[1] == np.inf
    assert undetermined(result, bounds) == ["force_range"]
    rows = parameter_table(result, bounds)["parameters"]
    limits = [bounds["force_range"].low, bounds["force_range"].high]
    assert rows["force_range"]["undetermined"]
    assert rows["force_range"]["interval_95_given_model"] == pytest.approx(limits)
    assert rows["force_range"]["bootstrap_95_given_model"] == pytest.approx(limits)
    low, high = rows["kp"]["interval_95_given_model"]
    assert bounds["kp"].low < low < rows["kp"]["value"] < high < bounds["kp"].high


def test_factors_that_one_trial_alone_determines_have_no_width(tmp_path):
    model = small_model(3)
    stiffness = PARAMETERS["stiffness"].read(model)
    bounds = {"stiffness": Bounds(0.5 * stiffness, 2 * stiffness)}
    result = identified([curl(model, 6, frames=5)], model, bounds, ("stiffness",), LeastSquares(0, 1, 1, 1.0))
    write_json(tmp_path / "parameters.json", parameter_table(result, bounds))
    table = json.loads((tmp_path / "parameters.json").read_text())
    assert table["per_joint"]["stiffness"]["half_width_95_given_model"] == [None] * 3
    assert table["parameters"]["stiffness"]["undetermined"]


def test_a_prior_holds_what_the_trials_do_not_tell_and_says_how_little_that_is():
    """Two factors, one told by six trials, one by none: that one stays at 1, known to the prior's deviation."""
    rng = np.random.default_rng(2)
    designs = [np.array([[1.0, 0.0], [0.8, 0.0]]) for _ in range(6)]
    residuals = [rng.normal(0, 1e-3, 2) for _ in range(6)]
    weights = np.array([0.05, 0.05])
    result = certainty(Linearisation(np.ones(2), residuals, designs, weights), prior_deviation=0.04)
    assert result.standard_error[1] == pytest.approx(0.04)
    assert result.standard_error[0] < 0.002
