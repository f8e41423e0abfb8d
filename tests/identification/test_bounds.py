"""What ended on a bound, what the trials leave open, and which poses a fit has reached."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.matched_plant import markers_of, release, small_model
from trunkline.identification.fit.considered import LEVEL, half_widths
from trunkline.identification.fit.identify import BOUND_TOLERANCE, _at_bound, _factors_at_bound
from trunkline.identification.fit.intervals import ALONE, bootstrap, certainty
from trunkline.identification.fit.linearisation import Linearisation
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.results.parameter_table import undetermined
from trunkline.identification.simulate.pose_fit import PoseProblem, _descend, fit_pose

LOW, HIGH = 2.0, 4.0
MARGIN = BOUND_TOLERANCE * (HIGH - LOW)
A_LITTLE = 1e-9


@pytest.mark.parametrize(
    ("z", "at_bound"),
    [
        (LOW, True),
        (LOW + MARGIN - A_LITTLE, True),
        (LOW + MARGIN + A_LITTLE, False),
        (3.0, False),
        (HIGH - MARGIN - A_LITTLE, False),
        (HIGH - MARGIN + A_LITTLE, True),
        (HIGH, True),
        (LOW - 1, True),
        (HIGH + 1, True),
    ],
)
def test_a_parameter_is_at_a_bound_within_a_share_of_its_own_range(z, at_bound):
    """Between two others, one of them far from its wide bounds, one at the lower."""
    low, high = np.array([-100.0, LOW, 0.0]), np.array([100.0, HIGH, 1.0])
    names = _at_bound(["kp", "damping", "stiffness"], np.array([0.0, z, 0.0]), low, high)
    assert names == (["damping", "stiffness"] if at_bound else ["stiffness"])


@pytest.mark.parametrize(
    ("factor", "at_bound"),
    [
        (1.0, False),
        (1.1, True),
        (0.9, True),
        (1.0 + 0.1 * (1 - 2 * BOUND_TOLERANCE) - A_LITTLE, False),
        (1.0 + 0.1 * (1 - 2 * BOUND_TOLERANCE) + A_LITTLE, True),
        (1.0 - 0.1 * (1 - 2 * BOUND_TOLERANCE) + A_LITTLE, False),
        (1.0 - 0.1 * (1 - 2 * BOUND_TOLERANCE) - A_LITTLE, True),
    ],
)
def test_a_factor_at_a_bound_is_named_with_its_unit(factor, at_bound):
    names = _factors_at_bound({"stiffness": np.array([1.0, factor]), "damping": np.array([1.0, 1.0])}, 0.1)
    assert names == (["stiffness of unit 2"] if at_bound else [])


@pytest.mark.parametrize(
    ("half", "considered", "is_open"),
    [(0.0, 0, False), (0.999, 0, False), (1.0, 0, False), (1.001, 0, True), (np.inf, 0, True), (0.8, 0.59, False),
     (0.8, 0.61, True), (0.0, 1.01, True)],
)  # fmt: skip
def test_what_has_an_interval_wider_than_its_range_is_open(half, considered, is_open):
    """A range of 2 on the axis of the search; beside a parameter that is told. considered: half width of what is."""
    given_model = np.array([half, 1e-6])
    moves = {("mass", ""): np.array([considered / LEVEL, 0.0])} if considered else {}
    result = SimpleNamespace(
        values={"mount_tilt_x": 0.0, "mount_tilt_y": 0.0}, half_width=half_widths(given_model, moves)
    )
    scale = PARAMETERS["mount_tilt_x"].scale
    bounds = {name: Bounds(-scale, scale) for name in result.values}
    names = undetermined(result, bounds)  # type: ignore[arg-type]
    assert names == (["mount_tilt_x"] if is_open else [])


@pytest.mark.parametrize(
    ("others", "alone"), [(0.0, True), (0.9e-9, True), (1.1e-9, False), (1e-6, False), (1.0, False)]
)
def test_what_one_trial_alone_tells_has_no_interval(others, alone):
    """The other trials have a share `others` of the information on the first parameter, and half of that on the
    second."""
    first = np.sqrt([1.0, others / 2, others / 2])
    jacobians = [np.diag([share, 1.0]) for share in first]
    linear = Linearisation(np.zeros(2), [np.array([0.1, 0.1 * k]) for k in range(3)], jacobians)
    for width in (certainty(linear).half_width, np.diff(bootstrap(linear, seed=1), axis=0)[0]):
        assert np.isinf(width).tolist() == [alone, False]
    assert ALONE == 1e-9


@pytest.fixture(scope="module")
def bent():
    model = small_model(4)
    return model, release(model, 0.3, frames=1)


def test_a_pose_is_found_where_the_descent_ended_before_its_iterations_did(bent):
    """At the very number that it takes, one fewer and one more."""
    model, trial = bent
    problem = PoseProblem(model, trial.markers, trial.positions[0])
    free, start = np.ones(problem.angles, bool), np.zeros(problem.angles)
    needed = _descend(problem, start, problem.measured, free, 300)
    assert needed.converged
    assert 2 < needed.iterations < 30
    for iterations, converged in ((1, False), (needed.iterations - 1, False), (needed.iterations, False),
                                  (needed.iterations + 1, True)):  # fmt: skip
        assert _descend(problem, start, problem.measured, free, iterations).converged is converged


@pytest.mark.parametrize("hidden", [(0,), (2,), (3,), (0, 1)])
def test_a_pose_says_how_far_seen_markers_are_and_nothing_of_hidden_ones(bent, hidden):
    model, trial = bent
    positions = trial.positions[0].copy()
    positions[list(hidden)] = np.nan
    pose = fit_pose(model, markers_of(model), positions)
    assert np.flatnonzero(np.isnan(pose.residuals)).tolist() == list(hidden)
    assert np.nanmax(pose.residuals) < 1e-3
    assert pose.converged
