"""What recorded poses say of a twin's tip: where it is off in a way that can be learnt, and where not."""

import json

import numpy as np
import pytest

from tests.support.bent_chain import hardening_stump
from tests.support.residual import everywhere
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses, moved
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated

LENGTH, NOISE = 0.5, 2e-4  # m


def drawn(count: int, rng: np.random.Generator) -> RestingPoses:
    """Two of three motors pull by up to 40 mm, the third lets out; the mount is tilted by up to 60° to any side."""
    pulls = rng.uniform(0, 0.04, (count, 3))
    pulls[np.arange(count), rng.integers(3, size=count)] = -0.05
    tilt, azimuth = rng.uniform(0, 1, count), rng.uniform(-np.pi, np.pi, count)
    down = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), -np.cos(tilt)], axis=1)
    return RestingPoses(pulls, STANDARD_GRAVITY * down)


def smooth(poses: RestingPoses) -> np.ndarray:
    """Residuals, m, of an arm that its cables bend too little and gravity to one side; letting out does nothing."""
    first, second, third = np.maximum(poses.pulls, 0).T
    aside = 2e-3 * poses.gravity[:, 1] / STANDARD_GRAVITY
    return np.stack([0.2 * first - 4.0 * second**2, aside, 0.05 * first - 0.1 * third], axis=1)


def measured(poses: RestingPoses, rng: np.random.Generator) -> np.ndarray:
    return smooth(poses) + NOISE * rng.standard_normal((len(poses), 3))


@pytest.fixture(scope="module")
def fitted() -> ResidualMap:
    rng = np.random.default_rng(1)
    poses = drawn(60, rng)
    return ResidualMap.fit(poses, measured(poses, rng), LENGTH)


def lengths(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)


def test_it_foresees_poses_that_were_not_recorded(fitted):
    others = drawn(200, np.random.default_rng(2))
    without, left = lengths(smooth(others)), lengths(smooth(others) - fitted.mean(others))
    assert np.median(left) < 0.15 * np.median(without)
    assert fitted.is_worth_it


def test_what_it_says_of_itself_is_of_its_poses_left_out(fitted):
    errors = fitted.errors_mm()
    assert errors == {
        "poses": 60,
        "twin": pytest.approx(1e3 * np.median(lengths(fitted.residuals))),
        "left_out": pytest.approx(1e3 * np.median(lengths(fitted.left_out()))),
    }


def test_its_table_brings_it_back(fitted):
    table, others = json.loads(json.dumps(fitted.table())), drawn(50, np.random.default_rng(4))
    np.testing.assert_allclose(ResidualMap.from_table(table).mean(others), fitted.mean(others), atol=2e-6)
    lost = fitted.residuals.copy()
    lost[3] = np.nan
    for change in (
        {"residuals": table["residuals"][:-1]},
        {"gravity": table["pulls"][:-1]},
        {"pulls": [0.1]},
        {"numbers": [1.0] * 4},
        {"noisier": [1.0] * 59},
        {"noisier": [0.5] * 60},
        {"numbers": [1.0, 1.0, 0.0, 1.0, 1.0]},
        {"residuals": lost.tolist()},
    ):
        with pytest.raises(ValueError, match="residual map"):
            ResidualMap.from_table(table | change)


def test_a_slack_tendon_counts_the_same_however_far_it_is_let_out():
    chain, gravity = read_chain(hardening_stump()), STANDARD_GRAVITY * np.array([[0.6, 0.0, -0.8]])
    pulled = chain.straight_lengths - [0.0, 0.004, -0.001]
    rests = [actuated(chain, (pulled + [out, 0.0, out])[None], gravity) for out in (0.1, 0.2)]
    poses = [RestingPoses.of(chain, rest, gravity) for rest in rests]
    np.testing.assert_allclose(poses[0].pulls, poses[1].pulls, atol=1e-9)
    assert poses[0].pulls[0, 1] == pytest.approx(0.004)


def test_tips_are_moved_by_it_and_nothing_else_is():
    chain, gravity = read_chain(hardening_stump()), STANDARD_GRAVITY * np.array([0.6, 0.0, -0.8])
    rest, shift = actuated(chain, np.tile(chain.straight_lengths, (2, 1)), gravity), [0.001, -0.002, 0.003]
    other = moved(rest, chain, gravity, everywhere(shift))
    np.testing.assert_allclose(other.position - rest.position, [shift] * 2, atol=1e-7)
    assert other.qpos is rest.qpos
    assert moved(rest, chain, gravity, None) is rest


def test_letting_out_counts_as_no_pull(fitted):
    poses = drawn(20, np.random.default_rng(3))
    other = RestingPoses(np.where(poses.pulls < 0, -0.3, poses.pulls), poses.gravity)
    np.testing.assert_array_equal(fitted.mean(poses), fitted.mean(other))


@pytest.mark.parametrize("left", [0, 31, 59])
def test_a_pose_that_is_left_out_is_foreseen_by_all_others_alone(fitted, left):
    others = np.delete(np.arange(60), left)
    without = ResidualMap(fitted.poses[others], fitted.residuals[others], fitted.noisier[others], fitted.numbers)
    error = fitted.residuals[left] - without.mean(fitted.poses[[left]])[0]
    np.testing.assert_allclose(fitted.left_out()[left], error, rtol=1e-6)


def test_poses_that_are_far_off_spoil_neither_the_map_nor_what_it_is_worth():
    """Two of forty, off by 4 cm as where an arm snaps."""
    rng = np.random.default_rng(6)
    poses, others = drawn(40, rng), drawn(200, rng)
    residuals = measured(poses, rng)
    clean = ResidualMap.fit(poses, residuals, LENGTH)
    residuals[[7, 23]] += [[0.04, 0, 0], [0.0, -0.03, 0.03]]
    spoilt = ResidualMap.fit(poses, residuals, LENGTH)
    assert spoilt.is_worth_it
    assert set(np.argsort(spoilt.noisier)[-2:]) == {7, 23}
    left = [float(np.median(lengths(smooth(others) - each.mean(others)))) for each in (clean, spoilt)]
    assert left[1] < 2 * left[0]


def test_where_poses_tell_nothing_it_is_unknown_and_the_tip_is_the_twin_s():
    """Poses that all pull the first motor: of the second's pulls they tell nothing."""
    rng = np.random.default_rng(8)
    poses = drawn(30, rng)
    poses.pulls[:, 0] = rng.uniform(0, 0.04, 30)
    poses.pulls[:, 1:] = -0.05
    learnt = ResidualMap.fit(poses, measured(poses, rng), LENGTH)
    down = np.tile([0.0, 0.0, -STANDARD_GRAVITY], (2, 1))
    first, second = RestingPoses(np.array([[0.02, -0.1, -0.1], [0.0, 0.3, -0.1]]), down)[[0]], RestingPoses(
        np.array([[0.0, 0.3, -0.1]]), down[:1]
    )
    assert learnt.unknown(first)[0] < 0.1
    assert learnt.unknown(second)[0] > 0.9
    assert lengths(learnt.mean(second))[0] < 0.3 * lengths(learnt.mean(first))[0] + 1e-3
    alone = ResidualMap(learnt.poses[1:], learnt.residuals[1:], learnt.noisier[1:], learnt.numbers)
    np.testing.assert_allclose(learnt.unknown_left_out()[0], alone.unknown(learnt.poses[[0]])[0], atol=0.02)


def test_poses_within_two_millimetres_and_three_degrees_are_one_that_was_repeated():
    down = np.tile([0.0, 0.0, -STANDARD_GRAVITY], (5, 1))
    down[4] = STANDARD_GRAVITY * np.array([np.sin(0.1), 0.0, -np.cos(0.1)])
    pulls = np.array([[0.02, 0, -1], [0.0219, 0, -2], [0.0221, 0, 0], [0.02, 0.0021, 0], [0.02, 0, 0]])
    assert [rows.tolist() for rows in RestingPoses(pulls, down).repeats()] == [[0, 1], [2], [3], [4]]


def test_residuals_that_nothing_tells_are_not_worth_a_map():
    rng = np.random.default_rng(5)
    worth = [
        ResidualMap.fit(drawn(40, rng), 3e-3 * rng.standard_normal((40, 3)), LENGTH).is_worth_it for _ in range(10)
    ]
    assert not any(worth)


def test_too_few_poses_and_lost_tips_are_refused(fitted):
    with pytest.raises(InputError, match="poses: found 14, expected 15 or more"):
        ResidualMap.fit(fitted.poses[:14], fitted.residuals[:14], LENGTH)
    lost = fitted.residuals.copy()
    lost[7, 1] = np.nan
    with pytest.raises(InputError, match=r"pose 7: found the residual \[.*nan.*\] m, expected finite numbers"):
        ResidualMap.fit(fitted.poses, lost, LENGTH)
