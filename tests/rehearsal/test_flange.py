"""The Panda's servos and how they move the arm's base: against the room `panda` and closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rehearsal.robot.flange import Mount, accelerate_joints, carry, move_joints
from rehearsal.robot.stand_in import Panda, servos_of
from trunkline.kinematics.panda.kinematics import FLANGE, Q_MAX, mount_pose
from trunkline.kinematics.panda.limits import ACCELERATION, VELOCITY

READY = np.array([0.3, -0.3, 0.2, -2.2, 0.1, 1.9, 0.785])
PANDA = Panda(mount_offset=0.05, azimuth=0.0, bandwidth=10.0, damping_ratio=1.0, dead_time=0.0)


def test_the_base_moves_as_the_mount_s_pose_does():
    """Velocities and accelerations against differences of the poses of `trunkline.kinematics.panda`."""
    rng = np.random.default_rng(5)
    v, a, step = rng.normal(size=7), rng.normal(size=7), 1e-4
    mount = Mount(np.eye(3), np.array([0.0, 0.0, FLANGE + 0.05]))
    times = step * np.array([-1.0, 0.0, 1.0])[:, None]
    places, turns = mount_pose(READY + times * v + 0.5 * times**2 * a, 0.05)
    turn, place, spin, speed, spinning, speeding = carry(mount, np.array([READY, v, a]))
    np.testing.assert_allclose(turn, turns[1], atol=1e-12)
    np.testing.assert_allclose(place, places[1], atol=1e-12)
    np.testing.assert_allclose(speed, (places[2] - places[0]) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(speeding, (places[2] - 2 * places[1] + places[0]) / step**2, atol=1e-5)
    first, last = (
        Rotation.from_matrix(turns[k + 1] @ turns[k].T).as_rotvec() / step for k in (0, 1)
    )  # in the middles of both steps
    np.testing.assert_allclose(spin, (first + last) / 2, atol=1e-5)
    np.testing.assert_allclose(spinning, (last - first) / step, atol=1e-3)


def test_a_joint_follows_a_sine_of_its_bandwidth_by_1_over_root_2():
    servos, h = servos_of(PANDA), 1 / 6000
    joints, size, angles = np.array([READY, np.zeros(7), np.zeros(7)]), 1e-3, []
    for n in range(6000):
        target = READY + size * np.sin(2 * np.pi * PANDA.bandwidth * n * h)
        accelerate_joints(servos, joints, target, h)
        move_joints(joints, h)
        angles.append(joints[0, 0] - READY[0])
    assert np.max(angles[3000:]) / size == pytest.approx(np.sqrt(0.5), rel=0.01)


def test_joints_keep_their_limits_whatever_is_commanded():
    servos, h = servos_of(PANDA), 1 / 6000
    joints = np.array([READY, np.zeros(7), np.zeros(7)])
    for _ in range(12000):
        accelerate_joints(servos, joints, Q_MAX + 1.0, h)
        move_joints(joints, h)
        assert (np.abs(joints[1]) <= VELOCITY + 1e-12).all()
        assert (joints[0] <= Q_MAX).all()
        free = np.abs(joints[1]) > 1e-9  # not at its end
        assert (np.abs(joints[2]) <= ACCELERATION + 1e-9)[free].all()
    assert (joints[0] > Q_MAX - 1e-2).all()
