"""How far the attribution of an alarm is to be trusted: by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import stdtrit
from scipy.stats import chi2

from tests.tools.monitor.cases import group, score
from trunkline.tools.monitor.attribution import APART, attribute_change
from trunkline.tools.monitor.baseline import POWERS, Departure, Group
from trunkline.tools.monitor.control_chart import Charted

PLAIN = SimpleNamespace(reference=[score(curvature=np.eye(2))], outliers={}, departures=lambda _: {})


def five_off(reference: Group) -> Charted:
    """A trial whose first parameter is off by five standard deviations from `reference`."""
    return Charted(score(curvature=np.eye(2)), {0: Departure(5.0, 1.0, 5.0, reference)}, {}, [])


def of_changes(*rows: dict[int, float], curvature=((1.0, 0.0), (0.0, 1.0)), reference: Group | None = None):
    """What explains trials with such changes, by the number of the parameter, each of variance 1."""
    reference = reference or group()
    departures = [{p: Departure(change, 1.0, change, reference) for p, change in row.items()} for row in rows]
    trials = [Charted(score(curvature=curvature), row, {}, []) for row in departures]
    return attribute_change(trials, PLAIN, sorted({p for row in rows for p in row}))  # type: ignore[arg-type]


@pytest.mark.parametrize("scatter", [0.0, 0.5, 1.0, 2.0, 6.0])
def test_an_interval_is_widened_where_trials_disagree_by_more_than_chance(scatter):
    """By the ratio of Birge: of n trials that scatter by s about their mean, ± t s / √n, and never less than t / √n."""
    signs = np.array([1, -1, 1, -1, 0])
    spread = signs * scatter / np.std(signs, ddof=1)
    result = of_changes(*({0: 7.0 + off} for off in spread))
    assert result.best.size == pytest.approx(7.0)
    assert result.best.half_width == pytest.approx(stdtrit(10, 0.975) * max(scatter, 1.0) / np.sqrt(5))


@pytest.mark.parametrize(("excess", "whole"), [(0.99, True), (1.01, False)])
def test_what_is_left_is_chance_up_to_its_quantile(excess, whole):
    """χ² of five trials about their mean: above its 99.9th percentile, one change does not explain them."""
    signs = np.array([1, -1, 1, -1, 0])
    spread = signs * np.sqrt(excess * chi2.ppf(0.999, 4) / 4)
    assert of_changes(*({0: 7.0 + off} for off in spread)).whole is whole


@pytest.mark.parametrize(("other", "wider"), [(0.5, 1.0), (1.0, 1.0), (2.0, 4.0), (3.0, 9.0)])
@pytest.mark.parametrize(("share", "alike"), [(0.99, True), (1.01, False)])
def test_parameters_are_told_apart_by_more_than_chance_leaves(other, wider, share, alike):
    """Two that are independent: what one explains of χ² more than the other must be above 3.84 times the ratio."""
    best = np.sqrt(other**2 + share * APART * wider)
    result = of_changes({0: best, 1: other})
    assert result.best.parameter == 0
    assert [change.parameter for change in result.alike] == ([1] if alike else [])


def test_few_degrees_of_freedom_widen_an_interval_and_those_of_the_worst_trial_count():
    few, many = group(degrees=4), group(degrees=60)
    trials = [five_off(reference) for reference in (many, few)]
    result = attribute_change(trials, PLAIN, [0])  # type: ignore[arg-type]
    assert result.best.half_width == pytest.approx(stdtrit(4, 0.975) / np.sqrt(2))


def test_what_the_reference_itself_gets_wrong_is_shared_by_its_trials():
    """Of n trials beside one mean that is uncertain by e: variance 1 / n + e², which more trials do not lower."""
    reference = group(error=0.5)
    assert reference.shared(None).tolist() == [0.5] + [0.0] * (POWERS - 1)
    for count in (1, 4, 100):
        result = of_changes(*[{0: 5.0}] * count, reference=reference)
        assert result.best.half_width == pytest.approx(stdtrit(10, 0.975) * np.sqrt(1 / count + 0.25))


def test_a_change_of_one_shows_in_the_estimate_of_another_that_moves_the_arm_alike():
    result = of_changes({0: 6.0, 1: 3.0}, curvature=((1.0, 0.5), (0.5, 1.0)))
    assert result.best.parameter == 0
    assert result.best.size == pytest.approx(6.0)
    assert result.whole


def test_the_best_explanation_need_not_be_asked_first():
    result = of_changes({0: 1.0, 1: 6.0})
    assert (result.best.parameter, result.best.size) == (1, pytest.approx(6.0))
    assert [change.parameter for change in result.alike] == []


def test_a_parameter_that_no_trial_tells_of_explains_nothing():
    trial = five_off(group())
    result = attribute_change([trial], PLAIN, [1, 0])  # type: ignore[arg-type]
    assert (result.best.parameter, result.alike) == (0, [])


@pytest.mark.parametrize(("spread", "information", "deviation"), [(3.0, 1.0, 3.0), (1.0, 4.0, 0.5), (3.0, 4.0, 1.5)])
def test_chance_is_the_reference_s_spread_over_the_root_of_what_a_trial_tells(spread, information, deviation):
    result = of_changes({0: 5.0}, curvature=np.eye(2) * information, reference=group(spread=spread))
    assert result.best.half_width == pytest.approx(stdtrit(10, 0.975) * deviation)


@pytest.mark.parametrize(("more", "alike"), [(3.7, [1]), (4.0, [])])
def test_two_are_told_apart_at_the_95th_percentile_of_one_degree_of_freedom(more, alike):
    result = of_changes({0: np.sqrt(1 + more), 1: 1.0})
    assert [change.parameter for change in result.alike] == alike


def test_groups_of_another_condition_share_no_error():
    """Beside two means, each uncertain by 1/2, two trials have a variance of (1 + 1/4) / 2."""
    groups = [replace(group(error=0.5), key=("release", level)) for level in (1, 2)]
    trials = [five_off(reference) for reference in groups]
    result = attribute_change(trials, PLAIN, [0])  # type: ignore[arg-type]
    assert result.best.half_width == pytest.approx(stdtrit(10, 0.975) * np.sqrt(1.25 / 2))
