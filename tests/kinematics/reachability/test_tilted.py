"""The hybrid map at a tilt: frames, and poses that the statics confirm."""

import numpy as np
import pytest

from trunkline.frames import gravity_in_base
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.reachability.hybrid_check import draw_inside_and_outside, verified
from trunkline.kinematics.reachability.rigid import azimuth_from_joint_1
from trunkline.kinematics.reachability.tilted import draw_pairs, find_tilted, soft_base, tilted_field
from trunkline.kinematics.reachability.tips import ArmTips

OFFSET, TILT = 0.05, 0.6
HOW = {"mount_offset": OFFSET, "avoid_collisions": True}


@pytest.fixture(scope="module")
def tips(chain):
    return ArmTips(chain, np.zeros(0), [], directions=24, steps=12, seed=0)(TILT)


@pytest.fixture(scope="module")
def pairs(tips):
    return draw_pairs(tips.positions, TILT, 1 << 16, 0, **HOW)


def test_gravity_pulls_on_the_soft_arm_as_in_the_data_set():
    headings = np.linspace(-3, 3, 7)
    level = np.sin(TILT) * np.column_stack([np.cos(headings), np.sin(headings)])
    base = soft_base(np.column_stack([level, np.full(7, -np.cos(TILT))]))
    np.testing.assert_allclose(base.transpose(0, 2, 1) @ base, np.tile(np.eye(3), (7, 1, 1)), atol=1e-12)
    assert (np.linalg.det(base) > 0).all()
    down = base.transpose(0, 2, 1) @ [0, 0, -9.80665]
    np.testing.assert_allclose(down, np.tile(gravity_in_base(TILT), (7, 1)), atol=1e-9)
    np.testing.assert_allclose(soft_base(np.array([[0.0, 0, -1]]))[0], np.eye(3), atol=1e-12)


def test_joint_1_turns_points_without_changing_their_azimuth(pairs):
    q = pairs.q[:50].copy()
    mount, _ = mount_pose(q, OFFSET)
    before = azimuth_from_joint_1(mount, q[:, 0])
    q[:, 0] = np.random.default_rng(0).uniform(-2.5, 2.5, 50)
    mount, _ = mount_pose(q, OFFSET)
    np.testing.assert_allclose(azimuth_from_joint_1(mount, q[:, 0]), before, atol=1e-9)


def test_points_inside_are_reached_at_the_tilt_and_points_outside_are_not(chain, tips, pairs):
    field, lattice = tilted_field(pairs, 0.02, 1.0, 30)
    inside, outside = draw_inside_and_outside(field, lattice, 0.04, 20, seed=0)
    reach = find_tilted(inside, pairs, tips.positions, seed=0, **HOW)
    assert verified(inside, reach, tips.lengths, chain, OFFSET).mean() >= 0.95
    pointing = mount_pose(reach.q[reach.reached], OFFSET)[1][:, 2, 2]
    np.testing.assert_allclose(pointing, -np.cos(TILT), atol=1e-3)
    reach = find_tilted(outside, pairs, tips.positions, seed=0, **HOW)
    assert verified(outside, reach, tips.lengths, chain, OFFSET).mean() <= 0.05
