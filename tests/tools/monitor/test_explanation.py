"""What explains an alarm: the parameter that changed, its size, and what it cannot be told apart from."""

from dataclasses import replace

import numpy as np
import pytest

from tests.tools.monitor.scores import drawn
from trunkline.tools.monitor.attribution import attribute_change
from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.chart import chart_of


def explained(change, seed: int, alias: bool = False):
    rng = np.random.default_rng(seed)

    def one(shift=(0.0, 0.0)):
        score = drawn("release", rng, shift)
        if not alias:
            return score
        curvature = np.full((2, 2), score.curvature[0, 0])  # both parameters move the arm in the same way
        return replace(score, slope=np.full(2, score.slope[0]), curvature=curvature)

    chart = chart_of(Baseline([one() for _ in range(15)]), 2)
    while chart.changed() is None:
        chart.add(one(change))
    return attribute_change(chart.suspects(), chart.baseline, list(chart.lines))


@pytest.mark.parametrize("parameter", [0, 1])
def test_it_names_the_parameter_that_changed_though_the_other_moves_along(parameter):
    change = [0.0, 0.0]
    change[parameter] = -0.2
    found = [explained(change, seed) for seed in range(12)]
    assert sum(one.best.parameter == parameter for one in found) >= 11
    right = [one.best for one in found if one.best.parameter == parameter]
    assert np.median([one.size for one in right]) == pytest.approx(-0.2, abs=0.02)
    assert sum(abs(one.size + 0.2) <= one.half_width for one in right) >= len(right) - 2
    assert sum(one.whole for one in found) >= 10


def test_a_trial_of_a_kind_without_reference_between_those_that_tell_is_left_aside():
    rng = np.random.default_rng(3)
    chart = chart_of(Baseline([drawn("release", rng) for _ in range(15)]), 2)
    while chart.changed() is None:
        chart.add(drawn("release", rng, (-0.2, 0.0)))
        if chart.changed() is None:
            chart.add(drawn("motion", rng))
    found = attribute_change(chart.suspects(), chart.baseline, list(chart.lines))
    assert found.best.parameter == 0


def test_it_says_what_cannot_be_told_apart():
    found = explained((-0.2, 0.0), 1, alias=True)
    assert [one.parameter for one in found.alike] == [1 - found.best.parameter]
    assert found.alike[0].size == pytest.approx(found.best.size, rel=0.05)


def test_two_changes_at_once_are_not_explained_by_one():
    assert not explained((-0.3, 0.4), 2).whole
