"""The study of one spoilt trial counts what it says, of the whole arm and of the tip, and goes on where it stopped."""

from dataclasses import replace

import numpy as np
import pytest

from studies import spoilt
from studies.rows import Rows
from studies.spoilt import SPOILS, Found, PlainFit
from tests.identification.test_robust import METHOD, PLANT, TRUE, WEIGHTS, exchanged, session
from tests.support.matched_plant import release, segments_of, small_model, tilt
from trunkline.identification.fit.identify import identify, values_of
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.uncertainty.trial_diagnostics import moving_start
from upkeep.origin import Origin

CLEAN = Found(position=2.0, tip=5.0, plain_position=2.0, plain_tip=5.0, told={})


@pytest.fixture
def told_of(monkeypatch, tmp_path):
    """A study of made-up trials, whose searches note here what they are asked for."""
    model, asked = small_model(4), []
    kinds = {"identify_damping": release, "identify_stiffness": tilt}
    shown = {
        stage: [kind(model, 30 if kind is tilt else 0.2, split, seed=seed)
                for seed, split in enumerate(("identify", "identify", "validate"))]
        for stage, kind in kinds.items()
    }  # fmt: skip

    def found(stage, trials):
        is_spoilt = any(trial.level == 99 for trial in trials)
        asked.append((stage, is_spoilt))
        return Found(2.1, 6.0, 2.1, 9.0, {}) if is_spoilt else CLEAN

    monkeypatch.setattr(spoilt, "found", found)
    monkeypatch.setattr(spoilt, "require_demo", lambda path: None)
    monkeypatch.setattr(spoilt, "digest", lambda *told: "arm")
    monkeypatch.setattr(spoilt, "clean_trials", lambda stage: list(shown[stage]))
    monkeypatch.setattr(spoilt, "Rows", lambda *told: Rows(*told, tmp_path, Origin("aaaaaaa", "", {})))
    spoils = tuple(replace(spoil, change=lambda trial, rng: replace(trial, level=99)) for spoil in SPOILS)
    monkeypatch.setattr(spoilt, "SPOILS", spoils)
    return asked


def run(monkeypatch, capsys, sessions):
    monkeypatch.setattr("sys.argv", ["spoilt", "--sessions", str(sessions)])
    assert spoilt.main() == 0
    return capsys.readouterr().out.splitlines()


def test_a_tip_that_a_spoilt_trial_moves_is_seen_beside_a_mean_that_it_does_not(monkeypatch, capsys, told_of):
    lines = run(monkeypatch, capsys, 2)
    assert "identify_damping without a spoilt trial: position 2.000 mm, tip 5.000 mm; named: none" in lines
    rows = [line for line in lines if line.startswith(("| 0 |", "| 1 |"))]
    assert [row.split(" | ")[3:7] for row in rows] == [["1.050", "1.200", "1.050", "1.800"]] * 2
    assert lines[-1] == "within 10 % of the clean session: 2 by position and 0 by tip of 2; named: 0; rightly: 0"


def test_sessions_that_are_done_are_not_searched_again(monkeypatch, capsys, told_of):
    first = run(monkeypatch, capsys, 1)
    assert told_of == [("identify_stiffness", False), ("identify_damping", False), ("identify_damping", True)]
    told_of.clear()
    assert run(monkeypatch, capsys, 1) == first
    assert told_of == []
    assert [line[:5] for line in run(monkeypatch, capsys, 2) if line.startswith("| ")] == ["| ses", "| 0 |", "| 1 |"]
    assert told_of == [("identify_stiffness", True)]


@pytest.mark.parametrize("kind", ["static_tilt", "release"])
def test_before_trials_are_weighed_the_search_is_where_one_without_weights_ends(kind):
    trials = session(kind)
    trials[3] = exchanged(trials[3])
    experiments = [prepare(trial, PLANT, 40) for trial in trials]
    bounds = {name: Bounds(value / 10, value * 10) for name, value in TRUE[kind].items()}
    ends = {}
    for outlying in (4.0, 1e9):
        weights = replace(WEIGHTS, outlying=outlying)
        fit = PlainFit(segments_of(PLANT), bounds, (), "positions", weights, METHOD)
        ends[outlying] = identify("test", PLANT, experiments, fit).values, values_of(bounds, fit.plain.vector)
    assert ends[4.0][0] != ends[1e9][0]
    assert ends[1e9][1] == ends[1e9][0]
    # which goes on to where a second-order model has its minimum, for less than a step of the polish
    assert ends[4.0][1] == pytest.approx(ends[1e9][1], rel=2e-3)


def test_a_hand_that_swings_is_told_in_the_words_of_the_stage():
    """Where the start moves on from a hand that swings, and where the arm is simulated from rest all the same."""
    (swinging,) = (spoil for spoil in SPOILS if spoil.title == "swinging start")
    trial = replace(release(PLANT, 0.3, frames=30), start=10 / 120)
    swayed = trial.positions + 0.2 * np.arange(30)[:, None, None] / 120 * [1, 0, 0]  # m, at 0.2 m/s
    swayed = replace(trial, positions=swayed)
    said = moving_start(swayed, prepare(swayed, PLANT, 20))
    assert swinging.is_told(said)
    assert not swinging.is_told("starting it 0.10 s later fits better")
