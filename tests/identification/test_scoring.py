"""The score on trials that nothing has decided on: of which trials each of its numbers is."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.matched_plant import release, small_model, tilt
from tests.support.swings import experiment, swing
from trunkline.identification.results.scoring import Compared, evaluate, score, start_fit
from trunkline.identification.simulate.pose_fit import PoseFit

COMPARED = Compared(["static_tilt"], 30, 0.0)
ASIDE = (0.0, 0.003, 0.006)  # m, by which the tips of tilts that should be alike end apart
WIDER = np.sqrt(3 / 2)  # of three about their own mean
TIP = 3


@pytest.fixture(scope="module")
def models():
    model = small_model(4)
    stiff = model.__copy__()
    stiff.jnt_stiffness[:] *= 2
    return {"identified": model, "cad": stiff}


def aside(trial, shift: float, **changes):
    positions = trial.positions.copy()
    positions[:, TIP, 0] += shift
    return replace(trial, positions=positions, **changes)


def tilts(model, splits, session: str = ""):
    at_rest = tilt(model, 30)
    return [
        aside(at_rest, shift, name=f"{session}{number}", split=split, session=session)
        for number, (shift, split) in enumerate(zip(ASIDE, splits, strict=True))
    ]


@pytest.fixture(scope="module")
def scored(models):
    trials = tilts(models["identified"], ("identify", "identify", "test"))
    another = release(models["identified"], 0.2, "test", frames=30)
    return score(models, [*trials, another], COMPARED, 12)


def test_how_well_the_arm_repeats_itself_is_of_all_trials_and_of_its_tip(scored):
    """Two of the three are to identify from: those that are tested alone would say nothing."""
    table = scored[0]["repeatability_mm"]["static_tilt"]
    assert (table["trials"], table["groups"]) == (3, 1)
    assert table["tip_mm"] == pytest.approx((3 + 0 + 3) / 3 * WIDER)


def test_errors_are_of_the_tested_trials_of_the_compared_kinds_alone(scored):
    metrics, predictions = scored
    assert set(predictions) == {"identified", "cad", "null", "null_straight", "noise_floor"}
    for name in predictions:
        assert set(metrics[name]) == {"test"}
        assert metrics[name]["test"]["trials"] == 1
        assert set(metrics[name]["test"]["by_experiment"]) == {"static_tilt"}
        assert [e.split for e in predictions[name].experiments] == ["test"]
    assert metrics["identified"]["test"]["e_tip_mm"] == pytest.approx(6, abs=0.5)
    assert metrics["cad"]["test"]["e_position_mm"] > 2 * metrics["identified"]["test"]["e_position_mm"]


def test_the_null_model_rests_where_trials_to_identify_from_do(scored):
    """In the middle of 0 and 3 mm, from which 6 mm are 4.5 away; in the mean of all it would be 3."""
    assert scored[0]["null"]["test"]["e_tip_mm"] == pytest.approx(4.5)


def test_the_noise_floor_and_the_start_fit_are_of_the_tested_trials(scored):
    metrics = scored[0]
    assert metrics["noise_floor_mm"] == metrics["noise_floor"]["test"]["e_position_mm"] > 0.3  # a tip that is off alone
    assert metrics["start_fit"]["mean_mm"] > 0.3
    assert metrics["start_fit"]["unconverged"] == 0


@pytest.mark.parametrize("splits", [("identify",) * 3, ("identify", "validate", "validate")])
def test_without_trials_to_test_nothing_is_scored(models, splits):
    assert score(models, tilts(models["identified"], splits), COMPARED, 12) == ({}, {})


def test_an_evaluation_is_of_all_trials_and_of_each_session(models):
    model = models["identified"]
    splits = ("identify", "validate", "test")
    trials = [*tilts(model, splits, "a"), *tilts(model, splits, "b")]
    trials[4] = aside(trials[4], 0.03)
    metrics, _ = evaluate({"model": model, "cad": models["cad"]}, trials, 30, 0.0)
    assert metrics["model"]["trials"] == 6
    assert set(metrics["by_session"]) == {"a", "b"}
    assert [metrics["by_session"][name]["model"]["trials"] for name in "ab"] == [3, 3]
    assert metrics["by_session"]["a"]["repeatability_mm"]["static_tilt"]["tip_worst_mm"] == pytest.approx(3 * WIDER)
    assert metrics["by_session"]["b"]["repeatability_mm"]["static_tilt"]["tip_worst_mm"] > 15
    assert metrics["repeatability_mm"]["static_tilt"]["groups"] == 2
    floors = [metrics["by_session"][name]["noise_floor_mm"] for name in "ab"]
    assert metrics["noise_floor_mm"] == pytest.approx(np.mean(floors))
    assert floors[1] > 2 * floors[0]
    alone, _ = evaluate({"model": model}, trials[:3], 30, 0.0)
    assert "by_session" not in alone


def test_the_start_fit_is_of_measured_markers_and_counts_what_did_not_converge():
    fits = [
        ("release", PoseFit(np.zeros(6), np.array([1e-3, np.nan, 3e-3]), 9, True)),
        ("curl", PoseFit(np.zeros(6), np.array([6e-3, 4e-3, 8e-3]), 300, False)),
    ]
    table = start_fit([experiment(swing(), kind=kind, fit=fit) for kind, fit in fits])
    assert table == {
        "mean_mm": pytest.approx((2 + 6) / 2),
        "max_mm": pytest.approx(8),
        "unconverged": 1,
        "by_experiment": {
            "curl": {"mean_mm": pytest.approx(6), "max_mm": pytest.approx(8)},
            "release": {"mean_mm": pytest.approx(2), "max_mm": pytest.approx(3)},
        },
    }
