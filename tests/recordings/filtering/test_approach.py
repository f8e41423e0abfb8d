"""From which side a held arm came to rest, by the commands before and at the beginning of its trial."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recordings.filtering.test_gaps import SETTINGS, TIME, raw
from trunkline.recordings.filtering.filter import filter_raw_trial

BEFORE = np.arange(-1000, len(TIME)) / 120  # s, from 8 s before the arm rests
RAMP = [-8.0, -6.0, -5.0, -4.0]  # s


def pull_from(*columns, kind="static_pull", **changes):
    """A trial whose motors are at these mm of pull at the times of `RAMP`, and hold the last of them from then on."""
    pulls = [np.interp(BEFORE, RAMP, column) / 1000 for column in columns]
    tendons = tuple(f"tendon_{number + 1}" for number in range(len(columns)))
    facts = {"tendons": tendons, "command_time": BEFORE, "commands": np.stack(pulls, axis=1)} | changes
    return raw(kind, **facts, tendon_positions=np.empty((0, len(columns))))


LOOSE = [-300.0] * 4


@pytest.mark.parametrize(
    ("columns", "approach"),
    [
        ([[0, 40, 40, 40], LOOSE], 1),
        ([[0, 52, 52, 40], LOOSE], -1),
        ([[0, 52, 52, 40], [0, 13, 13, 10]], -1),
        ([[0, 52, 52, 40], [0, -26, -26, -20]], -1),  # one that only lets out does not count, whichever way it went
        ([[0, 40, 40, 40], [0, 13, 13, 10]], 0),  # one was drawn in, the other let out
        ([[0, 40, 40, 40], [20, 20, 20, 20]], 0),  # of the other nothing is known
        ([[0, 40, 40.5, 40]], 1),  # too little to turn the cable round
        ([[40, 40, 40, 40]], 0),
        ([LOOSE], 0),
        ([[50, 20, 20, 40]], 1),
    ],
)
def test_the_last_motion_of_the_motors_that_pull_counts(columns, approach):
    assert filter_raw_trial(pull_from(*columns), SETTINGS)[0].approach == approach


def test_what_comes_after_the_rest_does_not_count():
    trial = pull_from([0, 40, 40, 40])
    trial.commands[0.9 * TIME[-1] < BEFORE] = 0.02
    assert filter_raw_trial(trial, SETTINGS)[0].approach == 1


def test_commands_are_dated_by_the_clock_of_the_poses():
    trial = pull_from([0, 40, 40, 40])
    late = replace(trial, clock_offset=100.0)
    assert filter_raw_trial(late, SETTINGS)[0].approach == 0, "all of them come after the rest"


def test_only_an_arm_that_motors_hold_has_an_approach():
    assert filter_raw_trial(pull_from([0, 40, 40, 40], kind="static_tilt"), SETTINGS)[0].approach == 0
    nothing = raw("static_pull", command_time=np.empty(0), commands=np.empty((0, 1)))
    assert filter_raw_trial(nothing, SETTINGS)[0].approach == 0
