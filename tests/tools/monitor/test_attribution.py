"""What explains an alarm: the parameter that changed, its size, and what it cannot be told apart from."""

from dataclasses import replace

import numpy as np
import pytest

from tests.tools.monitor.scores import drawn
from trunkline.tools.monitor.attribution import attribute_change
from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.control_chart import chart_of


def explained(change, seed: int, alias: bool = False):
    rng = np.random.default_rng(seed)

    def draw_score(shift=(0.0, 0.0)):
        score = drawn("release", rng, shift)
        if not alias:
            return score
        curvature = np.full((2, 2), score.curvature[0, 0])  # both parameters move the arm in the same way
        return replace(score, slope=np.full(2, score.slope[0]), curvature=curvature)

    chart = chart_of(Baseline([draw_score() for _ in range(15)]), 2)
    while chart.changed() is None:
        chart.add(draw_score(change))
    return attribute_change(chart.suspects(), chart.baseline, list(chart.lines))


@pytest.mark.parametrize("parameter", [0, 1])
def test_it_names_the_parameter_that_changed_though_the_other_moves_along(parameter):
    change = [0.0, 0.0]
    change[parameter] = -0.2
    attributions = [explained(change, seed) for seed in range(12)]
    assert sum(attribution.best.parameter == parameter for attribution in attributions) >= 11
    right = [attribution.best for attribution in attributions if attribution.best.parameter == parameter]
    assert np.median([change.size for change in right]) == pytest.approx(-0.2, abs=0.02)
    assert sum(abs(change.size + 0.2) <= change.half_width for change in right) >= len(right) - 2
    assert sum(attribution.whole for attribution in attributions) >= 10


def test_a_trial_of_a_kind_without_reference_between_those_that_tell_is_left_aside():
    rng = np.random.default_rng(3)
    chart = chart_of(Baseline([drawn("release", rng) for _ in range(15)]), 2)
    while chart.changed() is None:
        chart.add(drawn("release", rng, (-0.2, 0.0)))
        if chart.changed() is None:
            chart.add(drawn("motion", rng))
    attribution = attribute_change(chart.suspects(), chart.baseline, list(chart.lines))
    assert attribution.best.parameter == 0


def test_it_says_what_cannot_be_told_apart():
    attribution = explained((-0.2, 0.0), 1, alias=True)
    assert [change.parameter for change in attribution.alike] == [1 - attribution.best.parameter]
    assert attribution.alike[0].size == pytest.approx(attribution.best.size, rel=0.05)


def test_two_changes_at_once_are_not_explained_by_one():
    assert not explained((-0.3, 0.4), 2).whole
