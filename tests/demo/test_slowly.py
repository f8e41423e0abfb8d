"""The lab's arm brought slowly to a pose: where it then is, from which side it came, and what is no rest."""

import numpy as np
import pytest

from demo.plants.at_once import tips_at_once
from demo.plants.bench import LOOSE
from demo.plants.choice import plant_of
from demo.plants.slowly import LOOK, SWINGING, Slow, rested, slow_tips
from tests.demo.conftest import Watched
from trunkline.frames import STANDARD_GRAVITY

SLOW = Slow(0.2, 40.0, 0.1, 1.3, 0.1, 0.1, 0.1)


def slowly(plant, lab, pulls, back):
    gravity = np.tile([0.0, 0.0, -STANDARD_GRAVITY], (len(pulls), 1))
    return slow_tips(plant, lab.arm, SLOW, np.array(pulls), gravity, np.array(back))


def test_a_hanging_arm_is_where_its_rest_is(lab):
    plant, gravity = plant_of(lab), np.array([[0.0, 0.0, -STANDARD_GRAVITY]])
    loose = np.full((1, 3), -LOOSE)
    tips = slow_tips(plant, lab.arm, SLOW, loose, gravity, np.array([False]))
    assert np.linalg.norm(tips - tips_at_once(plant, lab.arm, loose, gravity)) < 1e-3
    assert tips[0, 2] == pytest.approx(-lab.arm.length, abs=0.01)


def test_a_pull_from_beyond_goes_further_first_and_both_end_where_they_are_sent(lab):
    plant = Watched()
    slowly(plant, lab, [[0.04, -0.02, -0.02], [0.04, -0.02, 0.01]], [False, True])
    ((bench, tracked),) = plant.asked
    straight, beyond = bench.commands
    assert tracked == [lab.arm.units - 1]
    assert straight[:, 0].max() == pytest.approx(0.04)
    np.testing.assert_allclose(beyond.max(axis=0), [0.04 * 1.3, -LOOSE, 0.01 * 1.3], rtol=0.01)
    np.testing.assert_allclose(bench.commands[:, -1], [[0.04, -LOOSE, -LOOSE], [0.04, -LOOSE, 0.01]])
    np.testing.assert_allclose(bench.commands[:, 0, 0], 0)
    assert bench.steady == 0


def test_an_arm_that_only_hangs_is_steadied_and_comes_back_in_its_place(lab):
    plant = Watched()
    slowly(plant, lab, [[-0.02] * 3, [0.03, -0.02, -0.02]], [True, False])
    steady = {len(bench.commands): bench.steady for bench, _ in plant.asked}
    assert [bench.steady for bench, _ in plant.asked] == [0.0, SLOW.settle]
    assert steady == {1: SLOW.settle}
    assert (plant.asked[1][0].commands == -LOOSE).all()


@pytest.mark.parametrize(("share", "at_rest"), [(0.0, True), (0.9, True), (1.1, False)])
def test_an_arm_that_still_swings_has_no_tip_at_rest(share, at_rest):
    ways = np.linspace(0, 1, 50)[None, :, None] * np.array([0.0, share * SWINGING * LOOK, 0.0])
    assert np.isfinite(rested(ways)).all() == at_rest
    assert not np.isfinite(rested(np.full((1, 50, 3), np.nan))).any()


def test_a_swinging_arm_is_told_so(lab):
    (tip,) = slowly(Watched([0.0, 0.01, 0.0]), lab, [[0.04, -0.02, -0.02]], [False])
    assert np.isnan(tip).all()
