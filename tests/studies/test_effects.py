"""The study of effects: what a model without an effect has, and what the errors of the chosen one stand beside."""

from types import SimpleNamespace

import numpy as np
import pytest

from studies import effects
from studies.effects import EFFECTS, NO_LAG, cad_model, settings_of, tried, validated
from studies.rows import Rows
from studies.stage_chain import StageChain
from tests.support.matched_plant import curl, markers_of, small_model
from trunkline.identification.simulate.experiment import prepare
from upkeep.origin import Origin


def test_the_lag_of_the_motors_is_tried_after_their_dead_time():
    names = list(EFFECTS)
    assert names.index("lag") == names.index("dead_time") + 1
    assert EFFECTS["lag"].stage == "identify_control"
    assert "time_constant" not in settings_of("identify_control", []).parameters
    assert "time_constant" in settings_of("identify_control", [EFFECTS["lag"]]).parameters


@pytest.mark.parametrize(("names", "lag"), [([], NO_LAG), (["dead_time"], NO_LAG), (["dead_time", "lag"], 0.02)])
def test_without_the_effect_motors_follow_at_once(names, lag):
    model = cad_model([EFFECTS[name] for name in names])
    assert (model.actuator_dynprm[:, 0] == lag).all()
    assert bool(model.nhistory) == ("dead_time" in names)


def test_errors_stand_beside_null_model_cad_model_and_noise_floor():
    plant, model, cad = small_model(4), small_model(4), small_model(4)
    model.jnt_stiffness[:] *= 1.1
    cad.jnt_stiffness[:] *= 3
    trials = [curl(plant, 20, split, frames=60, noise=1e-4) for split in ("identify", "validate")]
    experiments = [prepare(trial, model, 60) for trial in trials]
    link = StageChain(model, experiments, SimpleNamespace(markers=markers_of(model)), [], None)
    (row,) = validated("this", link, trials, cad)
    title, kind, _, position, tip, percent, null, guess, floor = row.strip("| ").split(" | ")
    assert (title, kind) == ("this", "curl")
    assert 0 < float(floor) < float(tip) < float(guess)
    assert 0 < float(position) < float(tip) < float(null)
    assert float(percent) == pytest.approx(float(tip) / 5.07, abs=0.01)  # of 507 mm


WORTH = {"hardening": 1.0, "round": -0.5, "place": 0.25, "branch": 0.5}  # mm by which an effect lowers every error


def test_an_effect_is_kept_if_it_pays_and_is_not_tried_twice(monkeypatch, tmp_path):
    fits = []

    def left_out(kept, stage):
        fits.append((stage, len(kept)))
        noise = 0.1 * np.array([-1, 1, 0]) * len(kept)
        return 5.0 - sum(WORTH[name] for name in WORTH if EFFECTS[name] in kept) + noise

    monkeypatch.setattr(effects, "left_out", left_out)
    monkeypatch.setattr(effects, "chain", lambda kept, stage, chains: kept)
    table = Rows("effects", "arm", "effect", tmp_path, Origin("aaaaaaa", "", {}))
    kept = tried(["hardening", "round", "place"], table, {})
    assert kept == [EFFECTS["hardening"], EFFECTS["place"]]
    assert fits == [("identify_stiffness", number) for number in (0, 1, 2, 2)]
    rows = table.read()
    assert [(row["kept"], row["gain"], row["without"]) for row in rows.values()] == [
        ("yes", pytest.approx(1.0), pytest.approx(5.0)),
        ("no", pytest.approx(-0.5), pytest.approx(4.0)),
        ("yes", pytest.approx(0.25), pytest.approx(4.0)),
    ]
    fits.clear()
    assert tried(list(WORTH), table, {}) == [*kept, EFFECTS["branch"]]
    assert fits == [("identify_damping", 2), ("identify_damping", 3)]
    assert list(table.read()) == list(WORTH)
