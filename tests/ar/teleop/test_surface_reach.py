"""Reach by sheets: the surface under any gravity, the nearest point of it, and what it does not know."""

import numpy as np
import pytest

from trunkline.ar.teleop.surface_reach import SheetReach
from trunkline.errors import InputError
from trunkline.frames import downwards
from trunkline.kinematics.dataset.gravities import spread
from trunkline.kinematics.reachability.workspace_surface import Sheets

LARGEST, RADIUS, TOLERANCE = np.radians(100), 0.4, 0.02


def cap(down) -> np.ndarray:
    """A dish of tips below the mount that gravity pulls to its side: linear in gravity, as the weights keep exactly.
    Its first places around are one point. Shape (36, 20, 3)."""
    way, bend = np.meshgrid(np.linspace(0, 2 * np.pi, 36, endpoint=False), np.linspace(0, 2, 20), indexing="ij")
    dish = RADIUS * np.stack([np.sin(bend) * np.cos(way), np.sin(bend) * np.sin(way), -np.cos(bend)], axis=-1)
    return dish + 0.1 * np.asarray(down)


NODES = spread(40, LARGEST, crowd=True)
SHEETS = Sheets(NODES, np.stack([cap(down) for down in NODES]), TOLERANCE)
REACH = SheetReach(SHEETS.points, SHEETS.downs, SHEETS.matrix, TOLERANCE)


def tuples(values):
    return [tuple(map(float, row)) for row in values]


def gravities(count, seed=0):
    rng = np.random.default_rng(seed)
    return tuples(downwards(rng.uniform(0, LARGEST, count), rng.uniform(0, 2 * np.pi, count)))


def points(count, seed=1):
    return tuples(np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 3)))


def test_outside_is_as_far_as_the_surface_of_the_dish_is_less_the_tolerance():
    places = {"inside": 0, "outside": 0}
    for gravity in gravities(10):
        middle = 0.1 * np.array(gravity)
        for point in points(40):
            below = np.array(point) - middle
            if np.arctan2(np.hypot(*below[:2]), -below[2]) > 1.9:
                continue  # beyond the dish's border
            away = abs(np.linalg.norm(below) - RADIUS)
            reading = REACH.read(point, gravity)
            places[reading.where] += 1
            # chords of the lattice lie within the sphere by up to a step squared / (8 R), along and around
            assert reading.outside_by == pytest.approx(max(away - TOLERANCE, 0), abs=3.5e-3)
            if reading.offer is not None:
                assert np.linalg.norm(np.subtract(reading.offer, middle)) == pytest.approx(RADIUS, abs=3.5e-3)
                assert np.linalg.norm(np.subtract(reading.offer, point)) == pytest.approx(
                    reading.outside_by + TOLERANCE
                )
                assert REACH.read(reading.offer, gravity).where == "inside"
    assert min(places.values()) > 10


def test_it_answers_as_the_sheets_of_the_stage_do():
    for gravity in gravities(5, 2):
        sheet = SHEETS.at(np.array(gravity))
        nearest, away = SHEETS.nearest(sheet, np.array(points(40, 3)))
        for point, place, distance in zip(points(40, 3), nearest, away, strict=True):
            reading = REACH.read(point, gravity)
            if reading.offer is None:
                assert distance <= TOLERANCE + 1e-6
            else:  # that looks at triangles near the nearest points only, and may miss the nearest
                assert reading.outside_by <= distance - TOLERANCE + 1e-6
                assert reading.outside_by == pytest.approx(distance - TOLERANCE, abs=1e-3)
                if reading.outside_by > distance - TOLERANCE - 1e-9:
                    np.testing.assert_allclose(reading.offer, place, atol=1e-5)


def test_what_was_asked_before_does_not_change_a_bit():
    asked = [(point, gravity) for gravity in gravities(4) for point in points(3)]
    fresh = SheetReach(SHEETS.points, SHEETS.downs, SHEETS.matrix, TOLERANCE)
    expected = [REACH.read(*query) for query in asked]
    assert [fresh.read(*query) for query in reversed(asked)] == expected[::-1]


def test_gravity_beyond_all_directions_is_unknown():
    for azimuth in (0.0, 2.0, 4.0):
        inside, beyond = (tuple(map(float, downwards(LARGEST + off, azimuth))) for off in (-0.01, 0.01))
        assert REACH.read((0.0, 0.0, -RADIUS), inside).where != "unknown"
        assert REACH.read((0.0, 0.0, -RADIUS), beyond).where == "unknown"


def test_arrays_that_do_not_belong_together_are_named():
    with pytest.raises(InputError, match=r"sheets: found .*expected \(D, R, S, 3\), \(D, 3\) and"):
        SheetReach(SHEETS.points, SHEETS.downs[1:], SHEETS.matrix, TOLERANCE)
