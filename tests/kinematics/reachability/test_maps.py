"""The rigid, soft and hybrid maps: against inverse kinematics, known shapes, and sums of balls."""

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.kinematics.panda.downward import sample_downward
from trunkline.kinematics.panda.kinematics import Q_MAX, mount_pose
from trunkline.kinematics.panda.labels import agreement, beyond_links, draw_points, label
from trunkline.kinematics.reachability.hybrid import minkowski_field, swept_cells
from trunkline.kinematics.reachability.hybrid_check import ReachingPoses, draw_inside_and_outside, find_poses, verified
from trunkline.kinematics.reachability.maps import angle_name, build_rigid, build_soft
from trunkline.kinematics.reachability.reach_signal import held_out, packed, points_beyond, reach_signal
from trunkline.kinematics.reachability.rigid import profile, rigid_field
from trunkline.kinematics.reachability.settings import RigidSettings
from trunkline.kinematics.reachability.soft import SoftShape, soft_field, soft_lattice
from trunkline.kinematics.reachability.tips import ArmTips, Tips
from trunkline.kinematics.sdf.grid import Lattice, overlap
from trunkline.kinematics.sdf.mesh import contains

OFFSET = 0.05  # m
LENGTH = 0.5  # m, of the arm of constant curvature below
SHAPE = SoftShape(tolerance=0.02, closing=0.02, smoothing=0.7, smallest=60)


@pytest.fixture(scope="module")
def poses():
    return sample_downward(1 << 17, seed=0, mount_offset=OFFSET)


@pytest.fixture(scope="module")
def rigid():
    settings = RigidSettings(mount_offset=OFFSET, self_collision=True, poses=1 << 17, profile_voxel=0.006,
                             voxel=0.02, closing=0.018, smoothing=0.5, smallest=30)
    return build_rigid(settings, 8000, seed=0)


def curved_tips(angle, count=4000, seed=0):
    """Tips of an arm of constant curvature under three tendons, swinging two thirds of the gravity angle (rad)."""
    rng = np.random.default_rng(seed)
    directions = 2 * np.pi * np.arange(3) / 3
    tensions = rng.uniform(0, 4, size=(count, 3))
    tensions[np.arange(count), rng.integers(0, 3, count)] = 0.0
    bend = tensions @ np.column_stack([np.cos(directions), np.sin(directions)])
    turn = np.maximum(np.linalg.norm(bend, axis=1), 1e-9)
    side, down = LENGTH * (1 - np.cos(turn)) / turn, LENGTH * np.sin(turn) / turn
    tips = np.column_stack([bend / turn[:, None] * side[:, None], -down])
    swing = 2 / 3 * angle * down / LENGTH
    x = np.cos(swing) * tips[:, 0] - np.sin(swing) * tips[:, 2]
    z = np.sin(swing) * tips[:, 0] + np.cos(swing) * tips[:, 2]
    return Tips(np.column_stack([x, tips[:, 1], z]), tensions)


def ball_field(radius, spacing, center=(0.0, 0.0, 0.0)):
    center = np.array(center)
    lattice = Lattice.around(center - radius, center + radius, spacing, 4 * spacing)
    grid = np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1)
    return np.linalg.norm(grid - center, axis=-1) - radius, lattice


def test_rigid_map_agrees_with_inverse_kinematics(rigid):
    points = draw_points([-0.9, -0.9, -0.5], [0.9, 0.9, 1.0], 400, seed=1)
    claimed = contains(rigid.mesh, points)
    reachable = label(points, seed=0, starts=40, starts_in_doubt=100, mount_offset=OFFSET, avoid_collisions=True)
    result = agreement(claimed, reachable)
    assert result.accuracy >= 0.98
    assert result.fpr <= 0.02
    assert result.reachable + result.unreachable == 400


def test_rigid_mesh_is_closed_and_small(rigid):
    assert rigid.mesh.is_closed()
    assert len(rigid.mesh.faces) <= 8000


def test_a_profile_of_specks_is_refused_by_its_key(poses):
    specks = profile(poses[:1], OFFSET, spacing=0.004, closing=0.004, smallest=30)
    with pytest.raises(InputError, match="reachability.rigid.profile_voxel: found 0.004 m and an empty profile"):
        rigid_field(specks, 0.02, 0.5)


def test_samples_lie_inside_the_rigid_map(rigid):
    position, _ = mount_pose(sample_downward(4000, seed=9, mount_offset=OFFSET), OFFSET)
    depth = rigid.lattice.sample(rigid.field, position)
    assert np.quantile(depth, 0.99) < 0.005
    assert depth.max() < rigid.lattice.spacing


def test_profile_knows_where_joint_1_ends():
    """Poses of one elbow, in the arm's plane (phi0 = 0), are reached up to joint 1's limit and no further."""
    near = np.random.default_rng(0).uniform(-0.05, 0.05, size=(2000, 2))
    q = np.zeros((2000, 7))
    q[:, [1, 3]] = [0.3, -1.5] + near
    q[:, 5] = 0.3  # a profile looks at positions only
    shape = profile(q, OFFSET, spacing=0.004, closing=0.012, smallest=1)
    position, _ = mount_pose(q.mean(axis=0)[None], OFFSET)
    radius, height = np.hypot(*position[0, :2]), position[0, 2]
    azimuths = np.array([0.0, Q_MAX[0] - 0.02, Q_MAX[0] + 0.02, np.pi])
    points = np.column_stack([radius * np.cos(azimuths), radius * np.sin(azimuths), np.full(4, height)])
    np.testing.assert_array_equal(shape.field(points) < 0, [True, True, False, False])
    np.testing.assert_array_equal(shape.field(points * [1, -1, 1]) < 0, [True, True, False, False])


def test_no_sample_is_beyond_the_links(poses):
    position, _ = mount_pose(poses, OFFSET)
    assert not beyond_links(position, OFFSET).any()
    assert beyond_links(np.array([[0.9, 0, 0.1]]), OFFSET).all()


def test_labels_find_samples_and_refuse_the_impossible(poses):
    position, _ = mount_pose(poses[::4000], OFFSET)
    impossible = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -0.2], [2.0, 0.0, 0.0]])
    points = np.concatenate([position, impossible])
    reached = label(points, seed=0, starts=30, starts_in_doubt=100, mount_offset=OFFSET,
                    avoid_collisions=True)
    assert reached[:-3].mean() >= 0.95  # samples on the very border are hard to hit
    assert not reached[-3:].any()


def test_tips_are_the_samples_where_there_are_some_and_equilibria_elsewhere(chain):
    sampled = Tips(np.zeros((5, 3)), np.zeros((5, 3)))
    tips_at = ArmTips(chain, np.array([0.0, 1.0]), [sampled, sampled], directions=12, steps=8, seed=0)
    assert tips_at(1.0) is sampled
    fresh = tips_at(0.4)
    np.testing.assert_array_equal(fresh.positions, tips_at(0.4).positions)
    assert len(fresh.positions) > 100
    reach = np.linalg.norm(fresh.positions, axis=1)
    assert 0.5 * chain.length < reach.max() < 1.1 * chain.length


def test_soft_field_of_one_tip_is_a_ball():
    tips = np.array([[0.0, 0.0, -0.3]])
    shape = SoftShape(tolerance=0.05, closing=0.02, smoothing=0.3, smallest=1)
    lattice = soft_lattice([tips], shape, 0.01)
    field = soft_field(tips, lattice, shape)
    grid = np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1)
    true = np.linalg.norm(grid - tips[0], axis=-1) - 0.05
    near = np.abs(true) < 0.02
    assert np.abs(field - true)[near].max() < 0.005


def test_soft_maps_are_closed_and_share_a_lattice():
    sampled, heard = np.radians([0, 30, 60]), []
    maps = build_soft(curved_tips, sampled, SHAPE, 0.015, np.radians(10), 8000, heard.append)
    assert heard == [f"soft_{angle:03}" for angle in range(0, 61, 10)]
    np.testing.assert_allclose(np.degrees(maps.angles), [0, 10, 20, 30, 40, 50, 60], atol=1e-9)
    assert maps.fields.shape == (7, *maps.lattice.shape)
    assert len(maps.meshes) == 3
    assert all(mesh.is_closed() and len(mesh.faces) <= 8000 for mesh in maps.meshes)
    for angle in sampled:
        inside = maps.lattice.sample(maps.at(angle), curved_tips(angle).positions) < 0
        assert inside.mean() > 0.99  # but for tips that no other is near: specks


@pytest.fixture(scope="module")
def soft():
    dense = lambda angle: curved_tips(angle, 20_000)  # noqa: E731
    return build_soft(dense, np.radians([0, 10, 20]), SHAPE, 0.012, np.radians(5), 8000, lambda _: None)


@pytest.mark.parametrize("angle_deg", [2.5, 17.5])
def test_signal_knows_tips_and_points_beyond_reach_between_the_grids(soft, angle_deg):
    tips = curved_tips(np.radians(angle_deg), 20_000, seed=5).positions
    check = held_out(packed(soft.fields), soft.angles, soft.lattice, SHAPE, tips, np.radians(angle_deg),
                     beyond=0.03, count=1000, seed=0)
    assert check.iou > 0.93
    assert check.reachable > 0.995
    assert check.beyond < 0.02


def test_signal_is_the_distance_outside(soft):
    tips = curved_tips(soft.angles[2], 20_000, seed=6).positions
    points = points_beyond(tips, 0.06, 500, np.random.default_rng(0))
    signal = reach_signal(packed(soft.fields), soft.angles, soft.lattice, points, soft.angles[2])
    assert np.median(np.abs(signal - (0.06 - SHAPE.tolerance))) < 0.006
    far = reach_signal(packed(soft.fields), soft.angles, soft.lattice, np.array([[9.0, 9.0, 9.0]]), 0.1)
    assert far[0] > 0


def test_coarse_angles_would_not_do(soft):
    """What the fine step is for: grids 80° apart, blended half-way."""
    low, between, high = (
        soft_field(curved_tips(np.radians(deg), 20_000).positions, soft.lattice, SHAPE) for deg in (-30, 10, 50)
    )
    assert overlap((low + high) / 2, between) < 0.8


def test_names_of_angles():
    assert [angle_name(np.radians(a)) for a in (0, 60, 7.5, 120)] == ["soft_000", "soft_060", "soft_007p5", "soft_120"]


def test_tips_beside_the_axis_sweep_a_ring():
    tips = np.random.default_rng(0).uniform([0.14, -0.01, -0.21], [0.16, 0.01, -0.19], size=(500, 3))
    cells, lattice = swept_cells(tips, 0.01)
    centers = lattice.origin + lattice.spacing * np.argwhere(cells)
    assert np.abs(centers[:, 2] + 0.2).max() < 0.015
    assert np.abs(np.hypot(centers[:, 0], centers[:, 1]) - 0.15).max() < 0.015
    azimuths = np.sort(np.arctan2(centers[:, 1], centers[:, 0]))
    assert np.diff(azimuths).max() < 0.1


def test_hybrid_of_a_point_and_a_ball_is_the_ball():
    field, lattice = ball_field(0.2, 0.01)
    single = Lattice(np.array([0.0, 0.0, -0.32]), 0.016, (1, 1, 1))
    result, where = minkowski_field(field, lattice, np.ones((1, 1, 1), bool), single, smoothing=0.0, smallest=1)
    grid = np.stack(np.meshgrid(*where.axes(), indexing="ij"), axis=-1)
    true = np.linalg.norm(grid - [0, 0, -0.32], axis=-1) - 0.2
    near = np.abs(true) < 0.03
    assert np.abs(result - true)[near].max() < 0.016


def test_hybrid_of_two_balls_is_the_ball_of_both_radii():
    field, lattice = ball_field(0.2, 0.01)
    rng = np.random.default_rng(0)
    tips = rng.normal(size=(20_000, 3))
    tips *= 0.12 * rng.uniform(0.9, 1.0, (20_000, 1)) / np.linalg.norm(tips, axis=1, keepdims=True)
    cells, cells_lattice = swept_cells(tips - [0, 0, 0.2], 0.015)
    result, where = minkowski_field(field, lattice, cells, cells_lattice, smoothing=0.7, smallest=1)
    grid = np.stack(np.meshgrid(*where.axes(), indexing="ij"), axis=-1)
    true = np.linalg.norm(grid - [0, 0, -0.2], axis=-1) - 0.32
    error = (result - true)[np.abs(true) < 0.015]
    assert np.abs(error).max() < 0.015
    assert abs(error.mean()) < 0.004


def tip_position(mount: np.ndarray, rotation: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """Where soft `tip` (N, 3) is, in the Panda's base frame, with the mount at a pose (N, 3), (N, 3, 3)."""
    return mount + np.einsum("nij,nj->ni", rotation * np.array([1.0, -1.0, -1.0]), tip)


def test_points_of_the_hybrid_map_are_reached_and_points_beside_it_are_not(rigid):
    tips = curved_tips(0.0).positions
    cells, cells_lattice = swept_cells(tips, 0.02)
    field, lattice = minkowski_field(rigid.field, rigid.lattice, cells, cells_lattice, smoothing=0.7, smallest=60)
    inside, outside = draw_inside_and_outside(field, lattice, 0.03, 40, seed=0)
    assert len(inside) == len(outside) == 40
    where = {"seed": 0, "mount_offset": OFFSET, "avoid_collisions": True}
    reach = find_poses(inside, tips, rigid.field, rigid.lattice, **where)
    assert reach.reached.mean() >= 0.97
    mount, rotation = mount_pose(reach.q[reach.reached], OFFSET)
    assert np.abs(rotation[:, :, 2] - [0, 0, -1]).max() < 1e-3
    reached = tip_position(mount, rotation, tips[reach.tip[reach.reached]])
    assert np.linalg.norm(reached - inside[reach.reached], axis=1).max() < 1e-3
    assert find_poses(outside, tips, rigid.field, rigid.lattice, **where).reached.mean() <= 0.03


def test_a_pose_is_verified_by_joint_angles_and_tendon_lengths_alone(chain):
    source = ArmTips(chain, np.zeros(0), [], directions=12, steps=8, seed=0)
    tips = source(0.0)
    q = sample_downward(5, seed=3, mount_offset=OFFSET)[:5]
    mount, rotation = mount_pose(q, OFFSET)
    index = np.array([40, 50, 60, 70, 80])
    points = tip_position(mount, rotation, tips.positions[index])
    reach = ReachingPoses(np.array([1, 1, 1, 1, 0], bool), q, index, np.zeros(5))
    assert list(verified(points, reach, tips.lengths, chain, OFFSET)) == [True] * 4 + [False]
    assert not verified(points + [0, 0, 0.005], reach, tips.lengths, chain, OFFSET).any()
    q[:, 5] += 0.1  # no longer straight down: gravity pulls another way
    assert not verified(points, reach, tips.lengths, chain, OFFSET).any()
