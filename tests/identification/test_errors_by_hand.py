"""The numbers of one trial's errors, and which of them it has."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.noisy_trials import WEIGHTS
from tests.support.swings import LIKE, STEP, STRAIGHT, experiment
from trunkline.identification.evaluation.evaluation import _mean, errors_of


def still(frames: int) -> np.ndarray:
    return np.tile(STRAIGHT, (frames, 1, 1))


def moved(positions: np.ndarray, *millimetres: float) -> np.ndarray:
    """Each marker as far across, m."""
    return positions + np.outer(millimetres, [1e-3, 0.0, 0.0])


@pytest.mark.parametrize(("tip", "error"), [(0, 1.0), (1, 2.0), (2, 6.0)])
def test_the_tip_s_error_is_of_its_own_marker(tip, error):
    row = errors_of(moved(still(5), 1, 2, 6), experiment(still(5)), replace(LIKE, tip=tip), None, None)
    assert row["e_tip_mm"] == pytest.approx(error)
    assert row["e_tip_pct"] == pytest.approx(error / 3)  # of 0.3 m
    assert row["e_position_mm"] == pytest.approx(3.0)


@pytest.mark.parametrize(("frames", "speed"), [(1, None), (2, 50.0), (7, 50.0)])
def test_the_error_of_velocity_is_of_distances_from_the_base_in_mm_a_second(frames, speed):
    """Half a millimetre a frame of 10 ms."""
    away = 1 + 5e-4 * np.arange(frames)[:, None, None] / np.linalg.norm(STRAIGHT, axis=-1)[None, :, None]
    row = errors_of(still(frames) * away, experiment(still(frames), frame_step=STEP), LIKE, None, None)
    assert row.get("e_velocity_mm_s") == (None if speed is None else pytest.approx(speed))


@pytest.mark.parametrize(
    ("loss", "weights", "kind", "step", "has"),
    [
        ("positions", WEIGHTS, "release", STEP, True),
        ("positions", WEIGHTS, "static_pull", 0.0, True),
        ("positions", WEIGHTS, "release", 0.0, False),  # frames from here and there have no order to be compared in
        (None, WEIGHTS, "release", STEP, False),
        ("positions", None, "release", STEP, False),
    ],
)
def test_a_loss_is_of_what_is_in_order_or_at_rest(loss, weights, kind, step, has):
    row = errors_of(moved(still(5), 1, 2, 6), experiment(still(5), kind=kind, frame_step=step), LIKE, loss, weights)
    assert ("loss" in row) == has


def test_the_error_of_a_period_is_its_share_along_whichever_axis_it_swings():
    """Of a period that is 5 % longer; the arm moves along one axis alone."""
    time = STEP * np.arange(250)
    slow, fast = (
        moved(still(250), 0, 0, 0) + 0.05 * np.outer(np.exp(-time) * np.cos(turn * time), [1, 0, 0])[:, None]
        for turn in (12.0 / 1.05, 12.0)
    )
    row = errors_of(slow, experiment(fast), LIKE, None, None)
    assert abs(row["e_swing_period_pct"]) == pytest.approx(5.0, abs=0.7)


def test_of_several_trials_errors_are_the_mean_over_those_that_have_them_and_the_worst():
    rows = [{"e_position_mm": 1.0, "e_tip_mm": 4.0}, {"e_position_mm": 3.0, "loss": 0.5}, {"e_position_mm": 5.0}]
    assert _mean(rows) == {
        "e_position_mm": 3.0, "e_tip_mm": 4.0, "loss": 0.5, "e_position_worst_mm": 5.0, "e_tip_worst_mm": 4.0,
        "trials": 3,
    }  # fmt: skip
    assert _mean(rows[1:]) == {"e_position_mm": 4.0, "loss": 0.5, "e_position_worst_mm": 5.0, "trials": 2}
