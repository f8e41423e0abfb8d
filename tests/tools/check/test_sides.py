"""Tendons that bend the arm to other sides than described, as where the base's axes are turned about it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.matched_plant import curl, release, small_model, static_pull
from tests.tools.check.test_preflight import turned
from trunkline.tools.check.sides import FEWEST, side_lines, tendon_sides


@pytest.fixture(scope="module")
def model():
    return small_model(4)


@pytest.fixture(scope="module")
def pulled(model):
    return [*(curl(model, 30, tendon=tendon) for tendon in range(3)), static_pull(model, (0, 20, -20))]


def test_tendons_are_where_they_bend_the_arm_to(model):
    sides = np.array(list(tendon_sides(model).values()))
    assert np.sum(sides) == pytest.approx(0, abs=1e-4)
    np.testing.assert_allclose(np.abs(np.angle(sides / np.roll(sides, 1))), 2 * np.pi / 3, atol=1e-3)


def test_an_honest_session_has_nothing_said(model, pulled):
    assert side_lines([*pulled, release(model, 0.2)], model) == []
    assert side_lines([turned(trial, 8) for trial in pulled], model) == []
    assert side_lines([turned(pulled[0], 30)], model) == [], "one trial alone"


@pytest.mark.parametrize("degrees", [30, -25])
def test_a_base_that_is_turned_about_the_arm_is_said(model, pulled, degrees):
    (line,) = side_lines([turned(trial, degrees) for trial in pulled], model)
    angle = float(line.partition("turned by ")[2].partition("°")[0])
    assert angle == pytest.approx(degrees, abs=4)
    assert "on average over 4 trials: are x and y of the base body those of the arm's description?" in line


def test_a_turn_is_said_from_its_limit_on(model, pulled):
    """Of trials that are alike to the last bit, so that nothing but the angle decides."""
    (line,) = side_lines([turned(pulled[0], 40)] * FEWEST, model)
    offset = float(line.partition("turned by ")[2].partition("°")[0]) - 40
    limit = 15 - offset
    assert side_lines([turned(pulled[0], limit - 2)] * FEWEST, model) == []
    assert side_lines([turned(pulled[0], limit + 2)] * FEWEST, model)


@pytest.mark.parametrize("degrees", [35, -40])
def test_a_trial_in_another_frame_is_said(model, pulled, degrees):
    (line,) = side_lines([*pulled[1:], turned(pulled[0], degrees)], model)
    assert line.startswith(f"base: trial {pulled[0].name}: tendons bend the arm to sides that are turned by ")
    assert float(line.partition("turned by ")[2].partition("°")[0]) == pytest.approx(degrees, abs=5)
    assert line.endswith("against the other trials: are its poses in another frame?")
    assert side_lines([*pulled[2:], turned(pulled[0], degrees)], model) == [], "two beside it are too few"


def test_a_trial_that_bends_as_far_aside_as_honest_ones_do_is_not(model, pulled):
    (line,) = side_lines([*pulled[:3], turned(pulled[0], 60)], model)
    limit = 60 + 25 - float(line.partition("turned by ")[2].partition("°")[0])
    assert side_lines([*pulled[:3], turned(pulled[0], limit - 2)], model) == []
    assert side_lines([*pulled[:3], turned(pulled[0], limit + 2)], model)


def test_trials_that_disagree_or_tell_nothing_have_no_say(model, pulled):
    either = [turned(trial, degrees) for trial, degrees in zip(pulled, (40, -40, 40, -40), strict=True)]
    assert side_lines(either, model) == []
    some = [turned(trial, degrees) for trial, degrees in zip(pulled, (60, 0, 60, 0), strict=True)]
    assert side_lines(some, model) == []
    slack = [replace(turned(trial, 30), commands=-np.abs(trial.commands)) for trial in pulled]
    assert side_lines(slack, model) == []
