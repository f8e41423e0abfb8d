"""What an unchanged arm looks like: a new trial's departure is standard normal, however few the reference trials."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.tools.monitor.scores import drawn
from trunkline.tools.monitor.baseline import LEAST, Baseline


def departure(count: int, rng, levels=(None,)) -> float:
    reference = [drawn("release", rng, level=levels[i % len(levels)]) for i in range(count)]
    departure = Baseline(reference).departure(drawn("release", rng, level=levels[0]), 0)
    assert departure is not None
    return departure.z


@pytest.mark.parametrize(("count", "levels"), [(LEAST + 1, (None,)), (12, (None,)), (8, (30.0, 60.0))])
def test_it_is_standard_normal_by_chance(count, levels):
    rng = np.random.default_rng(count)
    values = [departure(count, rng, levels) for _ in range(1500)]
    assert stats.kstest(values, "norm").pvalue > 1e-3
    assert np.std(values) == pytest.approx(1, abs=0.08)


def test_it_has_the_sign_and_the_size_of_the_change():
    rng = np.random.default_rng(3)
    baseline = Baseline([drawn("static_tilt", rng) for _ in range(20)])
    departures = [baseline.departure(drawn("static_tilt", rng, (-0.05, 0)), 0) for _ in range(20)]
    assert np.mean([departure.change for departure in departures]) == pytest.approx(-0.05, abs=0.004)
    assert all(departure.z < -3 for departure in departures)


def test_trials_done_alike_are_compared_with_each_other():
    """Tilts of two levels, each with an offset of its own, scatter little about it."""
    rng = np.random.default_rng(4)
    offset = {30.0: 0.0, 60.0: 0.1}
    reference = [drawn("static_tilt", rng, (offset[level], 0), level) for level in (30.0, 60.0) for _ in range(6)]
    baseline = Baseline(reference)
    for level, change in offset.items():
        departure = baseline.departure(drawn("static_tilt", rng, (change, 0), level), 0)
        assert abs(departure.change) < 0.03
        assert departure.group.degrees == 10
    other = baseline.departure(drawn("static_tilt", rng, (0.05, 0), 45.0), 0)
    assert other.deviation > 3 * departure.deviation  # of a level of its own, it scatters as levels do


def test_an_offset_that_changes_with_the_level_is_followed():
    """As a softer model is off more the more it bends; where it is not, a curve is hardly ever taken."""
    rng = np.random.default_rng(6)

    def tilt(bow: float, change: float = 0.0):
        level = float(rng.uniform(25, 100))
        return drawn("static_tilt", rng, (bow * (level / 60) ** 2 + change, 0), level)

    values, bent = [], 0
    for _ in range(400):
        baseline = Baseline([tilt(0.0) for _ in range(12)])
        values.append(baseline.departure(tilt(0.0), 0).z)
        bent += len(baseline.departure(tilt(0.0), 0).group.mean) > 1
    assert np.std(values) == pytest.approx(1, abs=0.15)
    assert bent / 400 < 0.02
    baseline = Baseline([tilt(0.1) for _ in range(12)])
    softer = [baseline.departure(tilt(0.1, -0.05), 0).change for _ in range(20)]
    assert np.mean(softer) == pytest.approx(-0.05, abs=0.01)
    assert abs(baseline.departure(tilt(0.1), 0).z) < 4


def test_a_reference_trial_unlike_the_others_is_left_out():
    rng = np.random.default_rng(7)
    scores = [drawn("release", rng) for _ in range(11)]
    touched = drawn("release", rng, (-0.5, 0))
    baseline, without = Baseline([*scores[:5], touched, *scores[5:]]), Baseline(scores)
    assert list(baseline.outliers) == [5]
    assert 0 in baseline.outliers[5]
    score = drawn("release", rng, (-0.05, 0))
    assert baseline.departure(score, 0).z == pytest.approx(without.departure(score, 0).z)
    assert without.outliers == {}


def test_what_is_done_alike_is_odd_among_its_like_alone():
    """Loaded tilts are not odd beside unloaded ones, nor is a level that is off the curve and repeated."""
    rng = np.random.default_rng(9)
    bare = [drawn("static_tilt", rng, level=60.0) for _ in range(12)]
    loaded = [replace(drawn("static_tilt", rng, (0.3, 0), 60.0), load=0.05) for _ in range(3)]
    assert Baseline([*bare, *loaded]).outliers == {}
    levels = {20.0: 0.0, 40.0: 0.0, 60.0: 0.4, 80.0: 0.0, 100.0: 0.0}
    apart = [drawn("static_tilt", rng, (off, 0), level) for level, off in levels.items() for _ in range(3)]
    assert Baseline(apart).outliers == {}
    assert abs(Baseline(apart).departure(drawn("static_tilt", rng, (0.4, 0), 60.0), 0).z) < 3.5


def test_few_reference_trials_are_all_kept():
    rng = np.random.default_rng(8)
    scores = [*(drawn("release", rng) for _ in range(LEAST)), drawn("release", rng, (-0.5, 0))]
    assert Baseline(scores).outliers == {}


def test_too_few_reference_trials_and_other_kinds_chart_nothing():
    rng = np.random.default_rng(5)
    assert Baseline([drawn("curl", rng) for _ in range(LEAST)]).departures(drawn("curl", rng)) == {}
    assert Baseline([drawn("curl", rng) for _ in range(9)]).departures(drawn("release", rng)) == {}
