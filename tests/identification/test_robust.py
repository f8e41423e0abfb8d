"""One bad trial must not decide: it counts less, it is named, and what is wrong with it is said."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.matched_plant import markers_of, release, small_model, tilt
from tests.support.noisy_trials import WEIGHTS, measured, with_values
from trunkline.identification.diagnostics.trial_diagnostics import moving_start, trial_diagnostics
from trunkline.identification.fit.fit import CoarseSearch, Fit, Method, Refinement
from trunkline.identification.fit.identify import identify
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.robust import robust_loss, trial_weights, usual_losses
from trunkline.identification.simulate.experiment import prepare

UNITS, FRAMES, LATE = 3, 40, 10
METHOD = Method(
    LeastSquares(3, 1, 5, 1e-2), CoarseSearch(1.0, FRAMES, 4), Refinement(8, 1e-5),
    LeastSquares(0, 1, 1, 1.0), 0.1, np.inf, seed=1,
)
TRUE = {"release": {"damping": 0.07}, "static_tilt": {"stiffness": 2.0}}
PLANT = small_model(UNITS)


def session(kind: str) -> list:
    """Six trials of a plant whose parameter is known."""
    rng, plant = np.random.default_rng(3), with_values(PLANT, TRUE[kind])
    if kind == "static_tilt":
        return [measured(replace(tilt(plant, a), name=f"tilt_{a}"), rng) for a in (30, 40, 55, 65, 80, 90)]
    bends = np.linspace(0.15, 0.35, 6) * np.resize([1, -1], 6)
    trials = [replace(release(plant, bend, frames=FRAMES + LATE), name=f"release_{i}") for i, bend in enumerate(bends)]
    return [measured(trial, rng) for trial in trials]


def dated_early(trial):
    """As if the arm had been held for `LATE` frames more."""
    still = np.repeat(trial.positions[:1], LATE, axis=0)
    return replace(trial, positions=np.concatenate([still, trial.positions[:-LATE]]))


def exchanged(trial):
    order = [2, 1, 0]
    return replace(trial, positions=trial.positions[:, order], quaternions=trial.quaternions[:, order])


def turned(trial):
    return replace(trial, gravity=Rotation.from_rotvec([0, np.radians(30), 0]).apply(trial.gravity))


def fitted(trials, outlying=4.0):
    """Values, the influence, and what is said of the trials."""
    kind = trials[0].experiment
    experiments = [prepare(trial, PLANT, FRAMES) for trial in trials]
    bounds = {name: Bounds(value / 10, value * 10) for name, value in TRUE[kind].items()}
    fit = Fit(markers_of(PLANT), bounds, (), "positions", replace(WEIGHTS, outlying=outlying), METHOD)
    result = identify("test", PLANT, experiments, fit)
    reasons = result.influence.deciding()
    for trial, experiment in zip(trials, experiments, strict=True):
        if trial.name in reasons:
            reasons[trial.name] += trial_diagnostics(trial, experiment, experiments, result.models["identified"], fit)
    return next(iter(result.values.values())), result, reasons


CLEAN = {kind: session(kind) for kind in TRUE}


@cache
def fitted_clean(kind):
    return fitted(CLEAN[kind])


@pytest.mark.parametrize("kind", TRUE)
def test_a_session_without_a_bad_trial_is_fitted_as_ever(kind):
    value, result, reasons = fitted_clean(kind)
    assert (result.influence.weights == 1).all()
    assert not reasons
    assert value == pytest.approx(fitted(CLEAN[kind], outlying=1e9)[0], rel=1e-6)
    assert result.starts >= 2
    assert result.agreeing == result.starts


@pytest.mark.parametrize(
    ("kind", "spoil", "says"),
    [
        ("release", dated_early, "later fits better"),
        ("static_tilt", exchanged, "look exchanged"),
        ("static_tilt", turned, "gravity"),
    ],
)
@pytest.mark.parametrize("which", [1, 4])
def test_one_spoilt_trial_is_named_and_decides_nothing(kind, spoil, says, which):
    trials = list(CLEAN[kind])
    trials[which] = spoil(trials[which])
    (true,) = TRUE[kind].values()
    clean, (value, result, reasons), (plain, _, _) = fitted_clean(kind)[0], fitted(trials), fitted(trials, outlying=1e9)
    assert set(reasons) == {trials[which].name}
    assert any(says in sentence for sentence in reasons[trials[which].name]), reasons
    assert np.argmin(result.influence.weights) == which
    assert abs(np.log(value / clean)) < 0.25 * abs(np.log(plain / clean)) + 0.01
    assert value == pytest.approx(true, rel=0.1)


def test_weights_are_the_derivatives_of_the_robust_loss():
    losses, usual = np.array([0.5, 1.0, 3.9, 4.1, 20.0]), np.ones(5)
    step = 1e-6
    for index, weight in enumerate(trial_weights(losses, usual, 4.0)):
        more = losses + step * (np.arange(5) == index)
        slope = (robust_loss(more, usual, 4.0) - robust_loss(losses, usual, 4.0)) / step
        assert slope == pytest.approx(weight, abs=1e-5)


def test_what_is_usual_is_told_by_trials_of_the_same_kind_and_by_three_at_least():
    losses = np.array([1.0, 2.0, 30.0, 100.0, 200.0])
    usual = usual_losses(losses, ["tilt", "tilt", "tilt", "curl", "curl"], np.ones(5))
    np.testing.assert_array_equal(usual, [2, 2, 2, np.inf, np.inf])
    assert trial_weights(losses, usual, 4.0).tolist() == pytest.approx([1, 1, (8 / 30) ** 2, 1, 1])


def test_a_trial_that_bends_the_arm_farther_may_be_farther_off():
    """Errors of 5 % of the bend in every trial: none is outlying, and a shallow one may be as far off as the median."""
    bends = np.array([1.0, 4.0, 9.0, 64.0]) * 1e-4
    usual = usual_losses(0.05**2 * bends, ["curl"] * 4, bends)
    assert trial_weights(0.05**2 * bends, usual, 4.0).tolist() == [1, 1, 1, 1]
    assert usual[0] == usual[1] == pytest.approx(0.05**2 * 6.5e-4)
    assert trial_weights(np.full(4, 0.05**2 * 64e-4), usual, 4.0)[0] < 0.2


def test_a_hand_that_swings_is_told():
    """The start moves on from a hand that swings, so what is said of it is one of two."""
    trial = replace(release(PLANT, 0.3, frames=30), start=10 / 120)
    swayed = trial.positions + 0.2 * np.arange(30)[:, None, None] / 120 * [1, 0, 0]  # m, at 0.2 m/s
    swayed = replace(trial, positions=swayed)
    suspicion = moving_start(swayed, prepare(swayed, PLANT, 20))
    assert any(words in suspicion for words in ("in motion", "when it is let go"))
