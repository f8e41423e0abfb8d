"""Commands sent at once to the lab's arm: how it hangs before, what it is sent, and what counts as rest."""

import numpy as np
import pytest

from demo.plants.at_once import LOOK, STILL, WAITS, rested, tips_at_once
from demo.plants.bench import COMMAND_RATE, LOOSE, Bench
from demo.plants.cousin import Cousin
from tests.demo.conftest import Watched
from tests.demo.test_laboratory import PLANT
from trunkline.model.arm.spiral import spiral_chain

GRAVITY = np.array([[0.0, 6.0, -7.0], [5.0, 0.0, -8.0]])
SWAY = [1.5 * STILL, 0.0, 0.0]  # m: more than at rest


def test_the_arm_hangs_first_and_is_then_sent_the_commands_as_they_are(lab):
    plant, pulls = Watched(SWAY, [0, 0]), np.array([[0.04, -0.02, 0.001], [0.0, -0.5, 0.06]])
    tips_at_once(plant, lab.arm, pulls, GRAVITY)
    ((bench, tracked),) = plant.asked
    assert bench.hanging
    assert tracked == [lab.arm.units - 1]
    np.testing.assert_array_equal(bench.gravity, GRAVITY)
    assert (bench.commands[:, 0] == -LOOSE).all()
    assert (bench.commands[:, 1:] == pulls[:, None]).all()
    assert bench.commands.shape[1] == WAITS[0] * COMMAND_RATE
    assert (bench.steady, bench.since) == (0.0, WAITS[0] - LOOK)


def test_an_arm_that_still_moves_is_waited_for_and_then_has_no_tip(lab):
    plant = Watched(SWAY, [0, 1, 2])
    tips = tips_at_once(plant, lab.arm, np.full((3, 3), 0.01), np.tile([0.0, 0.0, -9.81], (3, 1)))
    assert [(len(bench.commands), bench.commands.shape[1] / COMMAND_RATE) for bench, _ in plant.asked] == [
        (3, WAITS[0]), (2, WAITS[1]),
    ]  # fmt: skip
    assert np.isfinite(tips).all(axis=1).tolist() == [True, True, False]


@pytest.mark.parametrize(("share", "at_rest"), [(0.0, True), (0.99, True), (1.01, False), (np.nan, False)])
def test_an_arm_is_at_rest_where_its_tip_stays(share, at_rest):
    """Also where it is back at the end; at rest it is in the middle of its way."""
    there = np.sin(np.linspace(0, np.pi, 51))[None, :, None] * np.array([0.0, share * STILL, 0.0])
    tip = rested(there)
    assert np.isfinite(tip).all() == at_rest
    assert not at_rest or 0 <= tip[0, 1] <= share * STILL


def test_the_cousin_hangs_at_rest_under_a_tilted_mount(lab):
    cousin = Cousin(spiral_chain(0.3, 0.06, 0.012, 5), PLANT, 3, np.random.default_rng(0))
    loose = np.full((2, round(0.5 * COMMAND_RATE), 3), -LOOSE)
    places = cousin.run("test", Bench(GRAVITY, loose, np.zeros_like(loose), np.zeros(2), hanging=True), [4]).positions
    assert np.ptp(places, axis=1).max() < 1e-3, "it creeps where joints rub"
    assert np.abs([places[0, 0, 0, 1], places[1, 0, 0, 0]]).min() > 0.05, "it leans"
