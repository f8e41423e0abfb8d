"""When a search says that it has converged: it ended for its own reasons, and distinct starts agree with it."""

import numpy as np
import pytest

from trunkline.identification.fit.optimizers import DifferentialEvolution, LeastSquares
from trunkline.identification.fit.search import (
    AGREEING,
    Convergence,
    SearchResult,
    _apart,
    _evolve,
    _several,
    descend,
    search,
)

LOW, HIGH = np.log(0.2), np.log(20.0)
PATIENT, SHORT = 25, 1  # iterations: of a search that ends by itself, and of one whose time is up


class Valleys:
    """Stands in for a `Problem`: valleys side by side, each with a least loss of its own. Nothing leads from one to
    another; which start is tried first does not depend on how deep its valley is."""

    parameters = ("kp",)
    rubs = False

    def __init__(self, *least: float) -> None:
        self.least = np.array(least)
        self.width = (HIGH - LOW) / len(least)

    def _valley(self, vectors):
        """Numbers of the valleys of candidates (C, 1), and how far each is from the middle of its own. Each (C,)."""
        number = np.clip((vectors[:, 0] - LOW) // self.width, 0, len(self.least) - 1).astype(int)
        return number, vectors[:, 0] - (LOW + (number + 0.5) * self.width)

    def residuals(self, vectors, near=None):
        number, off = self._valley(vectors)
        return [np.column_stack([np.sqrt(2 * self.least[number]), off])]

    def losses(self, vectors, rough=False):
        number, off = self._valley(vectors)
        return (1.0 if rough else self.least[number]) + 0.5 * off**2

    def prior(self, vectors):
        return np.zeros_like(vectors)

    def bounds(self):
        return np.array([LOW]), np.array([HIGH])

    def start(self):
        return np.array([LOW + 0.4 * self.width])


def quiet(best: float) -> None:
    """No progress."""


def valleys_of(problem: Valleys, result) -> set[int]:
    """In which a search has ended, from all its starts."""
    return set(problem._valley(np.array([result.vector, *result.others]))[0].tolist())


AGREEMENTS = [
    ((2.0, 2.0, 2.0), 3, True),
    ((2.0, 2.0, 9.0), 2, True),
    ((2.0, 2.09, 9.0), 2, True),  # within 1.05 times the least
    ((2.0, 2.11, 9.0), 1, False),
    ((9.0, 5.0, 2.0), 1, False),
    ((9.0, 9.0, 2.0), 1, False),  # two agree with each other, but not with the best
]


@pytest.mark.parametrize(("least", "agreeing", "converged"), AGREEMENTS)
@pytest.mark.parametrize(
    "optimizer", [LeastSquares(12, 3, PATIENT, 1e-6), DifferentialEvolution(12, 0, 60, 1e-2)], ids=lambda o: o.method
)
def test_only_a_search_whose_starts_agree_has_converged(optimizer, least, agreeing, converged):
    problem = Valleys(*least)
    result = search(problem, optimizer, seed=3, report=quiet)
    assert valleys_of(problem, result) == {0, 1, 2}
    assert result.loss == pytest.approx(min(least))
    assert (result.agreeing, result.starts) == (agreeing, 3)
    assert result.converged is converged


@pytest.mark.parametrize(
    "optimizer", [LeastSquares(12, 3, SHORT, 1e-6), DifferentialEvolution(12, 0, SHORT, 1e-9)], ids=lambda o: o.method
)
def test_a_search_whose_time_is_up_has_not_converged_though_its_starts_agree(optimizer):
    result = search(Valleys(2.0, 2.0, 2.0), optimizer, seed=3, report=quiet)
    assert result.agreeing > 1
    assert not result.converged


@pytest.mark.parametrize(("iterations", "converged"), [(PATIENT, True), (SHORT, False)])
def test_a_search_that_goes_on_from_what_is_known_has_nothing_to_agree_with(iterations, converged):
    result = search(Valleys(2.0, 5.0, 9.0), LeastSquares(0, 1, iterations, 1e-6), seed=3, report=quiet)
    assert (result.agreeing, result.starts) == (0, 0)
    assert result.converged is converged


@pytest.mark.parametrize(
    ("iterations", "tolerance", "converged"),
    [(1, 1e-6, False), (2, 1e-12, False), (PATIENT, 1e-6, True), (PATIENT, 1e-12, True), (2, 0.9, True)],
)
def test_a_descent_has_converged_where_it_ended_before_its_iterations_did(iterations, tolerance, converged):
    """Also with the first step that gains less than is asked for."""
    problem = Valleys(2.0)
    result = descend(problem, problem.start(), iterations, tolerance, quiet)
    assert result.converged is converged


@pytest.mark.parametrize(
    ("generations", "tolerance", "converged"), [(1, 1e-9, False), (60, 1e-2, True), (3, 1e-9, False)]
)
def test_an_evolution_has_converged_where_its_losses_came_together(generations, tolerance, converged):
    optimizer = DifferentialEvolution(12, 0, generations, tolerance)
    result = _evolve(Valleys(2.0, 3.0), optimizer, np.random.default_rng(3), quiet)
    assert result.converged is converged
    assert len(result.convergence.best) <= generations


class Ranges:
    """Stands in for a `Problem` of two parameters, the range of the second ten times as wide and away from 0."""

    def bounds(self):
        return np.array([0.0, -30.0]), np.array([1.0, -20.0])


def placed(*shares: tuple[float, float]) -> np.ndarray:
    """Candidates at these shares of both ranges. Shape (C, 2)."""
    low, high = Ranges().bounds()
    return low + np.array(shares) * (high - low)


@pytest.mark.parametrize(
    ("shares", "count", "chosen"),
    [
        ([(0.5, 0.5)], 3, [0]),
        ([(0.5, 0.5), (0.5, 0.5)], 3, [0]),
        ([(0.0, 0.5), (0.15, 0.5)], 3, [0]),  # by so much is not by more
        ([(0.5, 0.5), (0.66, 0.5), (0.34, 0.5)], 3, [0, 1, 2]),
        ([(0.5, 0.5), (0.64, 0.5), (0.36, 0.5)], 3, [0]),  # in neither parameter by 0.15 of its range
        ([(0.5, 0.5), (0.64, 0.64), (0.64, 0.36)], 3, [0]),
        ([(0.5, 0.5), (0.5, 0.66), (0.5, 0.34)], 3, [0, 1, 2]),
        ([(0.1, 0.5), (0.4, 0.5), (0.5, 0.5), (0.2, 0.5)], 4, [0, 1]),  # each next from all before it
        ([(0.1, 0.5), (0.4, 0.5), (0.7, 0.5), (1.0, 0.5)], 3, [0, 1, 2]),  # as many as are asked for
        ([(0.1, 0.5), (0.4, 0.5), (0.7, 0.5)], 1, [0]),
        ([(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)], 4, [0, 1, 2, 3]),
    ],
)
def test_starts_are_distinct_that_are_apart_in_one_parameter_at_least(shares, count, chosen):
    candidates = placed(*shares)
    starts = _apart(Ranges(), candidates, count)  # type: ignore[arg-type]
    np.testing.assert_array_equal(starts, candidates[chosen])


def test_the_first_start_goes_to_its_own_minimum_and_the_others_leave_plateaus_at_once(monkeypatch):
    """The first is the best that is known; where it ends is an answer, also on a plateau."""
    hasty = []

    def ends(problem, start, iterations, tolerance, report, hurried, _):
        hasty.append(hurried)
        return [descend(problem, start, iterations, tolerance, report)]

    monkeypatch.setattr("trunkline.identification.fit.search._ends", ends)
    search(Valleys(2.0, 2.0, 2.0), LeastSquares(12, 3, PATIENT, 1e-6), seed=3, report=quiet)
    assert hasty == [False, True, True]


@pytest.mark.parametrize(
    ("ends", "agreeing"),
    [
        ([[2.0]], 1),
        ([[2.0], [2.0], [2.0]], 3),
        ([[2.0], [AGREEING * 2.0], [9.0]], 2),  # up to so much, not less
        ([[2.0], [AGREEING * 2.0 + 1e-9], [9.0]], 1),
        ([[9.0, 2.0], [5.0, 2.05], [3.0]], 2),  # where a start leads once it has left its plateaus
        ([[2.0, 9.0], [3.0, 9.0]], 1),
        ([[9.0], [5.0], [2.0, 2.0, 2.0]], 1),  # one start agrees with itself once
    ],
)
def test_of_each_start_its_best_end_agrees_or_does_not(monkeypatch, ends, agreeing):
    left = iter(ends)

    def made(*_):
        return [SearchResult(np.array([loss]), loss, Convergence(), True) for loss in next(left)]

    monkeypatch.setattr("trunkline.identification.fit.search._ends", made)
    starts = [np.zeros(1)] * len(ends)
    result = _several(Valleys(2.0), starts, PATIENT, 1e-6, quiet)  # type: ignore[arg-type]
    every = sorted(loss for each in ends for loss in each)
    assert (result.loss, result.agreeing, result.starts) == (every[0], agreeing, len(ends))
    assert [other.item() for other in result.others] == every[1:]
