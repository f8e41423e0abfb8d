"""Rounded distances: near as they were where it matters, on the same side everywhere, and much smaller when packed."""

import gzip

import numpy as np

from trunkline.unity.frame import unity_volume
from trunkline.unity.rounding import COARSEST, FINEST, rounded

AXIS = np.linspace(-0.8, 0.8, 65)
BALL = np.linalg.norm(np.meshgrid(AXIS, AXIS, AXIS, indexing="ij"), axis=0) - 0.5


def test_a_distance_moves_by_a_64th_of_itself_and_a_millimetre_at_most():
    off = np.abs(rounded(BALL).astype(float) - BALL)
    assert np.all(off <= np.maximum(np.minimum(np.abs(BALL) / 64, COARSEST / 2), 2.0**-25) + 1e-12)
    assert off.max() > 5e-4  # it does round


def test_no_point_changes_sides():
    values = np.concatenate([BALL[np.abs(BALL) > FINEST], [1e-4, -1e-4, 1e-6, -1e-6, 0.0]])
    np.testing.assert_array_equal(np.sign(rounded(values)), np.sign(values))


def test_it_packs_into_two_thirds_of_what_it_was():
    before, after = (len(gzip.compress(unity_volume(values), 9)) for values in (BALL, rounded(BALL)))
    assert after < before * 2 / 3
