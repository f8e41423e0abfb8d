"""Coming to rest: one by one, only if there is time, and nowhere that MuJoCo's own steps do not lead."""

import mujoco
import numpy as np

from tests.support.matched_plant import small_model
from tests.support.small_arm import small_spec
from trunkline.frames import gravity_in_base
from trunkline.model.simulation.motion import batch_of
from trunkline.model.simulation.rest import FIRST_SPAN, come_to_rest, lead_to_rest, relax


def bent(angles):
    """A batch of arms that start with all hinges at one of `angles`, rad."""
    model = small_model()
    batch = batch_of(model, len(angles))
    batch.bind("qpos")[:] = np.repeat(np.array(angles)[:, None], model.nq, axis=1)
    batch.bind("ctrl")[:] = batch.bind("act")[:] = model.tendon_length0 + 0.3
    return batch, relax(batch, model)


def test_alone_or_with_others_it_is_the_same_rest():
    ends = []
    for angles in ([0.0], [0.2], [0.0, 0.2]):
        batch, timestep = bent(angles)
        moving, _ = come_to_rest(batch, timestep, 10.0)
        assert len(moving) == 0
        ends.append(batch.bind("qpos").copy())
    np.testing.assert_array_equal(ends[2], np.concatenate(ends[:2]))


def test_one_without_the_time_is_named():
    batch, timestep = bent([0.0, 0.4])
    moving, steps = come_to_rest(batch, timestep, timestep)
    assert moving.tolist() == [1]
    assert steps > 0


def pressed(**motors):
    """Arms whose tendons press on them; so they creep."""
    model = small_spec(6, **motors).compile()
    batch = batch_of(model, 2)
    batch.expand("opt.gravity")[:] = gravity_in_base(0.0)
    batch.bind("act")[:] = batch.bind("ctrl")[:] = model.tendon_length0 - [[0.005, 0.004, 0.005], [0.004, 0.004, 0.003]]
    return batch, relax(batch, model)


def test_steps_alone_lead_to_the_same_rest():
    batch, timestep = pressed()
    batch.step(nstep=round(400 / timestep))
    plain = batch.bind("qpos").copy()
    batch, timestep = pressed()
    moving, steps = come_to_rest(batch, timestep, 30.0)
    assert not len(moving)
    assert steps < 0.1 * batch.nsim * 400 / timestep
    np.testing.assert_allclose(batch.bind("qpos"), plain, atol=1e-6)


def test_what_is_led_to_rest_stays_there():
    batch, timestep = pressed()
    moving, _ = come_to_rest(batch, timestep, 30.0)
    assert not len(moving)
    place = batch.bind("qpos").copy()
    batch.step(nstep=round(10 * FIRST_SPAN / timestep))
    np.testing.assert_allclose(batch.bind("qpos"), place, atol=1e-9)


def test_stiff_motors_do_not_throw_the_arm_to_and_fro():
    batch, timestep = pressed(kp=100e3, kv=27)
    moving, _ = come_to_rest(batch, timestep, 30.0)
    assert not len(moving)


def test_no_arm_is_left_standing_where_it_would_fall_from():
    """Upside down, weak springs hold no straight arm; straight, though, nothing pushes it to a side."""
    spec = small_spec(6)
    spec.option.gravity = [0, 0, 60.0]
    model = spec.compile()
    model.jnt_stiffness[:] = 1e-2
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    batch = batch_of(model, 1)
    batch.bind("act")[:] = batch.bind("ctrl")[:] = model.tendon_length0 + 0.3
    relax(batch, model)
    left, _ = lead_to_rest(batch, np.array([0], dtype=np.int32))
    assert left.tolist() == [0]
