"""Runs of True: which last, and where they are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trunkline.recordings.signals.runs import lasting, stretches

FLAGS = np.array([1, 1, 0, 1, 1, 1, 0, 0, 1], bool)


@pytest.mark.parametrize(("least", "rows"), [(1, [0, 1, 3, 4, 5, 8]), (2, [0, 1, 3, 4, 5]), (3, [3, 4, 5]), (4, [])])
def test_a_run_lasts_or_goes_whole_also_at_the_ends(least, rows):
    assert np.flatnonzero(lasting(FLAGS, least)).tolist() == rows


def test_stretches_name_first_and_last():
    assert stretches(FLAGS) == [(0, 1), (3, 5), (8, 8)]
    assert stretches(np.zeros(3, bool)) == []


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.integers(1, 7))
def test_what_lasts_are_the_long_stretches(flags, least):
    flags = np.array(flags)
    long = np.zeros(len(flags), bool)
    for begin, end in stretches(flags):
        assert flags[begin : end + 1].all()
        long[begin : end + 1] = end + 1 - begin >= least
    np.testing.assert_array_equal(lasting(flags, least), long)
