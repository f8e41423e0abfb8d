"""Whether a tip rests, as cameras see it: samples at 100 Hz with their noise."""

import numpy as np
import pytest

from trunkline.ar.correction.rest import WINDOW, RestWatch

RATE, NOISE = 100.0, 0.3e-3  # Hz; m


def rests(way, seconds=4.0, hidden=lambda time: False) -> float | None:
    """s at which the tip, at `way(time)` m along x, is first seen at rest."""
    watch, rng = RestWatch(), np.random.default_rng(0)
    for time in np.arange(0.0, seconds, 1 / RATE):
        tip = np.array([way(time), 0.2, -0.3]) + NOISE * rng.standard_normal(3)
        tip[1] = np.nan if hidden(time) else tip[1]
        if watch.observe(1000.0 + time, tip):
            np.testing.assert_allclose(watch.tip, [way(time - WINDOW / 2), 0.2, -0.3], atol=0.3e-3)
            return time
    return None


def test_a_tip_that_does_not_move_rests_once_it_was_looked_at_for_long_enough():
    assert rests(lambda time: 0.1) == pytest.approx(WINDOW, abs=0.15)


@pytest.mark.parametrize("swing", [1e-3, 20e-3])
def test_a_tip_that_swings_does_not_rest(swing):
    assert rests(lambda time: swing * np.sin(2 * np.pi * 1.3 * time)) is None


def test_a_swing_that_dies_out_rests_when_it_has():
    at = rests(lambda time: 30e-3 * np.exp(-2 * time) * np.cos(2 * np.pi * 1.3 * time), 8.0)
    assert 2.0 < at < 4.5


def test_a_tip_that_creeps_by_a_millimetre_or_two_a_second_does_not_rest():
    assert rests(lambda time: 1.5e-3 * time) is None
    assert rests(lambda time: 0.2e-3 * time) is not None


def test_a_tip_that_no_camera_sees_does_not_rest():
    assert rests(lambda time: 0.1, hidden=lambda time: time > 0.5) is None
    assert rests(lambda time: 0.1, hidden=lambda time: 0.3 < time < 0.35) == pytest.approx(WINDOW, abs=0.15)
    assert rests(lambda time: 0.1, hidden=lambda time: 0.3 < time < 0.75) == pytest.approx(1.5, abs=0.2)
