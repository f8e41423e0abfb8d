"""Frames: quaternions against their definition, gravity against the mount's rotation, continuity in time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from trunkline.frames import (
    STANDARD_GRAVITY,
    gravity_in_base,
    make_continuous,
    rotation_from_wxyz,
    tilt_of_gravity,
    wxyz_from_rotation,
)

angles = st.floats(-10, 10)


def test_gravity_in_base_is_gravity_seen_from_a_turned_mount():
    for tilt in np.radians([0, 30, 60, 90, 120]):
        mount = Rotation.from_rotvec([0, tilt, 0])  # coordinates in the base to coordinates in the world
        expected = mount.inv().apply([0, 0, -STANDARD_GRAVITY])
        np.testing.assert_allclose(gravity_in_base(tilt), expected, atol=1e-12)


@given(st.floats(0, np.pi))
def test_the_tilt_is_the_angle_between_straight_arm_and_gravity(tilt):
    gravity = gravity_in_base(tilt)
    assert np.linalg.norm(gravity) == pytest.approx(STANDARD_GRAVITY)
    assert gravity @ [0, 0, -1] == pytest.approx(STANDARD_GRAVITY * np.cos(tilt))
    assert tilt_of_gravity(gravity) == pytest.approx(tilt, abs=1e-9)


def test_gravity_of_many_angles_at_once():
    assert gravity_in_base(np.zeros((2, 3))).shape == (2, 3, 3)
    np.testing.assert_allclose(gravity_in_base(0.3, magnitude=2.0), [2 * np.sin(0.3), 0, -2 * np.cos(0.3)])


def test_w_comes_first():
    quarter = np.sqrt(0.5)
    np.testing.assert_allclose(
        rotation_from_wxyz([quarter, 0, 0, quarter]).apply([1, 0, 0]), [0, 1, 0], atol=1e-12
    )
    np.testing.assert_allclose(
        wxyz_from_rotation(Rotation.from_euler("z", 90, degrees=True)), [quarter, 0, 0, quarter]
    )


@given(angles, angles, angles)
def test_quaternions_go_there_and_back(a, b, c):
    rotation = Rotation.from_rotvec([a, b, c])
    quaternion = wxyz_from_rotation(rotation)
    assert quaternion[0] >= 0
    assert np.linalg.norm(quaternion) == pytest.approx(1)
    assert (rotation_from_wxyz(quaternion) * rotation.inv()).magnitude() == pytest.approx(0, abs=1e-7)
    assert (rotation_from_wxyz(-quaternion) * rotation.inv()).magnitude() == pytest.approx(0, abs=1e-7)


@given(st.lists(st.booleans(), min_size=2, max_size=40), st.integers(0, 2**32 - 1))
def test_a_turning_body_s_quaternions_keep_one_hemisphere(flips, seed):
    turn = np.linspace(0, 4 * np.pi, len(flips))[:, None] * np.random.default_rng(seed).normal(0, 0.1, 3)
    true = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    smooth = make_continuous(true[:, None] * np.where(flips, -1, 1)[:, None, None])[:, 0]
    assert (np.einsum("ti,ti->t", smooth[1:], smooth[:-1]) >= 0).all()
    np.testing.assert_allclose(np.abs(np.einsum("ti,ti->t", smooth, true)), 1)  # the same rotations
