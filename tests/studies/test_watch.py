"""The study of the watch: kept scores are what was scored, and it counts what charts say."""

import numpy as np

from studies.watch import AFTER, LATEST, found_lines, packed, unpacked
from tests.tools.monitor.scores import drawn
from trunkline.tools.monitor.baseline import Baseline
from trunkline.tools.monitor.control_chart import chart_of


def test_a_kept_score_is_the_one_that_was_scored():
    score = drawn("release", np.random.default_rng(1), level=30.0)
    kept = unpacked(packed(score))
    assert kept.condition == score.condition
    np.testing.assert_allclose(kept.slope, score.slope, rtol=1e-4)
    np.testing.assert_allclose(kept.curvature, score.curvature, rtol=1e-4)


def test_it_counts_in_how_many_trials_a_change_is_found():
    rng = np.random.default_rng(2)
    kinds = ("static_tilt", "release")
    pool = {kind: [drawn(kind, rng) for _ in range(30)] for kind in kinds}
    softer = {kind: {i: drawn(kind, rng, (np.log(0.8), 0)) for i in range(3 * AFTER[kind])} for kind in kinds}
    softer |= {kind: {} for kind in AFTER if kind not in kinds}
    empty = chart_of(Baseline([score for own in pool.values() for score in own[:12]]), 2)
    rest = [score for own in pool.values() for score in own[12:]]
    lines = found_lines([empty] * 3, [rest] * 3, softer, "made up", ("stiffness", "damping"))
    assert len(lines) == 1 + len(kinds)  # what was not recorded has no row
    for line in lines:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        assert sum(map(int, cells[3 : 3 + LATEST + 1])) == int(cells[2]) == 3
        assert int(cells[3 + LATEST]) == 0
