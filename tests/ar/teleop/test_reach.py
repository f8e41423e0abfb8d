"""Reach by maps: what is inside, how far the rest is outside, and that what is offered is reachable and the nearest."""

import numpy as np
import pytest

from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.signed_map import SignedMap
from trunkline.ar.teleop.tilt_reach import TiltReach
from trunkline.errors import InputError
from trunkline.kinematics.sdf.grid import Lattice, blend

DOWN = (0.0, 0.0, -1.0)
SPACING = 0.01


def ball(center, radius) -> SignedMap:
    axes = [np.arange(n) * SPACING - 0.3 for n in (61, 61, 71)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = np.linalg.norm(points - center, axis=-1) - radius
    return SignedMap(values.astype(np.float32), (-0.3, -0.3, -0.3), SPACING)


CENTER = np.array([0.05, 0.0, 0.0])
ANGLES = np.radians([0.0, 30.0, 60.0])
RADII = (0.10, 0.14, 0.12)
REACH = MapReach(ball(np.zeros(3), 0.2), TiltReach([ball(CENTER, radius) for radius in RADII], ANGLES))


def gravity(angle, azimuth=0.0):
    return (
        float(np.sin(angle) * np.cos(azimuth)),
        float(np.sin(angle) * np.sin(azimuth)),
        float(-np.cos(angle)),
    )


def points(count=200, seed=0):
    return np.random.default_rng(seed).uniform(-0.28, 0.28, (count, 3))


def test_a_point_is_read_as_the_lattice_is_sampled():
    lattice = Lattice(np.full(3, -0.3), SPACING, (61, 61, 71))
    signed_map = ball(CENTER, 0.1)
    some = np.random.default_rng(1).uniform(-0.29, 0.29, (300, 3))
    np.testing.assert_allclose(
        [signed_map.at(tuple(p)) for p in some], lattice.sample(signed_map.values, some), atol=1e-7
    )


def test_between_two_gravity_angles_the_maps_are_blended():
    lattice = Lattice(np.full(3, -0.3), SPACING, (61, 61, 71))
    fields = np.stack([ball(CENTER, radius).values for radius in RADII])
    for angle in np.radians([0.0, 7.0, 30.0, 44.0, 60.0]):
        expected = lattice.sample(blend(fields, ANGLES, angle), points())
        for point, value in zip(points(), expected, strict=True):
            reading = REACH.soft(tuple(map(float, point)), gravity(angle))
            assert reading.where == ("inside" if value <= 0 else "outside")
            assert reading.outside_by == pytest.approx(max(value, 0.0), abs=1e-6)


def test_what_is_offered_is_the_nearest_reachable_point():
    for point in points():
        reading = REACH.rigid(tuple(map(float, point)), DOWN)
        away = np.linalg.norm(point)
        if away <= 0.2:
            continue
        assert reading.where == "outside"
        assert reading.outside_by == pytest.approx(away - 0.2, abs=1e-3)
        assert REACH.rigid(reading.offer, DOWN).where == "inside"
        # the nearest of a ball is on its surface, straight towards the point; to within the lattice
        assert np.linalg.norm(point - reading.offer) < away - 0.2 + 0.3 * SPACING


def test_a_point_beyond_the_lattice_is_outside_by_the_way_to_it_at_least():
    reading = REACH.rigid((0.9, 0.0, 0.0), DOWN)
    assert reading.where == "outside"
    assert reading.outside_by == pytest.approx(0.7, abs=0.01)
    assert np.linalg.norm(np.array(reading.offer) - [0.9, 0.0, 0.0]) < 0.7 + 1e-3


@pytest.mark.parametrize("turn", [1, -1])
def test_gravity_in_another_tendons_plane_is_the_same_map_turned(turn):
    angle, third = np.radians(40.0), turn * 2 * np.pi / 3
    for point in points(50):
        there = np.array([[np.cos(third), -np.sin(third), 0], [np.sin(third), np.cos(third), 0], [0, 0, 1]]) @ point
        here = REACH.soft(tuple(map(float, point)), gravity(angle))
        reading = REACH.soft(tuple(map(float, there)), gravity(angle, third))
        assert reading.where == here.where
        assert reading.outside_by == pytest.approx(here.outside_by, abs=1e-6)


def test_what_no_map_tells_is_unknown():
    assert REACH.rigid((0.0, 0.0, 0.0), (0.1, 0.0, -(0.99**0.5))).where == "unknown"
    assert REACH.soft((0.0, 0.0, 0.0), gravity(np.radians(40.0), np.radians(60.0))).where == "unknown"
    assert REACH.soft((0.0, 0.0, 0.0), gravity(np.radians(75.0))).where == "unknown"
    assert REACH.soft((0.05, 0.0, 0.0), gravity(np.radians(40.0), np.radians(3.0))).where == "inside"
    assert REACH.soft((0.05, 0.0, 0.0), gravity(np.radians(0.5), np.radians(60.0))).where == "inside"  # of no azimuth


def test_maps_that_are_not_there_are_named():
    with pytest.raises(InputError, match="found no 'rigid', expected what the stage reachability writes"):
        MapReach.from_arrays({})
    with pytest.raises(InputError, match="found 1 maps at angles"):
        TiltReach([ball(CENTER, 0.1)], np.zeros(1))


def test_maps_as_the_stage_writes_them():
    arrays = {
        "rigid": ball(np.zeros(3), 0.2).values,
        "rigid_origin": np.full(3, -0.3),
        "rigid_spacing": np.array(SPACING),
        "soft_000": ball(CENTER, 0.1).values.astype(np.float16),
        "soft_030": ball(CENTER, 0.14).values.astype(np.float16),
        "soft_angles": ANGLES[:2],
        "soft_origin": np.full(3, -0.3),
        "soft_spacing": np.array(SPACING),
        "soft_threshold": np.array(0.0),
    }
    reach = MapReach.from_arrays(arrays)
    assert reach.soft((0.16, 0.0, 0.0), gravity(0.0)).where == "outside"
    assert reach.soft((0.16, 0.0, 0.0), gravity(np.radians(30))).where == "inside"
