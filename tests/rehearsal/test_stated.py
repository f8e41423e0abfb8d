"""What previews stated against what came: agreement, Brier scores, and how often the tip ended inside the radius."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rehearsal.experiments.result import LATER, Result, share_of
from rehearsal.experiments.stated import covered, probabilities, scores
from rehearsal.rehearse import metrics_of
from rehearsal.runs import RunSource
from trunkline.ar.hybrid.rates import wilson

NAN = float("nan")


def grasp(success: bool, probability: float, agreed: float, path: float = NAN, **more) -> Result:
    return Result("grasp", 0, success, probability=probability, agreed=agreed, path_pct=path, **more)


def reach(radius: float, at_end: float, after_2s: float = 0.0, after_10s: float = 0.0, **more) -> Result:
    fields = {"radius_mm": radius, "at_end_mm": at_end, "after_2s_mm": after_2s, "after_10s_mm": after_10s}
    return Result("reach", 0, True, **fields, **more)


@pytest.mark.parametrize(("off", "radius", "inside"), [
    (0.0, 2.0, True), (2.0, 2.0, True), (np.nextafter(2.0, 3), 2.0, False), (9.0, 2.0, False), (0.0, 0.0, True),
    (NAN, 2.0, False), (1.0, NAN, False), (np.inf, 2.0, False),
])  # fmt: skip
def test_a_tip_is_inside_the_radius_or_on_it(off, radius, inside):
    assert covered(np.array([off]), np.array([radius])).tolist() == [inside]


TRUE, FALSE = grasp(True, 0.9, 1.0, 1.0), grasp(False, 0.8, 0.0, 3.0)


@pytest.mark.parametrize(("rows", "previews", "agreed"), [
    ([TRUE], 1, 1),
    ([FALSE], 1, 0),
    ([TRUE, TRUE, FALSE], 3, 2),
    ([TRUE, replace(TRUE, experiment="handle"), replace(FALSE, experiment="handle")], 3, 2),
    ([TRUE, replace(TRUE, experiment="reach"), replace(FALSE, experiment="follow")], 1, 1),
    ([TRUE, replace(FALSE, variant="single")], 1, 1),
    ([TRUE, grasp(False, NAN, NAN)], 1, 1),
    ([TRUE, grasp(True, 0.9, NAN)], 2, 1),  # what was never judged did not agree
])  # fmt: skip
def test_agreement_is_of_grasps_and_hand_overs_that_had_a_probability(rows, previews, agreed):
    metrics = scores(rows)
    assert (metrics["previews"], metrics["agreed"], metrics["agreement"]) == (previews, agreed, agreed / previews)
    assert (metrics["low"], metrics["high"]) == wilson(agreed, previews)


@pytest.mark.parametrize(("agreed", "count"), [
    ([], None), ([1.0], 1), ([0.0], 0), ([NAN], 0), ([1.0, 1.0, 0.0, NAN], 2), ([0.5], 0),
])  # fmt: skip
def test_only_what_was_judged_to_agree_counts_as_such(agreed, count):
    metrics = probabilities([replace(TRUE, agreed=verdict) for verdict in agreed])
    assert metrics.get("agreed") == count


def test_brier_scores_and_the_paths_median_are_of_the_same_runs():
    metrics = scores(
        [TRUE, FALSE, replace(TRUE, path_pct=NAN), replace(FALSE, path_pct=8.0), replace(TRUE, variant="cad")]
    )
    assert metrics["brier"] == pytest.approx((2 * 0.1**2 + 2 * 0.8**2) / 4)
    assert metrics["brier_base"] == pytest.approx(0.25)
    assert metrics["path_pct_median"] == 3.0


@pytest.mark.parametrize(("name", "rows", "inside"), [
    ("at_end", [reach(2.0, 1.0), reach(2.0, 2.0), reach(2.0, 3.0)], 2),
    ("after_2s", [reach(2.0, 9.0, 1.0), reach(2.0, 9.0, 3.0)], 1),
    ("after_10s", [reach(2.0, 9.0, 9.0, 1.0), reach(2.0, 9.0, 9.0, 3.0)], 1),
    ("at_end", [reach(2.0, NAN), reach(2.0, 1.0)], 1),  # a tip that is nowhere is outside
    ("at_end", [reach(2.0, NAN)], 0),
    ("at_end", [reach(2.0, 1.0), reach(NAN, 0.0)], 1),  # nothing was stated
    ("at_end", [reach(2.0, 1.0), reach(2.0, 1.0, variant="cad")], 1),
    ("at_end", [reach(2.0, 1.0), replace(reach(2.0, 1.0), experiment="follow")], 1),
    ("at_end", [replace(reach(2.0, 1.0), success=False)], 1),  # whether it touched is another matter
])  # fmt: skip
def test_coverage_is_of_reaches_with_a_radius_at_each_time(name, rows, inside):
    runs = sum(bool(row.radius_mm > 0) and not row.variant and row.experiment == "reach" for row in rows)
    low, high = wilson(inside, runs)
    expected = {"runs": runs, "inside": inside, "share": inside / runs, "low": low, "high": high}
    assert scores(rows)["coverage"][name] == expected


def test_how_many_radii_the_tip_is_off_is_told_at_each_time():
    rows = [reach(2.0, 4.0, 6.0, 8.0), reach(1.0, 3.0, 3.0, 9.0), reach(4.0, 4.0, NAN, 4.0)]
    metrics = scores(rows)
    assert list(metrics["tip_error_radii"]) == list(LATER) == ["at_end", "after_2s", "after_10s"]
    assert {name: entry["median"] for name, entry in metrics["tip_error_radii"].items()} == {
        "at_end": 2.0, "after_2s": 3.0, "after_10s": 4.0
    }  # fmt: skip
    assert metrics["radius_mm"]["median"] == 2.0


def test_radii_are_of_the_runs_for_which_one_was_stated():
    metrics = scores([reach(2.0, 1.0), reach(NAN, 0.0), reach(4.0, 5.0)])
    assert metrics["radius_mm"] == {"median": 3.0, "p95": pytest.approx(3.9)}
    assert metrics["tip_error_radii"]["at_end"]["median"] == np.median([0.5, 1.25])


def test_how_far_off_the_tip_was_beside_the_object_is_of_reaches_that_have_it():
    rows = [reach(2.0, 1.0, touching_mm=off) for off in (3.0, NAN, 5.0, 10.0)]
    assert scores(rows)["touching_mm"] == {"median": 5.0}
    assert "touching_mm" not in scores(rows[1:2])


@pytest.mark.parametrize(("rows", "keys"), [
    ([], set()),
    ([grasp(True, NAN, NAN)], set()),
    ([reach(NAN, NAN)], set()),
    ([grasp(True, 0.9, 1.0)], {"previews", "agreed", "agreement", "low", "high", "brier", "brier_base"}),
    ([reach(2.0, 1.0)], {"radius_mm", "coverage", "tip_error_radii"}),
])  # fmt: skip
def test_nothing_is_said_of_what_no_run_has(rows, keys):
    assert set(scores(rows)) == keys


def test_the_metrics_name_package_code_experiments_and_previews():
    rows = [TRUE, FALSE, replace(TRUE, experiment="handle"), reach(2.0, 4.0)]
    metrics = json.loads(json.dumps(metrics_of(RunSource("abc", "def"), rows)))
    assert (metrics["package"], metrics["code"]) == ("abc", "def")
    assert set(metrics) == {"package", "code", "grasp", "handle", "reach", "preview"}
    for key in ("agreement", "path_pct_median", "brier", "brier_base"):
        assert np.isfinite(metrics["preview"][key])
    assert "preview" not in metrics_of(RunSource("abc", "def"), [Result("follow", 0, True)])


@pytest.mark.parametrize(
    ("outcomes", "ones", "share"),
    [((1.0,), 1, 1.0), ((0.0,), 0, 0.0), ((True, False, True, True), 3, 0.75), ((0.0, 1.0, 0.0, 0.0), 1, 0.25)],
)
def test_of_outcomes_those_that_are_one_are_counted(outcomes, ones, share):
    assert share_of(outcomes) == (ones, share, *wilson(ones, len(outcomes)))


def test_what_cameras_are_worth_is_of_reaches_that_were_corrected_or_refused_to_be():
    rows = [
        reach(5.0, 1.0, off_target_mm=12.0, corrected_mm=1.5, correction="corrected"),
        reach(5.0, 1.0, off_target_mm=10.0, corrected_mm=12.0, correction="corrected"),
        reach(NAN, 1.0, off_target_mm=11.0, corrected_mm=13.1, correction="not corrected"),
        reach(5.0, 1.0, off_target_mm=1.0, corrected_mm=NAN, correction="corrected"),
        reach(5.0, 1.0),
    ]
    cameras = scores(rows)["cameras"]
    assert cameras["farther"] == 2
    assert [cameras[name]["inside"] for name in ("without", "with")] == [2, 1]
    assert (cameras["with"]["share"], cameras["with"]["low"], cameras["with"]["high"]) == (0.25, *wilson(1, 4))
    assert "cameras" not in scores(rows[-1:])
