"""The base frame: the same arm gives the same numbers however the cameras and the mount are turned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from demo.instruments import measure, rotation_mocap_world
from tests.support.sessions import instruments, static_truth
from trunkline.frames import gravity_in_base, tilt_of_gravity
from trunkline.recordings.signals.base_frame import average_base, gravity_from_up, to_base_frame

EXACT = {"position_noise_mm": 0, "orientation_noise_deg": 0, "outliers": 0, "occlusions_per_s": 0}


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, -1), (0.6, 0.0, 0.8)])
@pytest.mark.parametrize("heading", [0.0, 130.0])
def test_gravity_and_positions_do_not_depend_on_the_mocap_frame(up, heading):
    truth = static_truth(60.0)
    settings = instruments(up=up, heading_deg=heading, **EXACT)
    m = measure(truth, settings, np.random.default_rng(0))
    base = average_base(m.positions[:, 0], m.quaternions[:, 0])
    gravity = gravity_from_up(base, np.array(up) / np.linalg.norm(up))
    np.testing.assert_allclose(gravity, gravity_in_base(np.deg2rad(60)), atol=1e-9)
    positions, quaternions = to_base_frame(base, m.positions[:, 1:], m.quaternions[:, 1:])
    bend = np.deg2rad(20)
    tip = 0.4 / bend * np.array([1 - np.cos(bend), 0, -np.sin(bend)])
    np.testing.assert_allclose(positions[0, -1], tip, atol=1e-9)
    turn = Rotation.from_quat(quaternions[0, -1], scalar_first=True).as_rotvec()
    np.testing.assert_allclose(turn, [0, -bend, 0], atol=1e-9)


def test_mocap_frame_has_the_declared_vertical():
    settings = instruments(up=(0.6, 0.0, 0.8), heading_deg=70)
    np.testing.assert_allclose(rotation_mocap_world(settings).apply([0, 0, 1]), settings.up, atol=1e-12)


def test_base_pose_is_averaged_over_noise_and_outliers():
    rng = np.random.default_rng(1)
    tilt = Rotation.from_euler("xyz", [20, 50, -30], degrees=True)
    turned = Rotation.from_rotvec(rng.normal(scale=np.deg2rad(0.3), size=(600, 3))) * tilt
    quaternions = turned.as_quat(scalar_first=True)
    positions = [1, 2, 3] + rng.normal(scale=3e-4, size=(600, 3))
    positions[10:40] += 0.05
    quaternions[10:40] = [1, 0, 0, 0]
    positions[100:200] = quaternions[100:200] = np.nan
    base = average_base(positions, quaternions * rng.choice([-1, 1], (600, 1)))
    np.testing.assert_allclose(base.position, [1, 2, 3], atol=6e-5)
    assert (tilt.inv() * base.rotation).magnitude() < np.deg2rad(0.05)
    assert base.shift < 1e-4
    gravity = gravity_from_up(base, tilt.apply([0, 0, 1]))
    assert tilt_of_gravity(gravity) == pytest.approx(0, abs=np.deg2rad(0.05))


def test_a_mount_that_moves_is_noticed():
    positions = np.zeros((200, 3))
    positions[100:] = [0.004, 0, 0]
    turns = Rotation.from_rotvec(np.linspace([0, 0, 0], [0, 0, 0.02], 200))
    base = average_base(positions, turns.as_quat(scalar_first=True))
    assert base.shift == pytest.approx(0.004, rel=0.1)
    assert base.turn == pytest.approx(0.01, rel=0.1)
