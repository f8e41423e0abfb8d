"""Which times of a grid may be trusted: by hand, at the ends of the samples and of the grid."""

import numpy as np
import pytest

from trunkline.recordings.signals.smoothing import bridged

FAR = [0.0, 4.0, 8.0, 20.0]  # s of samples


@pytest.mark.parametrize(
    ("time", "grid", "longest", "trusted"),
    [
        (FAR, [0.0, 1.0, 2.0, 3.0, 4.0], 4.0, [True] * 5),  # the first gap
        (FAR, [5.0, 6.0, 7.0], 4.0, [True] * 3),
        (FAR, [5.0, 6.0, 7.0], 3.9, [False, False, False]),
        (FAR, [8.0, 9.0, 10.0, 19.0, 20.0], 4.0, [True, False, False, False, True]),  # the last
        (FAR, [-2.0, -1.0, 0.0], 4.0, [False, False, True]),  # before
        (FAR, [20.0, 21.0, 22.0], 4.0, [True, False, False]),  # and after all
        ([0.0, 1.5, 9.0], [0.0, 1.0, 2.0, 3.0], 0.0, [True, True, True, False]),  # half a step from a sample
        ([0.0, 1.49, 9.0], [0.0, 1.0, 2.0, 3.0], 0.0, [True, True, False, False]),
        ([0.0, 9.0], [3.0], 1.0, [True]),  # a grid of one
        ([0.0, 9.0], [3.0, 4.0], 1.0, [False, False]),  # of two
        ([5.0], [4.0, 5.0, 6.0], 9.0, [False, True, False]),  # a sample alone
    ],
)
def test_a_time_is_trusted_in_a_short_gap_or_within_half_a_step_of_a_sample(time, grid, longest, trusted):
    assert bridged(np.array(time), np.array(grid), longest).tolist() == trusted
