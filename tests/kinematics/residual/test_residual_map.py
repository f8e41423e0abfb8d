"""What recorded poses say of a twin's tip: where it is off in a way that can be learnt, and where not."""

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses

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


def test_letting_out_counts_as_no_pull(fitted):
    poses = drawn(20, np.random.default_rng(3))
    other = RestingPoses(np.where(poses.pulls < 0, -0.3, poses.pulls), poses.gravity)
    np.testing.assert_array_equal(fitted.mean(poses), fitted.mean(other))
    np.testing.assert_array_equal(fitted.radius(poses, 0.9), fitted.radius(other, 0.9))


@pytest.mark.parametrize("left", [0, 31, 59])
def test_a_pose_that_is_left_out_is_foreseen_by_all_others_alone(fitted, left):
    others = np.delete(np.arange(60), left)
    without = ResidualMap(fitted.poses[others], fitted.residuals[others], fitted.numbers)
    errors, deviations = fitted.left_out()
    error = fitted.residuals[left] - without.mean(fitted.poses[[left]])[0]
    np.testing.assert_allclose(errors[left], error, rtol=1e-6)
    if fitted.poses.pulls[left].max() < fitted.poses.pulls.max():  # pulls are over the largest of those that are left
        np.testing.assert_allclose(deviations[left], without._deviation(fitted.poses[[left]])[0], rtol=1e-6)


def test_a_radius_holds_so_many_of_the_tips_and_is_wider_where_nothing_was_recorded():
    """Over ten arms and sets of poses."""
    within, stated = [], []
    for seed in range(10):
        rng = np.random.default_rng([7, seed])
        poses, others = drawn(60, rng), drawn(100, rng)
        learnt = ResidualMap.fit(poses, measured(poses, rng), LENGTH)
        away = lengths(measured(others, rng) - learnt.mean(others))
        within.append(np.mean(away <= learnt.radius(others, 0.9)))
        stated.append(learnt.radius(others, 0.9))
    assert 0.83 < np.mean(within) < 0.96
    inside, beyond = np.array([[0.02, 0.02, -0.1]]), np.array([[0.2, 0.2, -0.1]])
    down = np.array([[0, 0, -STANDARD_GRAVITY]])
    assert learnt.radius(RestingPoses(beyond, down), 0.9) > 5 * learnt.radius(RestingPoses(inside, down), 0.9)


def test_residuals_that_nothing_tells_are_not_worth_a_map():
    rng = np.random.default_rng(5)
    worth = [
        ResidualMap.fit(drawn(40, rng), 3e-3 * rng.standard_normal((40, 3)), LENGTH).is_worth_it for _ in range(10)
    ]
    assert not any(worth)


@pytest.mark.parametrize(("count", "share", "least"), [(18, 0.95, 19), (19, 0.95, 0), (15, 0.9, 0), (40, 0.99, 99)])
def test_few_poses_state_no_high_probability(fitted, count, share, least):
    few = ResidualMap(fitted.poses[:count], fitted.residuals[:count], fitted.numbers)
    if not least:
        assert np.isfinite(few.radius(fitted.poses[:3], share)).all()
        return
    with pytest.raises(InputError, match=f"poses: found {count}, expected {least} or more to state {100 * share:g} %"):
        few.radius(fitted.poses[:3], share)


def test_too_few_poses_and_lost_tips_are_refused(fitted):
    with pytest.raises(InputError, match="poses: found 14, expected 15 or more"):
        ResidualMap.fit(fitted.poses[:14], fitted.residuals[:14], LENGTH)
    lost = fitted.residuals.copy()
    lost[7, 1] = np.nan
    with pytest.raises(InputError, match=r"pose 7: found the residual \[.*nan.*\] m, expected finite numbers"):
        ResidualMap.fit(fitted.poses, lost, LENGTH)
