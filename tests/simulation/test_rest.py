"""Coming to rest: one by one, and only if there is time."""

import numpy as np

from tests.support.matched_plant import small_model
from trunkline.simulation.motion import batch_of
from trunkline.simulation.rest import CHUNK, come_to_rest, relax

SPEED = 1e-5  # rad/s


def bent(angles):
    """A batch of arms that start with all hinges at one of `angles`, rad."""
    model = small_model()
    batch = batch_of(model, len(angles))
    batch.bind("qpos")[:] = np.repeat(np.array(angles)[:, None], model.nq, axis=1)
    batch.bind("ctrl")[:] = batch.bind("act")[:] = model.tendon_length0 + 0.3
    return batch, relax(batch, model)


def test_one_that_rests_takes_no_more_steps():
    taken, ends = [], []
    for angles in ([0.0], [0.2], [0.0, 0.2]):
        batch, timestep = bent(angles)
        moving, steps = come_to_rest(batch, timestep, 10.0, SPEED)
        assert len(moving) == 0
        assert np.abs(batch.bind("qvel")).max() < SPEED
        taken.append(steps)
        ends.append(batch.bind("qpos").copy())
    assert taken[0] < taken[1]
    assert taken[2] == taken[0] + taken[1]
    np.testing.assert_array_equal(ends[2], np.concatenate(ends[:2]))  # alone or with others, the same


def test_one_without_the_time_is_named():
    batch, timestep = bent([0.0, 0.2])
    moving, steps = come_to_rest(batch, timestep, 2 * CHUNK, SPEED)
    assert moving.tolist() == [1]
    assert steps > 0
