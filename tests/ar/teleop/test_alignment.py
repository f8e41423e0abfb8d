"""Bending-plane alignment: the tip target comes into a half-plane, by the least turn of the wrist that its limits
allow."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.operator import READY_JOINTS, config
from trunkline.ar.teleop.alignment import Aligned, align, base_quaternion, flange_turn, wrist_of
from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, mount_pose

SETTINGS = config().core.bending_plane
DOWN = (0.0, 0.0, -1.0)
FIRST = Aligned(0.0, 0, 0.0)


def base_of(pointing, heading):
    return rotation_from_wxyz(np.array(base_quaternion(tuple(map(float, pointing)), heading)))


def targets(count=200, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        mount = np.array([0.5, 0.0, 0.5]) + rng.uniform(-0.2, 0.2, 3)
        tilt, azimuth = rng.uniform(0, 1.0), rng.uniform(-np.pi, np.pi)
        pointing = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), -np.cos(tilt)])
        yield mount, mount + rng.uniform(-0.3, 0.3, 3), pointing


def test_forward_kinematics_are_those_of_the_room_panda():
    rng = np.random.default_rng(0)
    for q in rng.uniform(Q_MIN, Q_MAX, (50, 7)):
        position, rotation = mount_pose(q[None], 0.05)
        wrist = wrist_of(tuple(q), 0.05)
        np.testing.assert_allclose(wrist.position, position[0], atol=1e-14)
        np.testing.assert_allclose(wrist.pointing, rotation[0, :, 2], atol=1e-14)
        turn = base_of(wrist.pointing, wrist.heading).as_matrix()
        flange = rotation_from_wxyz(np.array(flange_turn())).as_matrix()
        np.testing.assert_allclose(turn, rotation[0] @ flange, atol=1e-9)


def test_tip_target_comes_into_its_half_plane():
    wrist = wrist_of(READY_JOINTS, 0.05)
    for mount, tip, pointing in targets():
        aligned = align(tuple(tip), tuple(mount), tuple(pointing), wrist, FIRST, SETTINGS)
        local = base_of(pointing, aligned.heading).inv().apply(tip - mount)
        if np.hypot(*local[:2]) < SETTINGS.axis:
            continue
        side = 1 if aligned.half_plane == 0 else -1  # dorsal over tendon 1, ventral over the other two
        assert abs(local[1]) < 1e-12
        assert side * local[0] > 0


def test_arm_still_points_as_asked():
    for _, _, pointing in targets(20):
        np.testing.assert_allclose(base_of(pointing, 1.0).apply([0, 0, -1]), pointing, atol=1e-12)


def test_turning_joint_7_by_the_turn_gives_the_heading():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        q = np.array(READY_JOINTS)
        q[6] = rng.uniform(Q_MIN[6], Q_MAX[6])
        wrist = wrist_of(tuple(q), 0.05)
        mount = np.array(wrist.position)
        tip = mount + [*rng.uniform(-0.3, 0.3, 2), -0.3]
        settings = type(SETTINGS)(SETTINGS.half_planes_deg, 10.0, 0.0)
        aligned = align(tuple(tip), wrist.position, DOWN, wrist, FIRST, settings)
        assert aligned.turned is not None
        q[6] -= aligned.turned
        assert Q_MIN[6] <= q[6] <= Q_MAX[6]
        off = Rotation.from_rotvec([0, 0, wrist_of(tuple(q), 0.05).heading - aligned.heading])
        assert off.magnitude() < 1e-6


def test_the_turn_is_the_least_of_all_that_align_and_are_within_limits():
    for seed in range(200):
        rng = np.random.default_rng(seed)
        q = np.array(READY_JOINTS)
        q[6] = rng.uniform(Q_MIN[6], Q_MAX[6])
        wrist = wrist_of(tuple(q), 0.05)
        tip = np.array(wrist.position) + [*rng.uniform(-0.3, 0.3, 2), -0.3]
        no_habit = Aligned(0.0, 0, 0.0)
        settings = type(SETTINGS)(SETTINGS.half_planes_deg, 0.0, 0.0)
        aligned = align(tuple(tip), wrist.position, DOWN, wrist, no_habit, settings)
        local = base_of(DOWN, wrist.heading).inv().apply(tip - wrist.position)
        azimuth = np.arctan2(local[1], local[0])
        every = np.array([azimuth - plane + 2 * np.pi * n for plane in (0, np.pi) for n in range(-3, 4)])
        able = every[(q[6] - every >= Q_MIN[6]) & (q[6] - every <= Q_MAX[6])]
        assert abs(aligned.turned) == pytest.approx(np.abs(able).min(), abs=1e-12)


def test_no_half_plane_within_the_wrists_limits_is_said():
    q = np.array(READY_JOINTS)
    q[6] = Q_MAX[6]
    wrist = wrist_of(tuple(q), 0.05)
    settings = type(SETTINGS)((0.0,), 0.0, 0.0)
    gap = 2 * np.pi - (Q_MAX[6] - Q_MIN[6])  # the headings that joint 7 cannot bring
    away = wrist.heading - gap / 2
    tip = np.array(wrist.position) + [0.2 * np.cos(away), 0.2 * np.sin(away), -0.3]
    assert align(tuple(tip), wrist.position, DOWN, wrist, FIRST, settings).turned is None


def test_another_half_plane_is_taken_once_it_is_nearer_by_the_hysteresis():
    wrist = wrist_of(READY_JOINTS, 0.05)
    last, taken = FIRST, {}
    for degrees in [*np.arange(80.5, 100), *np.arange(99.5, 80, -1)]:
        away = wrist.heading + np.radians(degrees)
        tip = np.array(wrist.position) + [0.2 * np.cos(away), 0.2 * np.sin(away), -0.3]
        aligned = align(tuple(tip), wrist.position, DOWN, wrist, last, SETTINGS)
        if aligned.half_plane != last.half_plane:
            taken[aligned.half_plane] = degrees
        last = aligned
    assert taken == {1: 95.5, 0: 84.5}  # the other asks for 2 · (degrees - 90) less


def test_a_tip_target_on_the_axis_turns_nothing():
    wrist = wrist_of(READY_JOINTS, 0.05)
    tip = np.array(wrist.position) + [0.01, 0.01, -0.4]
    last = Aligned(1.2, 1, 0.3)
    assert align(tuple(tip), wrist.position, DOWN, wrist, last, SETTINGS) == last
