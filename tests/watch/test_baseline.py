"""What an unchanged arm looks like: a new trial's departure is standard normal, however few the reference trials."""

import numpy as np
import pytest
from scipy import stats

from tests.watch.scores import drawn
from trunkline.watch.baseline import LEAST, Baseline


def departure(count: int, rng, levels=(None,)) -> float:
    reference = [drawn("release", rng, level=levels[i % len(levels)]) for i in range(count)]
    found = Baseline(reference).departure(drawn("release", rng, level=levels[0]), 0)
    assert found is not None
    return found.z


@pytest.mark.parametrize(("count", "levels"), [(LEAST + 1, (None,)), (12, (None,)), (8, (30.0, 60.0))])
def test_it_is_standard_normal_by_chance(count, levels):
    rng = np.random.default_rng(count)
    values = [departure(count, rng, levels) for _ in range(1500)]
    assert stats.kstest(values, "norm").pvalue > 1e-3
    assert np.std(values) == pytest.approx(1, abs=0.08)


def test_it_has_the_sign_and_the_size_of_the_change():
    rng = np.random.default_rng(3)
    baseline = Baseline([drawn("static_tilt", rng) for _ in range(20)])
    found = [baseline.departure(drawn("static_tilt", rng, (-0.05, 0)), 0) for _ in range(20)]
    assert np.mean([one.change for one in found]) == pytest.approx(-0.05, abs=0.004)
    assert all(one.z < -3 for one in found)


def test_trials_done_alike_are_compared_with_each_other():
    """Tilts of two levels, each with an offset of its own, scatter little about it."""
    rng = np.random.default_rng(4)
    offset = {30.0: 0.0, 60.0: 0.1}
    reference = [drawn("static_tilt", rng, (offset[level], 0), level) for level in (30.0, 60.0) for _ in range(6)]
    baseline = Baseline(reference)
    for level, change in offset.items():
        found = baseline.departure(drawn("static_tilt", rng, (change, 0), level), 0)
        assert abs(found.change) < 0.03
        assert found.group.degrees == 10
    other = baseline.departure(drawn("static_tilt", rng, (0.05, 0), 45.0), 0)
    assert other.deviation > 3 * found.deviation  # of a level of its own, it scatters as levels do


def test_too_few_reference_trials_and_other_kinds_chart_nothing():
    rng = np.random.default_rng(5)
    assert Baseline([drawn("curl", rng) for _ in range(LEAST)]).departures(drawn("curl", rng)) == {}
    assert Baseline([drawn("curl", rng) for _ in range(9)]).departures(drawn("release", rng)) == {}
