"""The models that learn from data alone learn what they can: a linear swing, and a hardening one."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from studies.anchors import coordinates, learn, terms

STEP, FRAMES = 1 / 30, 90


def swings(hardening):
    """Decays of x'' = -0.4 x' - 30 (x + hardening x³) from several heights, at a place and its opposite. (T, 2)."""
    time = STEP * np.arange(FRAMES)
    found = []
    for height in (0.3, 0.5, 0.7, 1.0):
        solved = solve_ivp(
            lambda _, y: [y[1], -0.4 * y[1] - 30 * (y[0] + hardening * y[0] ** 3)],
            (0, time[-1]), [height, 0], t_eval=time, rtol=1e-9, atol=1e-12,
        )  # fmt: skip
        found.append(np.stack([solved.y[0], 1 - solved.y[0]], axis=1))
    return found


def predicted(shown, unseen, cubic):
    rest = np.array([0.0, 1.0])
    model = learn(shown, rest, coordinates(shown, rest, 2)[:, :2], 2, cubic, 1e-8)
    return model.predict(unseen[:2], FRAMES)


@pytest.mark.parametrize(("hardening", "cubic"), [(0.0, False), (0.0, True), (0.5, True)])
def test_an_oscillator_is_predicted(hardening, cubic):
    *seen, unseen = swings(hardening)
    found = predicted([*seen[:2], unseen], seen[2], cubic)
    assert np.abs(found - seen[2]).max() < 0.02


def test_a_linear_model_does_not_predict_one_that_hardens():
    *seen, unseen = swings(0.5)
    found = predicted([*seen[:2], unseen], seen[2], cubic=False)
    assert np.abs(found - seen[2]).max() > 0.1


def test_terms_of_a_cubic():
    assert terms(np.ones((1, 4)), cubic=True).shape == (1, 4 + 10 + 20)
    np.testing.assert_array_equal(terms(np.array([[2.0, 3.0]]), cubic=True)[0], [2, 3, 4, 6, 9, 8, 12, 18, 27])
