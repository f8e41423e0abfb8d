"""Tuning every joint on a few trials: a gain that is real shows on trials left out, one that fits noise does not."""

import numpy as np
import pandas as pd
import pytest

from tests.support.matched_plant import markers_of, small_model, tilt
from tests.support.noisy_trials import WEIGHTS
from trunkline.identification.diagnostics.cross_validation import ERRORS, cross_validate
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.fit import CoarseSearch, Fit, Method, Refinement
from trunkline.identification.fit.identify import identify
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import PARAMETERS, candidate_fields, set_fields
from trunkline.identification.simulate.experiment import prepare

METHOD = Method(
    LeastSquares(0, 1, 3, 1e-2), CoarseSearch(1.0, 1, 99), Refinement(4, 1e-4),
    LeastSquares(0, 1, 3, 1e-2), 0.2, np.inf, seed=1,
)


PATTERN = np.array([0.012, -0.15, 0.15, 0.15])  # in sum it leaves the stiffness of the whole arm where it is


def errors(first: np.ndarray, second: np.ndarray) -> tuple[dict, dict]:
    """Mean position errors, mm, before and after per-joint tuning: of a trial fitted alone, and of trials left out.

    Args:
        first, second: factors of the plant's joints in each of two static trials. Shape (4,).
    """
    model, experiments = small_model(4), []
    for angle, factors in ((80, first), (90, second)):
        truth = model.__copy__()
        set_fields(truth, candidate_fields(model, {}, {"stiffness": factors[None]}))
        experiments.append(prepare(tilt(truth, angle), model, 1))
    markers, stiffness = markers_of(model), PARAMETERS["stiffness"].read(model)
    bounds = {"stiffness": Bounds(0.5 * stiffness, 2 * stiffness)}
    fit = Fit(markers, bounds, ("stiffness",), "positions", WEIGHTS, METHOD)
    alone = identify("test", model, experiments[:1], fit)
    fitted = {}
    for name in ("coarse", "identified"):
        replayed = replay(alone.models[name], experiments[:1], markers)
        fitted[name] = scores(replayed, experiments[:1], "positions", WEIGHTS)["identify"]["e_position_mm"]
    left_out = cross_validate("test", alone, experiments, fit, folds=2)
    return fitted, {name: table["e_position_mm"] for name, table in left_out.items()}


def test_factors_that_only_fit_a_trial_are_worse_on_trials_left_out():
    """Joints that scatter around the model from trial to trial: nothing of it holds for the next one."""
    fitted, left_out = errors(1 + PATTERN, 1 - PATTERN)
    assert fitted["identified"] < 0.5 * fitted["coarse"]
    assert left_out["identified"] > 1.2 * left_out["coarse"]


def test_factors_of_the_plant_are_better_on_trials_left_out():
    fitted, left_out = errors(1 + PATTERN, 1 + PATTERN)
    assert fitted["identified"] < 0.5 * fitted["coarse"]
    assert left_out["identified"] < 0.5 * left_out["coarse"]


def error_table(predictions: dict) -> pd.DataFrame:
    """As `trial_table`, with the number of trials left out with it for the E_internal of each."""
    rows = [{"model": name, "e_internal_mm": float(len(prediction.experiments))} | dict.fromkeys(ERRORS[1:], 1.0)
            for name, prediction in predictions.items() for _ in prediction.experiments]  # fmt: skip
    return pd.DataFrame(rows)


def test_every_trial_is_left_out_once(monkeypatch):
    """Errors are means over all trials, so folds of unequal size do not weigh more than their trials."""
    model = small_model(4)
    trials = [prepare(tilt(model, angle), model, 1) for angle in (30, 60, 90)]
    calls = []
    module = "trunkline.identification.diagnostics.cross_validation"
    monkeypatch.setattr(f"{module}.identify", lambda *args: type("Found", (), {"models": result.models})())
    monkeypatch.setattr(f"{module}.replay", lambda model, left, markers: calls.append([e.name for e in left]) or left)
    monkeypatch.setattr(f"{module}.trial_table", lambda predictions: error_table(predictions))
    result = type("Result", (), {"models": {"coarse": model, "identified": model}})()
    table = cross_validate("test", result, trials, Fit((), {}, (), "positions", WEIGHTS, METHOD), folds=2)
    assert calls[::2] == [[trials[0].name, trials[2].name], [trials[1].name]]
    assert table["coarse"]["e_internal_mm"] == pytest.approx((2 * 2 + 1 * 1) / 3)
