"""When a chart raises an alarm, and which trials it suspects: by hand."""

import numpy as np
import pytest

from tests.tools.monitor.cases import departure, score
from trunkline.tools.monitor.baseline import Departure
from trunkline.tools.monitor.control_chart import ALONE, FORGETTING, LONG_RUN, Chart, Charted, ParameterChart
from trunkline.tools.monitor.scores import Score

LIMIT = 4.0


@pytest.mark.parametrize("z", [3.0, 12.0, 20.0, 1e3, 1e9, np.inf, -20.0, -np.inf])
@pytest.mark.parametrize("deviation", [1.0, 0.5, 3.0])
def test_one_trial_moves_a_chart_by_a_share_of_the_limit_at_most(z, deviation):
    """However far off it is, and however well it tells the parameter; two of them are beyond the limit."""
    line = ParameterChart(LIMIT, best=1.0)
    line.add(departure(z, deviation))
    assert abs(line.level) <= ALONE * LIMIT + 1e-12
    assert np.sign(line.level) == np.sign(z)
    assert not line.beyond
    if abs(z) > 1e2:
        assert abs(line.level) == pytest.approx(ALONE * LIMIT)
        line.add(departure(z, deviation))
        assert line.beyond


def test_a_usual_trial_moves_it_by_its_weight():
    """A ← (1 - λ) A + λ w z, with w the best deviation over its own, 1 at most."""
    for deviation, weight in ((1.0, 1.0), (4.0, 0.25), (0.25, 1.0)):
        line = ParameterChart(LIMIT, best=1.0, mean=0.4)
        line.add(departure(1.0, deviation))
        assert line.mean == pytest.approx((1 - FORGETTING) * 0.4 + FORGETTING * weight)
        assert line.variance == pytest.approx((1 - FORGETTING) ** 2 * LONG_RUN + (FORGETTING * weight) ** 2)


@pytest.mark.parametrize(
    ("level", "beyond"),
    [(0.0, False), (3.999, False), (LIMIT, False), (4.001, True), (-LIMIT, False), (-4.001, True), (np.nan, False)],
)
def test_beyond_the_limit_is_more_than_it_to_either_side(level, beyond):
    line = ParameterChart(LIMIT, best=1.0, mean=level, variance=1.0)
    assert line.beyond is beyond


class FixedBaseline:
    """A baseline with a given departure for each trial in turn, z by the number of the parameter."""

    def __init__(self, *rows: dict[int, float]) -> None:
        self.rows = iter(rows)

    def departures(self, score: Score) -> dict[int, Departure]:
        return {p: departure(z) for p, z in next(self.rows).items()}


def charted(*rows: dict[int, float], limits=(LIMIT, LIMIT), restart: bool = False) -> Chart:
    lines = {p: ParameterChart(limit, 1.0) for p, limit in enumerate(limits)}
    chart = Chart(FixedBaseline(*rows), lines, restart)  # type: ignore[arg-type]
    for _ in rows:
        chart.add(score())
    return chart


FAR = 1e6


@pytest.mark.parametrize(
    ("rows", "alarms", "changed"),
    [
        ([{0: 0.0}, {0: 1.0}], [[], []], None),
        ([{0: FAR}, {0: 0.0}, {0: FAR}], [[], [], [0]], 2),
        ([{0: FAR}, {0: FAR}, {0: FAR}], [[], [0], [0]], 1),
        ([{0: FAR}, {0: -FAR}], [[], []], None),
        ([{0: FAR, 1: FAR}, {0: FAR, 1: FAR}], [[], [0, 1]], 1),
        ([{0: FAR}, {1: FAR}, {0: FAR}], [[], [], [0]], 2),  # a trial of another parameter is no trial of this one
        ([{0: FAR}, {0: FAR}, {1: 0.0}], [[], [0], []], 1),  # nor repeats its alarm
        ([{7: FAR}, {7: FAR}, {7: FAR}], [[], [], []], None),  # without a chart
    ],
)
def test_alarms_are_of_the_parameters_that_a_trial_tells(rows, alarms, changed):
    chart = charted(*rows)
    assert [trial.alarms for trial in chart.trials] == alarms
    assert chart.changed() == changed


@pytest.mark.parametrize(("restart", "alarms"), [(True, [[], [0], [], [0]]), (False, [[], [0], [0], [0]])])
def test_a_chart_that_begins_anew_after_an_alarm_takes_two_again(restart, alarms):
    chart = charted(*[{0: FAR}] * 4, restart=restart)
    assert [trial.alarms for trial in chart.trials] == alarms


def standing(levels: list[dict[int, float]], limits=(LIMIT, LIMIT)) -> Chart:
    """A chart that stood at these levels after its trials; alarms where they are beyond the limits."""
    lines = {p: ParameterChart(limit, 1.0) for p, limit in enumerate(limits)}
    trials = [Charted(score(), {}, row, [p for p, level in row.items() if abs(level) > limits[p]]) for row in levels]
    return Chart(None, lines, trials=trials)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("levels", "suspects"),
    [
        ([{0: 0.0}, {0: 3.0}], None),
        ([{0: 5.0}], (0, 0)),
        ([{0: 0.5}, {0: 2.0}, {0: 5.0}], (1, 2)),
        ([{0: 1.0}, {0: 2.0}, {0: 5.0}], (1, 2)),  # within a standard deviation is near the middle
        ([{0: 1.001}, {0: 2.0}, {0: 5.0}], (0, 2)),
        ([{0: 2.0}, {0: -2.0}, {0: 5.0}], (2, 2)),  # on the other side it was not this change
        ([{0: -2.0}, {0: -3.0}, {0: -5.0}], (0, 2)),
        ([{0: 0.0}, {0: 2.0}, {1: 0.3}, {0: 5.0}], (1, 3)),  # between those that tell
        ([{0: 0.0}, {0: 5.0}, {0: 9.0}], (1, 1)),  # up to the first alarm
        ([{0: 0.0, 1: 2.0}, {0: 4.5, 1: 6.0}], (0, 1)),  # the chart that is furthest beyond
        ([{0: 0.0, 1: 2.0}, {0: 7.0, 1: 6.0}], (1, 1)),
        ([{0: 0.0, 1: -2.0}, {0: 4.5, 1: -6.0}], (0, 1)),  # to whichever side
    ],
)
def test_suspects_begin_where_the_furthest_chart_was_last_near_its_middle(levels, suspects):
    chart = standing(levels)
    expected = [] if suspects is None else chart.trials[suspects[0] : suspects[1] + 1]
    assert chart.suspects() == expected


def test_how_far_beyond_is_told_against_each_chart_s_own_limit():
    chart = standing([{0: 0.0, 1: 2.0}, {0: 7.0, 1: 6.0}], limits=(6.0, 3.0))
    assert chart.suspects() == chart.trials
