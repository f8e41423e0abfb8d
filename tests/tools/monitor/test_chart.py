"""The control chart: its false alarms are as rare as asked for, one odd trial raises none, a change does soon."""

import numpy as np
import pytest

from tests.tools.monitor.scores import drawn
from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.control_chart import Chart, ParameterChart, chart_of, limit_of

KINDS = ("static_tilt", "release", "curl")


def baseline(rng, each: int = 10) -> Baseline:
    return Baseline([drawn(kind, rng) for kind in KINDS for _ in range(each)])


def test_false_alarms_are_as_rare_as_asked_for():
    """Over many references, each with charts of its own; the limit depends on the numbers of trials alone."""
    rng, rate = np.random.default_rng(1), 1 / 50
    reference = baseline(rng)
    limit = limit_of(reference, 0, rate)
    count = trials = 0
    for _ in range(150):
        reference = baseline(rng)
        best = min(departure.deviation for departure, _ in reference.typical(0))
        chart = Chart(reference, {0: ParameterChart(limit, best)}, restart=True)
        for _ in range(60):
            count += bool(chart.add(drawn(KINDS[rng.integers(3)], rng)).alarms)
            trials += 1
    assert count / trials == pytest.approx(rate, rel=0.35)


def test_a_rarer_false_alarm_takes_a_wider_limit_and_so_do_fewer_reference_trials():
    rng = np.random.default_rng(2)
    many, few = baseline(rng, 20), baseline(rng, 5)
    assert limit_of(many, 0, 1 / 500) > limit_of(many, 0, 1 / 50)
    assert limit_of(few, 0, 1 / 500) > limit_of(many, 0, 1 / 500)


@pytest.mark.parametrize("size", [0.5, 500.0])
def test_one_odd_trial_raises_no_alarm_however_odd_and_two_do(size):
    rng = np.random.default_rng(3)
    chart = chart_of(baseline(rng), 2)
    for _ in range(10):
        assert not chart.add(drawn("release", rng)).alarms
    assert not chart.add(drawn("release", rng, (size, 0))).alarms
    assert chart.add(drawn("release", rng, (size, 0))).alarms
    assert chart.changed() == 11
    assert len(chart.suspects()) == 2


def test_a_trial_that_tells_little_hardly_moves_the_chart():
    rng = np.random.default_rng(4)
    chart = chart_of(baseline(rng), 2)
    level = [chart.add(drawn(kind, rng, (0.12, 0))).levels[0] for kind in ("curl", "static_tilt")]
    assert abs(level[0]) < 1
    assert level[1] > 2
