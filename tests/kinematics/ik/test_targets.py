"""How hard the score is: which targets are drawn, and which of them are left out."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.kinematics.ik import as_controls
from trunkline.kinematics.ik.as_controls import AsControls, draw_commands, draw_targets, score

ANGLES = np.radians([[0.0], [60.0]])
DEEPEST = np.array([0.01, 0.02, 0.03])  # m
MANY = 600


def at_rest(count, tensions=0.0, rested=True):
    """Of so many poses at the mount: what `settle` says."""
    return SimpleNamespace(
        position=np.zeros((count, 3)), quaternion=np.tile([1.0, 0, 0, 0], (count, 1)),
        tensions=np.resize(tensions, (count, 3)).astype(float), rested=np.resize(rested, count),
    )  # fmt: skip


@pytest.fixture
def rests(monkeypatch):
    """Makes every drawn pose come to rest with these tensions (B, K), N, after so many seconds (B,)."""

    def say(tensions, seconds):
        def settle(model, commands, gravity, patience=20.0, tip_site="tip"):
            return at_rest(len(commands), tensions, np.asarray(seconds) <= patience)

        monkeypatch.setattr(as_controls, "settle", settle)

    return say


def drawn(model, chain, count):
    return draw_targets(model, chain, ANGLES, DEEPEST, count, np.random.default_rng(0)).counts()


@pytest.mark.parametrize(
    ("share", "retained"),
    [(0.0, True), (0.5, True), (0.9, True), (0.94, True), (as_controls.NEAR_LIMIT, False), (0.96, False), (1.0, False),
     (1.2, False), (np.nan, False)],
)  # fmt: skip
@pytest.mark.parametrize("motor", range(3))
def test_only_poses_in_which_a_motor_is_all_but_at_its_limit_are_left_out(model, chain, rests, share, retained, motor):
    """There other commands hold the same pose. Up to there a target may be as hard as it likes."""
    tensions = 0.1 * chain.max_tension
    tensions[motor] = share * chain.max_tension[motor]
    rests(tensions, 1.0)
    assert drawn(model, chain, 2) == {
        "targets": 2 * retained, "left_out": {"near_limit": 2 * (not retained), "unrested": 0},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("seconds", "retained"), [(0.1, True), (2.0, True), (14.0, True), (16.0, False), (np.inf, False)]
)
def test_a_pose_that_takes_long_to_rest_is_a_target_too(model, chain, rests, seconds, retained):
    rests(np.zeros(3), seconds)
    assert drawn(model, chain, 2) == {
        "targets": 2 * retained, "left_out": {"near_limit": 0, "unrested": 2 * (not retained)},
    }  # fmt: skip


def test_what_neither_rested_nor_stayed_below_its_limit_is_left_out_once(model, chain, rests):
    rests(chain.max_tension, np.inf)
    assert drawn(model, chain, 3) == {"targets": 0, "left_out": {"near_limit": 0, "unrested": 3}}


def test_a_real_arm_leaves_out_none_for_want_of_time(model, chain):
    counts = draw_targets(model, chain, ANGLES, np.full(3, 0.01), 12, np.random.default_rng(0)).counts()
    assert counts["left_out"]["unrested"] == 0


def pulls_of(chain, others_pay_out=True, count=MANY):
    rng = np.random.default_rng(1)
    gravities, commands = draw_commands(chain, ANGLES, DEEPEST, count, rng, others_pay_out)
    return gravities, (chain.straight_lengths - commands) / DEEPEST


def test_one_or_two_neighbours_pull_and_the_others_pay_out(chain):
    gravities, shares = pulls_of(chain)
    pulling = shares > 0
    assert set(pulling.sum(axis=1).tolist()) == {1, 2}
    assert 0.4 < (pulling.sum(axis=1) == 2).mean() < 0.6
    np.testing.assert_array_less(shares[~pulling] * np.resize(DEEPEST, shares.shape)[~pulling], -0.9 * chain.length)
    for pattern in ((0, 1), (1, 2), (0, 2), (0,), (1,), (2,)):
        expected = np.isin(range(3), pattern)
        assert 0.1 < (pulling == expected).all(axis=1).mean() < 0.25
    assert gravities.min() < 0.05 < 0.95 * ANGLES.max() < gravities.max() <= ANGLES.max()


def test_pulls_are_even_from_none_to_the_deepest(chain):
    _, shares = pulls_of(chain)
    pulls = shares[shares > 0]
    assert 0.98 < pulls.max() <= 1
    counts = np.histogram(pulls, bins=5, range=(0, 1))[0]
    assert counts.min() > 0.75 * counts.mean()


def test_where_none_pays_out_the_others_stay(chain):
    _, shares = pulls_of(chain, others_pay_out=False)
    assert (shares >= 0).all()
    assert (shares == 0).sum() > MANY


def test_the_score_asks_for_nearly_all_that_the_samples_reach(model, chain, monkeypatch):
    """Pulls up to four fifths of their deepest, where two of them are near the motors' limits; where all motors pull, a
    fifth, and no motor pays out. With less, targets would be near the straight arm, and the score better."""
    asked = []

    def settle(model, commands, *rest):
        asked.append((chain.straight_lengths - commands) / DEEPEST)
        return at_rest(len(commands))

    def drive(model, commands, *rest, **more):
        count = len(commands)
        return SimpleNamespace(end=np.zeros((count, 3)), seconds_to_rest=np.zeros(count), rested=np.ones(count, bool))

    def ask(poses):
        commands = np.tile(chain.straight_lengths, (len(poses), 1))
        return {"commands": commands, "doubtful": np.zeros(len(poses), bool)}

    monkeypatch.setattr(as_controls, "settle", settle)
    monkeypatch.setattr(as_controls, "drive", drive)
    settings = AsControls(targets=MANY, timed=1, sent=1, on_rig=1, seconds=1.0)
    score(model, chain, ask, ANGLES, DEEPEST, settings, np.random.default_rng(0))
    targets, taut = asked[:2]
    assert len(targets) == MANY
    assert len(taut) == MANY // 8
    assert 0.75 < targets.max(axis=0).min() <= targets.max() <= 0.8 + 1e-9
    assert (targets < 0).any(axis=1).all()
    pulls = targets[targets > 0]
    assert np.median(pulls) == pytest.approx(0.4, abs=0.05)
    assert (pulls > 0.4).mean() > 0.4, "as many deep pulls as shallow ones"
    assert 0.15 < taut.max() <= 0.2 + 1e-9
    assert (taut >= 0).all()
