"""Objects of the experiments: each where it can be, standing or hanging as its shape asks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rehearsal import settings
from rehearsal.experiments.grasp import Offered, offered
from rehearsal.experiments.handle import STANDING
from tests.support.operator import config
from trunkline.errors import InputError

BENCH = SimpleNamespace(config=config())


@pytest.fixture(scope="module")
def objects() -> list[Offered]:
    return [offered(BENCH, settings.grasped(), np.random.default_rng(seed)) for seed in range(60)]  # type: ignore[arg-type]


def test_some_hang_and_some_stand(objects):
    names = [object.name for object in objects]
    assert set(names) == {"hanging cylinder", "standing basket"}
    assert 15 < names.count("standing basket") < 45


def test_what_is_handed_over_stood_on_a_surface():
    s = settings.grasped()
    rng = np.random.default_rng(0)
    assert all(offered(BENCH, s, rng, STANDING).stands is not None for _ in range(20))  # type: ignore[arg-type]
    del s.shapes["basket"]
    with pytest.raises(InputError, match="shapes: found cylinder, expected basket as well"):
        offered(BENCH, s, rng, STANDING)  # type: ignore[arg-type]


def test_what_stands_does_so_on_its_stand_and_what_hangs_has_none(objects):
    for placed in objects:
        object = placed.object
        assert object.hanging == (placed.stands is None)
        if placed.stands is not None:
            above = np.add(placed.stands.top, [0, 0, object.half_height])
            np.testing.assert_allclose(object.position, above, atol=1e-12)
            assert min(placed.stands.size[:2]) > np.hypot(object.basket.width, object.basket.length)


def test_what_is_gripped_is_level_across_the_way_of_the_arm_and_within_bounds(objects):
    s = settings.grasped()
    for placed in objects:
        of, object = s.shapes[placed.object.shape], placed.object
        turn = Rotation.from_quat(object.quaternion, scalar_first=True)
        grip = np.array(object.position) + turn.apply(object.grip)
        assert of.low <= grip[2] <= of.high
        assert s.near <= np.hypot(*grip[:2]) <= s.far
        assert of.thin <= object.diameter <= of.wide
        assert of.light <= object.mass <= min(of.heavy, config().handling.heaviest(object.shape, object.diameter))
        axis = turn.apply([0, 1, 0] if object.shape == "basket" else [0, 0, 1])
        assert abs(axis @ placed.towards) < 1e-9
        assert abs(axis[2]) < 1e-9
