"""The table of the last centimetre, of results by hand."""

import numpy as np

from qualification.seen import Corrected, rows, summary

RESULTS = [
    Corrected([4e-3, 3e-3, 5.5e-3, 1e-3], [1.0, 3.0, 2.0], "5 steps are done"),
    Corrected([2e-3], [], "arrived"),
    Corrected([3e-3, np.nan], [20.0], "the tip moves 16 mm for 1 mm of a motor: near snapping through"),
]


def test_an_arm_that_stays_counts_as_it_stays_and_one_without_rest_as_worst():
    median, p95, worst = rows("own surface", RESULTS)
    assert median == "| own surface | median | 3.00 | 3.00 | 5.50 | 2.00 | 2.00 | 2.00 |"
    assert p95 == "| own surface | 95th percentile | 4.00 | inf | inf | inf | inf | inf |"
    assert worst == "| own surface | worst | 4.00 | inf | inf | inf | inf | inf |"


def test_steps_away_times_and_ends_are_counted():
    (line,) = summary("own surface", RESULTS)
    assert "largest step away from the target 2.5 mm, by more than 2 mm 1 of 3" in line
    assert "takes 2.5 s (median), 20.0 s at most" in line
    assert line.endswith("ended: 5 steps are done 1, arrived 1, near snapping through 1.")
