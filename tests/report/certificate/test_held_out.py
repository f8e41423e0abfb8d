"""What a certificate takes from trials of several sessions, and how far drawn parameters move the tip."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.report.certificate.test_budget import mounts, nothing_known, straight
from tests.support.matched_plant import small_model, static_pull
from trunkline.kinematics.residual import residual_map
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.recordings.trials.trial import Trial
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
    np.testing.assert_allclose(held_out.tip_residuals(first, trials, 3), np.zeros((3, 3)), atol=1e-3)
    others = [replace(trial, session="b" if trial.session == "a" else "a") for trial in trials]
    assert np.linalg.norm(held_out.tip_residuals(first, others, 3), axis=1).min() > 3e-3


def test_without_parameters_no_draw_moves_the_tip_and_little_doubt_moves_it_little():
    model, rng = small_model(3), np.random.default_rng(0)
    arm, poses = arm_of(model), straight(model)
    none = parameter_shifts(model, nothing_known(), arm, poses, 5, rng)
    assert (none.shape, none.any()) == ((5, len(poses), 3), np.False_)
    some = parameter_shifts(model, mounts(0.0), arm, poses, 5, rng)
    assert some.shape == (5, len(poses), 3)
    assert 0 < np.abs(some).max() < 0.1 * np.linalg.norm(arm.placed(arm.rest(poses)))


SHIFT = np.array([0.004, -0.003, 0.002])  # m, in the frame of the mount


def aside(trial: Trial, turn: np.ndarray, rng: np.random.Generator) -> Trial:
    """The same with its last marker seen elsewhere by SHIFT, and a little noise of the arm."""
    positions = trial.positions.copy()
    positions[:, -1] += turn @ (SHIFT + 2e-4 * rng.standard_normal(3))
    return replace(trial, positions=positions)


def posed_trials(model, count: int) -> list[Trial]:
    """Two neighbouring motors pull, no two trials alike, though gravity may leave a cable slack that is drawn in."""
    levels = (3.0, 7.0, 11.0, 15.0, 19.0)
    pulls = [[*pair[:i], 0.0, *pair[i:]] for pair in product(levels, levels) for i in range(3)]
    trials = [replace(static_pull(model, pull, split=VALIDATE), name=f"pose_{i}") for i, pull in enumerate(pulls)]
    groups = arm_of(model).resting(held_out.posed(trials, model)).repeats()
    assert len(groups) >= count
    return [trials[rows[0]] for rows in groups[:count]]


@pytest.fixture(scope="module")
def turned():
    """A small arm whose mount is turned in the tracked base."""
    model = small_model(4)
    quaternion = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_quat(scalar_first=True)
    model.body_quat[model.body("base").id] = quaternion
    return model


def test_poses_that_are_held_out_tell_where_the_tip_is_and_how_far_it_is_missed_then(turned):
    rng, arm = np.random.default_rng(0), arm_of(turned)
    trials = [aside(trial, arm.turn, rng) for trial in posed_trials(turned, 20)]
    residuals = held_out.tip_residuals(turned, trials, 3)
    np.testing.assert_allclose(np.median(residuals, axis=0), SHIFT, atol=3e-4)  # one rests in another shape
    poses = held_out.posed(trials, turned)
    learnt, missed = held_out.learnt_from(turned, poses, residuals)
    assert learnt is not None
    assert np.median(np.linalg.norm(missed, axis=1)) < 0.3 * np.linalg.norm(SHIFT)
    np.testing.assert_array_equal(missed, learnt.left_out())
    apart = arm.shift(learnt, poses) - residuals @ arm.turn.T
    assert np.median(np.linalg.norm(apart, axis=1)) < 1e-3
    np.testing.assert_allclose(arm.resting(poses).gravity, [arm.turn.T @ gravity for gravity in poses.gravity])
    none, same = held_out.learnt_from(turned, poses[:14], residuals[:14])
    assert none is None
    np.testing.assert_array_equal(same, residuals[:14])
    noise = 1e-3 * rng.standard_normal((20, 3))
    none, same = held_out.learnt_from(turned, poses, noise)
    assert none is None
    np.testing.assert_array_equal(same, noise)


def test_of_many_poses_the_others_are_missed_by_what_the_map_leaves(turned, monkeypatch):
    monkeypatch.setattr(held_out, "MOST", 13)
    monkeypatch.setattr(residual_map, "FEWEST", 13)
    rng = np.random.default_rng(1)
    poses = held_out.posed(posed_trials(turned, 25), turned)
    residuals = SHIFT + 2e-4 * rng.standard_normal((25, 3))
    learnt, missed = held_out.learnt_from(turned, poses, residuals)
    assert learnt is not None
    assert len(learnt.poses) == 13
    np.testing.assert_allclose(missed[::2], learnt.left_out())
    resting = arm_of(turned).resting(poses[1::2])
    np.testing.assert_allclose(missed[1::2], residuals[1::2] - learnt.mean(resting))


def test_poses_that_were_repeated_count_once_and_are_missed_as_others_foresee_them(turned):
    rng = np.random.default_rng(2)
    poses = held_out.posed(posed_trials(turned, 16), turned)
    repeated = poses[np.repeat(np.arange(16), 3)]
    residuals = np.tile(SHIFT, (16, 1)) + 1e-3 * rng.standard_normal((16, 3))
    thrice = np.repeat(residuals, 3, axis=0) + 1e-4 * rng.standard_normal((48, 3))
    learnt, missed = held_out.learnt_from(turned, repeated, thrice)
    once, alone = held_out.learnt_from(turned, poses, thrice.reshape(16, 3, 3).mean(axis=1))
    assert learnt is not None
    assert len(learnt.poses) == len(once.poses) == 16
    np.testing.assert_allclose(missed.reshape(16, 3, 3).mean(axis=1), alone, atol=1e-9)
    few, same = held_out.learnt_from(turned, poses[np.repeat(np.arange(5), 4)], np.repeat(residuals[:5], 4, axis=0))
    assert few is None
    assert len(same) == 20


def test_a_pose_in_which_the_twin_finds_no_rest_teaches_nothing(turned, monkeypatch):
    rng = np.random.default_rng(3)
    poses = held_out.posed(posed_trials(turned, 18), turned)
    residuals = SHIFT + 2e-4 * rng.standard_normal((18, 3))
    arm = arm_of(turned)

    class Lost(type(arm)):
        def rest(self, poses, near=None):
            rest = super().rest(poses, near)
            rest.converged[:1] = False
            rest.commands[:1] = 0.0
            return rest

    monkeypatch.setattr(held_out, "arm_of", lambda model: Lost(**vars(arm)))
    learnt, missed = held_out.learnt_from(turned, poses, residuals)
    assert len(learnt.poses) == 17
    assert learnt.largest < 0.03
    np.testing.assert_array_equal(missed[0], residuals[0])
