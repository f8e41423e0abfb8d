"""Frames lost behind even stamps: found where the arm moves, counted rightly, and never where none is missing."""

import numpy as np
import pytest

from trunkline.recordings.cleaning.dropped_frames import DroppedFrames, find_dropped_frames, put_back, unbroken

RATE = 100.0
TIME = np.arange(300) / RATE


def swing(time: np.ndarray, seed: int = 0, noise: float = 1e-5) -> np.ndarray:
    """Three markers of an arm that swings at 1.3 Hz, with a second bending mode. (T, 3, 3) m."""
    slow, fast = np.exp(-time) * np.cos(8.2 * time), np.exp(-4 * time) * np.sin(30 * time)
    along = np.array([0.03, 0.08, 0.16])[:, None] * [1, 0.3, 0.1]
    across = np.array([0.004, -0.006, 0.003])[:, None] * [0.2, 1, 0]
    rng = np.random.default_rng(seed)
    positions = slow[:, None, None] * along + fast[:, None, None] * across
    return positions + rng.normal(scale=noise, size=positions.shape)


def lose(lost: list[DroppedFrames]) -> tuple[np.ndarray, np.ndarray]:
    """True times and positions of 300 frames out of a longer recording."""
    true = put_back(TIME, lost)
    return true, swing(true)


@pytest.mark.parametrize("seed", range(10))
def test_nothing_is_found_where_nothing_is_lost(seed):
    assert find_dropped_frames(TIME, swing(TIME, seed), 1e-5) == []
    assert find_dropped_frames(TIME, swing(TIME, seed, 3e-4), 3e-4) == []


def test_losses_are_found_and_counted_even_close_together():
    lost = [DroppedFrames(40, 4), DroppedFrames(44, 3), DroppedFrames(49, 6), DroppedFrames(120, 1)]
    true, positions = lose(lost)
    assert find_dropped_frames(TIME, positions, 1e-5) == lost
    np.testing.assert_allclose(put_back(TIME, find_dropped_frames(TIME, positions, 1e-5)), true)


def test_outliers_swaps_and_hidden_bodies_are_no_loss():
    positions = swing(TIME)
    positions[50, 2] += 0.02
    positions[80:95, [0, 1]] = positions[80:95, [1, 0]]
    positions[130:133, 1] = np.nan
    positions[160:, :] += 0.004  # a knock against the mount
    assert find_dropped_frames(TIME, positions, 1e-5) == []


def test_a_gap_that_cannot_be_counted_parts_a_recording():
    time = np.arange(0, 4, 0.001)
    positions = swing(time)
    assert unbroken(TIME, swing(TIME)) == slice(0, 300)
    part = np.r_[np.zeros((20, 3, 3)) + positions[0], positions[150::10]]  # held, then let go 150 ms before it is seen
    even = np.arange(len(part)) / RATE
    assert unbroken(even, part) == slice(20, len(part))
    lost = [DroppedFrames(40, 6)]
    true, positions = lose(lost)
    assert unbroken(true, positions) == slice(0, 300), "what was counted is no gap any more"
    outlying = swing(TIME)
    outlying[50, 2] += 0.02
    outlying[90:100, 1] = np.nan
    assert unbroken(TIME, outlying) == slice(0, 300)


def test_a_gap_that_the_stamps_show_is_not_found_again():
    lost = [DroppedFrames(40, 4)]
    true, positions = lose(lost)
    assert find_dropped_frames(true, positions, 1e-5) == []


def test_an_arm_at_rest_tells_nothing():
    positions = np.zeros((300, 3, 3)) + np.random.default_rng(1).normal(scale=1e-4, size=(300, 3, 3))
    assert find_dropped_frames(TIME, positions, 1e-4) == []
    assert find_dropped_frames(TIME[:4], positions[:4], 1e-4) == []
