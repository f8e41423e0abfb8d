"""The Panda: kinematics and collisions against MuJoCo, exact downward poses, inverse kinematics."""

import mujoco
import numpy as np
import pytest

from tests.kinematics.panda.mounts import assert_mounts
from trunkline.kinematics.panda.collision import clearance, segment_distance
from trunkline.kinematics.panda.downward import sample_downward, sample_tilted
from trunkline.kinematics.panda.inverse import POSITION_TOLERANCE, ROTATION_TOLERANCE, solve
from trunkline.kinematics.panda.kinematics import (
    DH_A,
    FLANGE,
    Q_MAX,
    Q_MIN,
    jacobian,
    joint_frames,
    mount_pose,
    within_limits,
)
from trunkline.kinematics.panda.mjcf import panda_spec

OFFSET = 0.05  # m


@pytest.fixture(scope="module")
def model():
    return panda_spec(OFFSET).compile()


def random_poses(count, seed=0):
    return np.random.default_rng(seed).uniform(Q_MIN, Q_MAX, size=(count, 7))


def placed(model, q):
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return data


def test_forward_kinematics_is_mujocos(model):
    assert_mounts(model, random_poses(50), OFFSET, 1e-12)


def test_known_poses():
    stretched = np.zeros((1, 7))  # straight up: all offsets along z add up, the hand hangs from its last offset
    position, rotation = mount_pose(stretched)
    np.testing.assert_allclose(position[0], [DH_A[6], 0, 0.333 + 0.316 + 0.384 - FLANGE], atol=1e-12)
    np.testing.assert_allclose(rotation[0][:, 2], [0, 0, -1], atol=1e-12)


def test_model_has_the_limits(model):
    np.testing.assert_allclose(model.jnt_range, np.column_stack([Q_MIN, Q_MAX]))


def test_the_file_of_the_model_loads_as_the_model(model):
    loaded = mujoco.MjModel.from_xml_string(panda_spec(OFFSET).to_xml())
    np.testing.assert_array_equal(loaded.body_mass, model.body_mass)
    for q in random_poses(20):
        there, here = placed(loaded, q), placed(model, q)
        np.testing.assert_allclose(there.site("mount").xpos, here.site("mount").xpos, atol=1e-6)  # of its digits
        assert there.ncon == here.ncon


def test_jacobian_by_finite_differences():
    q, step = random_poses(20), 1e-6
    frames = joint_frames(q)
    position, rotation = mount_pose(q)
    J = jacobian(frames, position.T)
    for joint in range(7):
        moved = q.copy()
        moved[:, joint] += step
        p, r = mount_pose(moved)
        np.testing.assert_allclose(J[:3, joint].T, (p - position) / step, atol=1e-5)
        turn = (r - rotation) / step @ rotation.transpose(0, 2, 1)
        np.testing.assert_allclose(J[3:, joint].T, turn[:, [2, 0, 1], [1, 2, 0]], atol=1e-5)


def test_collisions_are_mujocos(model):
    q = random_poses(300, seed=1)
    gaps = clearance(q, OFFSET)
    contacts = np.array([placed(model, pose).ncon > 0 for pose in q])
    assert 10 < contacts.sum() < 290
    np.testing.assert_array_equal(gaps < 0, contacts)


def test_clearance_does_not_know_the_first_and_last_joint():
    q = random_poses(20)
    turned = q.copy()
    turned[:, 0] += 1.0
    turned[:, 6] -= 1.0
    np.testing.assert_allclose(clearance(turned), clearance(q), atol=1e-12)


def test_segment_distance_by_brute_force():
    ends = np.random.default_rng(3).normal(size=(4, 3, 40))
    s, t = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201))
    for i in range(40):
        a, b, c, d = ends[:, :, i, None, None]
        nearest = np.sqrt((((a + s * (b - a)) - (c + t * (d - c))) ** 2).sum(axis=0)).min()
        assert segment_distance(*ends[:, :, i:i + 1])[0] == pytest.approx(nearest, abs=2e-2)
        assert segment_distance(*ends[:, :, i:i + 1])[0] <= nearest + 1e-12


def test_downward_poses_point_down_within_limits():
    q = sample_downward(20_000, seed=0, mount_offset=OFFSET)
    _, rotations = mount_pose(q)
    assert len(q) >= 20_000
    assert np.abs(rotations[:, :, 2] - [0, 0, -1]).max() < 1e-9
    assert within_limits(q).all()
    assert (clearance(q, OFFSET) > 0).all()


def test_tilted_poses_point_every_way_around_at_their_tilt():
    q = sample_tilted(20_000, 0, 0.5, OFFSET, avoid_collisions=True)
    _, rotations = mount_pose(q)
    pointing = rotations[:, :, 2]
    np.testing.assert_allclose(pointing[:, 2], -np.cos(0.5), atol=1e-9)
    headings = np.histogram(np.arctan2(pointing[:, 1], pointing[:, 0]), bins=12, range=(-np.pi, np.pi))[0]
    assert headings.min() > 0.7 * headings.mean()
    assert within_limits(q).all()
    assert (clearance(q, OFFSET) > 0).all()


def test_downward_poses_are_the_ones_that_rejection_finds():
    """Poses that happen to point almost down, drawn blindly, all lie near an exact sample."""
    q = random_poses(400_000, seed=2)
    _, rotations = mount_pose(q)
    blind = q[rotations[:, 2, 2] < -0.9995]
    exact = sample_downward(200_000, seed=0, avoid_collisions=False)
    features = slice(1, 6)  # q1 and q7 are free
    gaps = [np.abs(exact[:, features] - pose[features]).max(axis=1).min() for pose in blind[:60]]
    assert len(gaps) == 60
    assert np.quantile(gaps, 0.9) < 0.2


def test_sampling_is_reproducible_at_any_thread_count(monkeypatch):
    samples = []
    for threads in ("1", "3"):
        monkeypatch.setenv("TRUNKLINE_THREADS", threads)
        samples.append(sample_downward(20_000, seed=4))
    np.testing.assert_array_equal(*samples)


def test_inverse_kinematics_reaches_what_forward_kinematics_made():
    q = sample_downward(400, seed=1, mount_offset=OFFSET)[:400]
    positions, rotations = mount_pose(q, OFFSET)
    result = solve(positions, rotations, seed=0, starts=40, mount_offset=OFFSET)
    assert result.success.mean() >= 0.995
    p, r = mount_pose(result.q[result.success], OFFSET)
    assert np.linalg.norm(p - positions[result.success], axis=1).max() <= POSITION_TOLERANCE
    turn = np.einsum("nij,nij->n", r, rotations[result.success])
    assert np.arccos(np.clip((turn - 1) / 2, -1, 1)).max() <= 2 * ROTATION_TOLERANCE
    assert within_limits(result.q, 1e-12).all()


def test_a_target_meets_the_same_starts_alone_and_in_company():
    positions, rotations = mount_pose(sample_downward(5, seed=3)[:5])
    together = solve(positions, rotations, seed=0, starts=20)
    first = solve(positions[:1], rotations[:1], seed=0, starts=1)
    if together.starts[0] == 1:
        np.testing.assert_array_equal(together.q[0], first.q[0])
    assert together.success.all()
