"""What commands say between two messages."""

import numpy as np
import pytest

from trunkline.recordings.signals.held import to_and_fro, with_corners
from trunkline.recordings.trials.recording import LENGTH, PULLED

FAR = PULLED[LENGTH]


def at(when, time, commands, between=None):
    time, commands = with_corners(np.array(time), np.array(commands, float)[:, None], between)
    return np.interp(when, time, commands[:, 0]).tolist()


def test_a_command_that_is_sent_once_holds_until_the_next():
    time, commands = [0.0, 0.4, 1.5], [0.0, 0.012, 0.0]
    assert at([0.1, 0.39, 0.41, 1.4, 2.0], time, commands) == [0.0, 0.0, 0.012, 0.012, 0.0]
    assert at([0.2], time, commands, "line") == [pytest.approx(0.006)]


def test_steps_that_are_sampled_hold_and_ramps_go_on():
    time = np.arange(12) * 0.04
    steps = np.where(time < 0.2, 0.0, 0.012)
    assert at([0.18, 0.199], time, steps) == [0.0, 0.0]
    ramp = np.clip(time - 0.1, 0, 0.2)
    assert at([0.14, 0.18], time, ramp) == pytest.approx([0.04, 0.08])
    assert at([0.18], time, ramp, "hold") == [pytest.approx(0.06)]


def test_a_staircase_that_is_sent_seldom_holds():
    assert at([0.25, 0.75], [0.0, 0.5, 1.0, 1.5], [0.0, 1.0, 2.0, 3.0]) == [0.0, 1.0]


@pytest.mark.parametrize("every", [2, 4])
def test_two_publishers_are_told_by_their_jumps(every):
    time = np.arange(100) * 0.02
    commands = 0.01 * np.sin(np.pi * time)[:, None]
    commands[::every] = 0
    assert len(to_and_fro(time, commands, FAR)) > 15


def test_one_publisher_is_left_alone():
    time = np.arange(400) * 0.01
    square = np.where(np.sin(2 * np.pi * time) > 0, 0.02, 0.0)[:, None]
    assert to_and_fro(time, square, FAR) == []
    assert to_and_fro(time, 0.02 * np.sin(20 * time)[:, None], FAR) == []
    assert to_and_fro(np.arange(6) * 0.5, square[::50][:6], FAR) == [], "told one by one, seldom"
