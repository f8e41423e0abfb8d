"""How far the links reach, by hand: from the shoulder at 0.333 m, both links stretched, a_7 beside the wrist."""

import numpy as np
import pytest

from trunkline.kinematics.panda.labels import beyond_links

UPPER, FORE = np.hypot(0.316, 0.0825), np.hypot(0.384, 0.0825)  # m
SHOULDER, FLANGE, BESIDE = 0.333, 0.107, 0.088


@pytest.mark.parametrize("offset", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("azimuth", [0.0, 2.0])
@pytest.mark.parametrize(("by", "beyond"), [(-1e-6, False), (1e-6, True)])
@pytest.mark.parametrize("level", [0.0, 0.6, -0.6])
def test_no_point_is_further_from_the_shoulder_than_both_links(level, by, beyond, azimuth, offset):
    """Where the wrist is at an angle of `level` rad above the shoulder, the mount is FLANGE and the offset below."""
    reach = UPPER + FORE + by
    away, height = BESIDE + reach * np.cos(level), SHOULDER + reach * np.sin(level) - FLANGE - offset
    point = [away * np.cos(azimuth), away * np.sin(azimuth), height]
    assert beyond_links(np.array([point]), offset).tolist() == [beyond]


def test_near_the_axis_only_the_height_counts():
    height = SHOULDER + UPPER + FORE - FLANGE
    points = np.array([[0.0, 0.0, height - 1e-6], [0.05, 0.0, height - 1e-6], [0.05, 0.0, height + 1e-6]])
    assert beyond_links(points, 0.0).tolist() == [False, False, True]
