"""Directions of gravity: even, from any side, and no azimuth stands in for another."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.support.bent_chain import hardening_stump, stump
from trunkline.frames import STANDARD_GRAVITY, downwards, gravity_in_base, in_plane_of_tilt, tilt_of_gravity
from trunkline.kinematics.dataset.deviation import mujoco_deviation
from trunkline.kinematics.dataset.gravities import Directions, Tilts, spread
from trunkline.kinematics.dataset.sampling import workspace_surface_at
from trunkline.kinematics.dataset.table import sample_table
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium

THIRD = 2 * np.pi / 3  # rad, between two tendons


def test_a_direction_is_told_by_its_angle_and_azimuth():
    np.testing.assert_allclose(STANDARD_GRAVITY * downwards(0.7, 0.0), gravity_in_base(0.7), atol=1e-12)
    turned = downwards(0.7, np.array([0.0, THIRD]))
    assert tilt_of_gravity(turned[1]) == pytest.approx(0.7)
    np.testing.assert_allclose(in_plane_of_tilt(turned[1:, :2], turned[1, :2])[:, 0], [np.sin(0.7), 0], atol=1e-12)


def test_directions_spread_evenly_over_the_cap_and_begin_with_that_of_the_hanging_arm():
    downs = spread(400, np.radians(120))
    np.testing.assert_allclose(np.linalg.norm(downs, axis=1), 1)
    np.testing.assert_allclose(downs[0], [0, 0, -1], atol=1e-12)
    angles = np.arccos(-downs[:, 2])
    assert angles.max() == pytest.approx(np.radians(120))
    assert (angles < np.radians(60)).mean() == pytest.approx(1 / 3, abs=0.01)  # the share of the cap's area
    nearest = cKDTree(downs).query(downs, k=2)[0][:, 1]
    assert nearest.min() > 0.5 * nearest.max()
    crowded = np.arccos(-spread(400, np.radians(120), crowd=True)[:, 2])
    assert (crowded > np.radians(110)).sum() > 1.5 * (angles > np.radians(110)).sum()


def test_both_forms_give_unit_vectors_and_tilts_stay_in_their_plane():
    tilts = Tilts(8, 8, "tilt", [0.0, 30.0, 90.0]).downs
    np.testing.assert_allclose(STANDARD_GRAVITY * tilts, gravity_in_base(np.radians([0, 30, 90])), atol=1e-12)
    directions = Directions(8, 8, "direction", 50, 90.0).downs
    assert directions.shape == (50, 3)
    assert np.abs(directions[:, 1]).max() > 0.9


def turned_about_the_arm(positions):
    return positions @ np.array([[np.cos(THIRD), np.sin(THIRD), 0], [-np.sin(THIRD), np.cos(THIRD), 0], [0, 0, 1]])


@pytest.mark.parametrize(("make", "symmetric"), [(stump, True), (hardening_stump, False)])
def test_only_a_perfect_arm_turns_with_gravity_and_its_tendons(make, symmetric):
    """So samples are drawn all around: an identified arm rests bent, and its hinges and tendons differ."""
    chain = read_chain(make())
    pulls = np.array([[6.0, 3.0, 0.0], [0.0, 5.0, 0.0]])
    here = equilibrium(chain, pulls, STANDARD_GRAVITY * downwards(0.9, 0.2)).position
    there = equilibrium(chain, np.roll(pulls, 1, axis=1), STANDARD_GRAVITY * downwards(0.9, 0.2 + THIRD)).position
    apart = np.linalg.norm(there - turned_about_the_arm(here), axis=1)
    # two hinges at right angles are not quite the same after a third of a turn, even so
    assert apart.max() < 0.02 * chain.length if symmetric else apart.min() > 0.08 * chain.length


def test_samples_under_gravity_from_the_side_rest_where_mujoco_does(model, chain):
    rng = np.random.default_rng(0)
    down = downwards(1.1, 2.0)
    table, density = sample_table(chain, down, 60, 8, 12, rng)
    np.testing.assert_allclose(table[["gx", "gy", "gz"]].to_numpy(), np.tile(down, (len(table), 1)))
    assert density.angle == pytest.approx(1.1)
    deviation = mujoco_deviation(model, chain, table, 6, rng)
    assert deviation["rested"].all()
    assert deviation["deviation_mm"].max() < 0.02


def test_a_sheet_begins_where_the_arm_hangs_and_ends_where_motors_pull_with_all_their_force(chain):
    gravity = STANDARD_GRAVITY * downwards(0.8, 1.0)
    sheet = workspace_surface_at(chain, gravity, 9, 6)
    hanging = equilibrium(chain, np.zeros((1, 3)), gravity).position[0]
    np.testing.assert_allclose(sheet[:, 0], np.tile(hanging, (9, 1)), atol=1e-6)
    dorsal = equilibrium(chain, np.array([[chain.max_tension[0], 0, 0]]), gravity).position[0]
    np.testing.assert_allclose(sheet[0, -1], dorsal, atol=1e-5)
