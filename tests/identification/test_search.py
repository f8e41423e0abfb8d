"""Both optimizers and the descent, on plants that are the model."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.matched_plant import markers_of, release, small_model
from tests.support.noisy_trials import WEIGHTS, with_values
from trunkline.identification.fit.identify import _search
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.optimizers import DifferentialEvolution, LeastSquares
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.fit.search import descend, search
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.simulate.experiment import prepare

TRUE = {"damping": 0.07, "tendon_friction": 0.6}


def quiet(best: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def problem():
    model = small_model(4)
    truth = with_values(model, TRUE)
    experiments = [prepare(release(truth, bend, frames=50), model, 50) for bend in (0.3, -0.25)]
    bounds = {"damping": Bounds(0.005, 1.0), "tendon_friction": Bounds(0.02, 3.0)}
    return Problem(model, experiments, markers_of(model), bounds, "positions", WEIGHTS)


@pytest.mark.parametrize(
    ("optimizer", "tolerance"),
    [(DifferentialEvolution(6, 2, 30, 1e-3), 0.05), (LeastSquares(6, 2, 12, 1e-6), 0.02)],
    ids=lambda value: type(value).__name__,
)
def test_an_optimizer_finds_the_plant(problem, optimizer, tolerance):
    reported = []
    result = search(problem, optimizer, seed=2, report=reported.append)
    np.testing.assert_allclose(np.exp(result.vector), list(TRUE.values()), rtol=tolerance)
    assert result.loss == pytest.approx(float(problem.losses(result.vector[None])[0]), rel=1e-9)
    assert min(reported) <= 1.5 * result.loss
    again = search(problem, optimizer, seed=2, report=quiet)
    np.testing.assert_array_equal(result.vector, again.vector)


def test_least_squares_takes_the_best_of_its_starts(problem):
    """With the model far off, a start of the hypercube is better, and the descent goes on from there."""
    far = replace(problem)
    far.start = lambda: far.bounds()[1]
    single = search(far, LeastSquares(0, 1, 1, 1e-6), seed=2, report=quiet)
    several = search(far, LeastSquares(8, 1, 1, 1e-6), seed=2, report=quiet)
    assert several.loss < 0.5 * single.loss


def test_the_linearisation_where_a_descent_ends_is_that_of_central_differences(problem):
    result = descend(problem, problem.start() + [0.3, -0.2], 10, 1e-9, quiet)
    assert result.converged
    assert not descend(problem, problem.start() + [0.3, -0.2], 1, 1e-9, quiet).converged
    linear = linearise(problem, result.vector)
    step = 3e-4
    for column in range(2):
        either = np.zeros(2)
        either[column] = step
        ahead, behind = (problem.residuals((result.vector + sign * either)[None]) for sign in (1, -1))
        for jacobian, a, b in zip(linear.jacobians, ahead, behind, strict=True):
            central = (a[0] - b[0]) / (2 * step)
            np.testing.assert_allclose(jacobian[:, column], central, atol=0.01 * np.abs(central).max())
    at_end = 0.5 * sum(float(r @ r) for r in linear.residuals)
    assert at_end == pytest.approx(result.loss, rel=1e-9)
    gradient = sum(j.T @ r for j, r in zip(linear.jacobians, linear.residuals, strict=True))
    away = linearise(problem, result.vector + 0.1)
    steep = sum(j.T @ r for j, r in zip(away.jacobians, away.residuals, strict=True))
    assert np.abs(gradient).max() < 0.02 * np.abs(steep).max()


class Valley:
    """Residuals of Rosenbrock's function (1960) in place of an arm's: a valley that bends, its minimum at (1, 1).
    floor: one more residual, which nothing changes."""

    rubs, parameters = False, ("damping", "tendon_friction")

    def __init__(self, floor: float = 0.0) -> None:
        self.evaluations, self.floor = 0, floor

    def bounds(self):
        return np.full(2, -3.0), np.full(2, 3.0)

    def prior(self, vectors):
        return np.zeros_like(vectors)

    def residuals(self, vectors, near=None):
        self.evaluations += len(vectors)
        x, y = vectors.T
        return [np.stack([10 * (y - x**2), 1 - x, np.full(len(x), self.floor)], axis=1)]


@pytest.mark.parametrize("start", [(-1.2, 1.0), (2.5, -2.0), (0.9, 0.8)])
def test_a_descent_that_updates_its_jacobian_ends_where_differences_have_the_minimum(start, monkeypatch):
    updated, anew = Valley(), Valley()
    result = descend(updated, np.array(start), 200, 1e-9, quiet)
    assert result.converged
    np.testing.assert_allclose(result.vector, 1.0, atol=1e-4)
    monkeypatch.setattr("trunkline.identification.fit.search.FORESEEN", -1.0)
    np.testing.assert_allclose(descend(anew, np.array(start), 200, 1e-9, quiet).vector, 1.0, atol=1e-4)
    assert updated.evaluations <= anew.evaluations


@pytest.mark.parametrize(("start", "floor"), [((-2.426, 1.818), 3.0), ((1.98, -2.513), 1.0)])
def test_a_descent_does_not_end_where_an_updated_jacobian_gains_too_little(start, floor):
    least = 0.5 * floor**2
    assert descend(Valley(floor), np.array(start), 200, 1e-2, quiet).loss < 1.02 * least


def test_a_descent_that_updates_its_jacobian_takes_fewer_evaluations_on_an_arm(problem, monkeypatch):
    def effort():
        counted = replace(problem)
        return descend(counted, problem.start() + [0.9, -0.8], 25, 1e-6, quiet), counted.evaluations

    result, evaluations = effort()
    monkeypatch.setattr("trunkline.identification.fit.search.FORESEEN", -1.0)
    anew, more = effort()
    assert result.converged
    assert evaluations < more
    np.testing.assert_allclose(result.vector, anew.vector, atol=1e-4)


def test_differences_stay_within_the_bounds(problem):
    low, high = problem.bounds()
    vectors_tried = []
    watched = replace(problem)
    residuals = watched.residuals
    watched.residuals = lambda vectors, near=None: vectors_tried.append(vectors) or residuals(vectors)
    edge = linearise(watched, high)
    assert (np.concatenate(vectors_tried) <= high).all()
    inside = linearise(watched, high - 2e-3)
    for a, b in zip(edge.jacobians, inside.jacobians, strict=True):
        np.testing.assert_allclose(a, b, atol=0.05 * np.abs(b).max())


def test_a_problem_starts_at_the_model_s_own_values(problem):
    expected = [np.log(parameter_named(name).read(problem.model)) for name in TRUE]
    np.testing.assert_allclose(problem.start(), expected)
    hardening = replace(problem, parameters={"hardening": Bounds(0.02, 20.0)})
    assert np.exp(hardening.start()[0]) == pytest.approx(np.sqrt(0.02 * 20.0))  # it has none: mid-range


class Capped:
    """Stands in for a `Problem`: pulls that grow with a gain up to a cap, which a small gain never reaches."""

    parameters = ("kp", "force_range")
    wound = np.linspace(0.1, 1.0, 20)
    rubs = False

    def residuals(self, vectors, near=None):
        gain, cap = np.exp(vectors).T[..., None]
        fitted = np.minimum(gain * self.wound, cap) - np.minimum(2.0 * self.wound, 1.0)
        return [np.concatenate([fitted, np.full((len(vectors), 1), 0.1)], axis=1)]  # and what nothing explains

    def losses(self, vectors, rough=False):
        return 0.5 * (self.residuals(vectors)[0] ** 2).sum(axis=1)

    def prior(self, vectors):
        return np.zeros_like(vectors)

    def bounds(self):
        return np.log([0.2, 0.2]), np.log([20.0, 20.0])

    def start(self):
        return np.log([1.0, 10.0])

    def effort(self):
        return {}


@pytest.mark.parametrize(
    "optimizer",
    [
        LeastSquares(7, 2, 12, 1e-4),  # three descents all the same, and more from where a cap begins to matter
        LeastSquares(7, 3, 12, 1e-4),
        LeastSquares(0, 1, 1, 1e-4),  # ended by its limit
        DifferentialEvolution(6, 2, 30, 1e-3),
        DifferentialEvolution(6, 2, 3, 1e-9),
    ],
    ids=repr,
)
def test_a_search_never_counts_beyond_its_total_and_ends_there(optimizer, capsys, monkeypatch):
    monkeypatch.setattr("trunkline.compute.progress.PLAIN_INTERVAL", 0.0)
    _search(Capped(), optimizer, 3, "fit")
    counts = [tuple(map(int, line.split()[1].split("/"))) for line in capsys.readouterr().out.splitlines()]
    assert all(done <= total for done, total in counts)
    assert counts[-1][0] == counts[-1][1] > 0


def test_starts_on_a_plateau_leave_it_before_they_are_compared():
    problem = Capped()
    stuck = descend(problem, problem.start(), 25, 1e-4, quiet)
    assert stuck.loss > 0.1
    assert np.exp(stuck.vector[1]) == pytest.approx(10.0)  # nothing leads from there to the cap
    result = search(problem, LeastSquares(7, 3, 25, 1e-4), seed=3, report=quiet)
    np.testing.assert_allclose(np.exp(result.vector), [2.0, 1.0], rtol=1e-3)
    assert result.agreeing == result.starts == 3
    others = np.array([problem.losses(other[None])[0] for other in result.others])
    assert (others > 2 * result.loss).any()  # some start had to leave one
