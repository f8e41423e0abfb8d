"""Losses and error measures against values worked out by hand."""

import numpy as np
import pytest

from trunkline.identification.simulate.loss import (
    LossWeights,
    distance_residuals,
    huber,
    internal_error,
    loss_of,
    position_error,
    position_residuals,
    velocity_error,
)

WEIGHTS = LossWeights(0.1, 0.5, 0.0, 0.01, 2.0, 3.0)


def straight(distance: list[list[float]]) -> np.ndarray:
    """Markers on -z at these distances (T, S) → (T, S, 3)."""
    return np.stack([np.zeros_like(distance), np.zeros_like(distance), -np.array(distance)], axis=-1)


def test_huber_is_quadratic_then_linear_and_smooth_where_they_meet():
    assert huber(np.array(0.1), 0.5) == pytest.approx(0.005)
    assert huber(np.array(-2.0), 0.5) == pytest.approx(0.5 * (2.0 - 0.25))
    assert huber(np.array(0.5 + 1e-9), 0.5) == pytest.approx(float(huber(np.array(0.5 - 1e-9), 0.5)), abs=1e-8)


def test_static_distance_loss_by_hand():
    real, simulated = straight([[0.1, 0.2]]), straight([[0.105, 0.26]])
    everything = np.ones((1, 2), bool)
    # relative errors 0.05 and 0.3, δ = 0.1: ½ 0.05² = 0.00125 and 0.1 (0.3 - 0.05) = 0.025
    expected = 2.0 * (0.00125 + 0.025) / 2
    residuals = distance_residuals(simulated[None], real, everything, WEIGHTS)
    assert loss_of(residuals)[0] == pytest.approx(expected)


def test_moving_distance_loss_by_hand():
    real, simulated = straight([[0.1], [0.2]]), straight([[0.1], [0.21]])
    everything = np.ones((2, 1), bool)
    # position: 0 and 0.05 → ½ 0.05²; velocity: 0 in frame 1, then 0.01 / (0.1 + 0.01); means over 2 frames
    velocity = 0.5 * (0.01 / 0.11) ** 2
    expected = 2.0 * (0.5 * 0.05**2) / 2 + 3.0 * velocity / 2
    residuals = distance_residuals(simulated[None], real, everything, WEIGHTS)
    assert loss_of(residuals)[0] == pytest.approx(expected)


def test_position_loss_sees_a_swing_that_distances_do_not():
    real = np.array([[[0.03, 0.0, -0.4]]])
    simulated = real * [-1, 1, 1]
    whole = np.ones((1, 1), bool)
    assert loss_of(distance_residuals(simulated[None], real, whole, WEIGHTS))[0] == pytest.approx(0, abs=1e-20)
    relative = 0.06 / np.hypot(0.03, 0.4)  # beyond δ = 0.1
    expected = 2.0 * 0.1 * (relative - 0.05)
    assert loss_of(position_residuals(simulated[None], real, whole, WEIGHTS))[0] == pytest.approx(expected)


def test_moving_position_loss_by_hand():
    real = np.array([[[0.0, 0.0, -1.0]], [[0.03, 0.0, -1.0]], [[0.03, 0.04, -1.0]]])
    simulated = real + [[[0, 0, 0]], [[0, 0, 0]], [[0.009, 0, 0]]]
    position = 0.5 * (0.009 / np.sqrt(0.03**2 + 0.04**2 + 1)) ** 2
    velocity = 0.5 * (0.009 / (np.sqrt((0.03**2 + 0.04**2) / 2) + 0.01)) ** 2  # relative to the mean square step
    residuals = position_residuals(simulated[None], real, np.ones((3, 1), bool), WEIGHTS)
    assert loss_of(residuals)[0] == pytest.approx((2.0 * position + 3.0 * velocity) / 3)


@pytest.mark.parametrize("residuals", [distance_residuals, position_residuals])
def test_what_was_not_measured_does_not_count(residuals):
    rng = np.random.default_rng(1)
    real = rng.normal(0, 0.1, (5, 3, 3))
    simulated = real + rng.normal(0, 0.01, (2, 5, 3, 3))
    measured = np.ones((5, 3), bool)
    measured[2, 1] = measured[4] = False
    before = loss_of(residuals(simulated, real, measured, WEIGHTS))
    simulated[:, 2, 1] += 1.0
    simulated[:, 4] -= 1.0
    real[2, 1] -= 0.5
    real[4] += 0.3
    np.testing.assert_allclose(loss_of(residuals(simulated, real, measured, WEIGHTS)), before)


def test_error_measures_by_hand():
    real, simulated = straight([[0.1, 0.2], [0.1, 0.3]]), straight([[0.11, 0.2], [0.08, 0.3]])
    everything = np.ones((2, 2), bool)
    assert internal_error(simulated, real, everything) == pytest.approx((0.01 + 0.02) / 4)
    assert position_error(simulated + [0, 0.01, 0], simulated, everything) == pytest.approx(0.01)
    assert velocity_error(simulated, real, everything, 120.0) == pytest.approx(0.03 * 120 / 2)
