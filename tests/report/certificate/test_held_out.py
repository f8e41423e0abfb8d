"""What a certificate takes from trials of several sessions, and how far drawn parameters move the tip."""

from dataclasses import replace

import numpy as np
import pytest

from tests.report.certificate.test_budget import mounts, nothing_known, straight
from tests.support.matched_plant import small_model, static_pull
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.report.certificate import held_out
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.budget import parameter_shifts


def test_each_trial_is_held_against_the_arm_of_its_own_session(monkeypatch):
    first = small_model(4)
    second = first.__copy__()
    second.jnt_stiffness[:] *= 2
    monkeypatch.setattr(held_out, "model_in", lambda session, _: {"a": first, "b": second}[session])
    trials = [
        replace(static_pull(model, pulls, split=VALIDATE), session=session)
        for session, model, pulls in (("a", first, [0, 15, 0]), ("b", second, [0, 15, 0]), ("a", first, [15, 0, 0]))
    ]
    assert held_out.tip_residuals(first, trials, 3) == pytest.approx([0, 0, 0], abs=1e-3)
    others = [replace(trial, session="b" if trial.session == "a" else "a") for trial in trials]
    assert held_out.tip_residuals(first, others, 3).min() > 3e-3


def test_without_parameters_no_draw_moves_the_tip_and_little_doubt_moves_it_little():
    model, rng = small_model(3), np.random.default_rng(0)
    arm, poses = arm_of(model), straight(model)
    none = parameter_shifts(model, nothing_known(), arm, poses, 5, rng)
    assert (none.shape, none.any()) == ((5, len(poses), 3), np.False_)
    some = parameter_shifts(model, mounts(0.0), arm, poses, 5, rng)
    assert some.shape == (5, len(poses), 3)
    assert 0 < np.abs(some).max() < 0.1 * np.linalg.norm(arm.placed(arm.rest(poses)))
