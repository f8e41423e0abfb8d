"""The One-Euro filter: its published form, a still hand, a fast one, and a turn that does not depend on axes."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trunkline.ar.teleop.one_euro import OneEuro, smooth
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

FILTER = OneEuro(1.0, 20.0, 1.0)
LOW_PASS = OneEuro(1.0, 0.0, 1.0)
IDENTITY, DT = (1.0, 0.0, 0.0, 0.0), 1 / 72


def filtered(positions, quaternions=None, settings=FILTER):
    last, poses = None, []
    for i, position in enumerate(positions):
        turn = IDENTITY if quaternions is None else tuple(map(float, quaternions[i]))
        last = smooth(last, tuple(map(float, position)), turn, DT, settings, settings)
        poses.append(last)
    return poses


def published(values, min_cutoff, beta, derivative_cutoff):
    """The filter of one number, as its authors print it (appendix of the paper)."""

    def alpha(cutoff):
        return 1 / (1 + (1 / (2 * math.pi * cutoff)) / DT)

    x, dx, smoothed = values[0], 0.0, [values[0]]
    for value in values[1:]:
        dx += alpha(derivative_cutoff) * ((value - x) / DT - dx)
        x += alpha(min_cutoff + beta * abs(dx)) * (value - x)
        smoothed.append(x)
    return np.array(smoothed)


def test_one_coordinate_is_as_published():
    values = np.cumsum(np.random.default_rng(0).normal(size=200)) * 0.01
    poses = filtered(np.column_stack([values, 0 * values, 0 * values]))
    np.testing.assert_allclose([pose.position[0] for pose in poses], published(values, 1.0, 20.0, 1.0), atol=1e-15)


def test_rotation_about_one_axis_is_as_its_angle():
    angles = np.cumsum(np.random.default_rng(1).normal(size=200)) * 0.02
    axis = np.array([2.0, -1.0, 2.0]) / 3
    poses = filtered(np.zeros((200, 3)), wxyz_from_rotation(Rotation.from_rotvec(angles[:, None] * axis)))
    # the speed of a rotation has no sign here, so its low-pass is of |v|
    turned = np.array([rotation_from_wxyz(np.array(pose.quaternion)).as_rotvec() @ axis for pose in poses])
    assert np.abs(turned - angles).max() < 0.2
    slow = filtered(np.zeros((200, 3)), wxyz_from_rotation(Rotation.from_rotvec(angles[:, None] * axis)), LOW_PASS)
    turned = np.array([rotation_from_wxyz(np.array(pose.quaternion)).as_rotvec() @ axis for pose in slow])
    np.testing.assert_allclose(turned, published(angles, 1.0, 0.0, 1.0), atol=1e-12)


def test_still_hand_is_calmer_and_a_fast_one_not_late():
    rng = np.random.default_rng(2)
    noise = rng.normal(scale=0.5e-3, size=(2000, 3))
    jitter = np.array([pose.position for pose in filtered(noise)])[500:].std()
    assert jitter < 0.4 * 0.5e-3
    speed = 0.5  # m/s
    way = np.column_stack([speed * DT * np.arange(400), np.zeros(400), np.zeros(400)])
    behind = way[-1, 0] - filtered(way)[-1].position[0]
    assert behind / speed < 0.02  # s
    assert behind < 0.2 * (way[-1, 0] - filtered(way, settings=LOW_PASS)[-1].position[0])


def test_it_turns_with_the_frame():
    rng = np.random.default_rng(3)
    positions = np.cumsum(rng.normal(scale=0.01, size=(100, 3)), axis=0)
    turn = Rotation.random(rng=rng)
    there = np.array([pose.position for pose in filtered(turn.apply(positions))])
    np.testing.assert_allclose(there, turn.apply([pose.position for pose in filtered(positions)]), atol=1e-14)


@pytest.mark.parametrize("sign", [1, -1])
def test_either_sign_of_a_quaternion_is_the_same_rotation(sign):
    turns = wxyz_from_rotation(Rotation.from_rotvec(np.outer(np.linspace(0, 7, 100), [0.2, 0.9, 0.1])))
    turns[1::2] *= sign
    poses = filtered(np.zeros((100, 3)), turns)
    last = rotation_from_wxyz(np.array(poses[-1].quaternion))
    assert (last * rotation_from_wxyz(turns[-1]).inv()).magnitude() < 0.2
