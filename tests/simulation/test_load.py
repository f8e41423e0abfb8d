"""A load at the tip in some simulations moves the arm as one that was compiled into the model."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.small_arm import small_spec
from trunkline.frames import gravity_in_base
from trunkline.simulation.load import hang, slowing
from trunkline.simulation.motion import batch_of, move
from trunkline.simulation.rest import come_to_rest, creep_to_rest, relax

LOADS = np.array([0.0, 0.05, 0.4])


def compiled(load: float, turned: bool = False) -> mujoco.MjModel:
    """A model whose point of `load` kg at the tip is in the file; `turned`: the last unit's inertia is lopsided."""
    spec = small_spec(6)
    last = spec.body("unit_06")
    if turned:
        last.explicitinertial, last.mass, last.ipos = True, 0.02, [0.004, -0.003, -0.01]
        last.inertia = [3e-6, 5e-6, 7e-6]
        last.iquat = Rotation.from_rotvec([0.5, -0.3, 0.8]).as_quat(scalar_first=True)
    if load:
        ball = last.add_body(pos=list(spec.site("tip").pos))
        ball.explicitinertial, ball.mass, ball.ipos, ball.inertia = True, load, [0, 0, 0], [1e-12] * 3
    model = spec.compile()
    model.dof_damping[:] *= 4
    model.dof_frictionloss[:] = 1e-3 * model.jnt_stiffness
    return model


@pytest.mark.parametrize("turned", [False, True])
def test_a_load_swings_and_hangs_as_one_that_was_compiled(turned):
    model, steps, gravity = compiled(0.0, turned), 400, gravity_in_base(np.radians(70))
    controls = np.tile(model.tendon_length0 - [0.02, -0.3, -0.3], (3, steps, 1))

    def run(batch, rows, loads):
        batch.expand("opt.gravity")[:] = gravity
        batch.bind("act")[:] = controls[:rows, 0]
        swing = move(batch, controls[:rows], ("site_xpos",))["site_xpos"][:, :, model.site("tip").id].copy()
        seen = batch.bind("site_xpos")
        timestep = relax(batch, model)
        batch.expand("dof_damping")[:] *= slowing(model, loads)[:, None]
        moving, _ = come_to_rest(batch, timestep, 20.0, 1e-6)
        assert not len(moving)
        return swing, seen[:, model.site("tip").id].copy()

    batch = batch_of(model, len(LOADS))
    hang(batch, model, LOADS)
    swings, rests = run(batch, 3, LOADS)
    for load, swing, rest in zip(LOADS, swings, rests, strict=True):
        (expected,), (settled,) = run(batch_of(compiled(load, turned), 1), 1, np.array([load]))
        np.testing.assert_allclose(swing, expected, atol=1e-7)
        np.testing.assert_allclose(rest, settled, atol=1e-7)
    tip = np.linalg.norm(rests - rests[0], axis=1)
    assert tip[2] > tip[1] > 0.01, "or the load was not felt"


def test_a_load_comes_on_top_and_is_taken_off_again():
    model = compiled(0.3)
    batch = batch_of(model, 2)
    for loads in ([0.1, 0.0], [0.0, 0.2]):
        hang(batch, model, np.array(loads))
        for total in (batch.expand("body_mass").sum(axis=1), batch.expand("body_subtreemass")[:, 0]):
            np.testing.assert_allclose(total - model.body_mass.sum(), loads, atol=1e-12)


def test_a_load_slows_the_slowest_swing_as_it_is_said_to():
    """Of a single link: the root of the moments of inertia, by hand."""
    spec = small_spec(1)
    model = spec.compile()
    body, tip = model.body("unit_01"), np.linalg.norm(model.site("tip").pos)
    inertia = body.inertia[0] + body.mass[0] * np.sum(body.ipos**2) + model.dof_armature[0]
    expected = [1, np.sqrt(1 + 0.1 * tip**2 / inertia)]
    np.testing.assert_allclose(slowing(model, np.array([0.0, 0.1])), expected, rtol=1e-9)


def test_an_arm_that_is_pressed_upon_is_brought_to_the_same_rest_sooner():
    model = compiled(0.0)
    pulls = np.array([[0.005, 0.004, 0.005], [0.004, 0.004, 0.003]])

    def rest(first, creep):
        batch = batch_of(model, len(pulls))
        batch.expand("opt.gravity")[:] = gravity_in_base(0.0)
        batch.bind("act")[:] = batch.bind("ctrl")[:] = model.tendon_length0 - pulls
        timestep = relax(batch, model)
        seen = batch.bind("site_xpos")
        moving, steps = come_to_rest(batch, timestep, first, 2e-5)
        moving, more = creep_to_rest(batch, timestep, moving, creep, 2e-5)
        return seen[:, model.site("tip").id].copy(), len(moving), steps + more

    plain, left, steps = rest(400.0, 0.0)
    soon, still, fewer = rest(5.0, 60.0)
    assert left == still == 0
    assert fewer < 0.7 * steps
    np.testing.assert_allclose(soon, plain, atol=0.1e-3)
