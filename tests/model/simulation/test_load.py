"""A load at the tip in some simulations moves the arm as one that was compiled into the model."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.small_arm import small_spec
from trunkline.frames import gravity_in_base
from trunkline.model.simulation.load import hang
from trunkline.model.simulation.motion import batch_of, move
from trunkline.model.simulation.rest import come_to_rest, relax

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

    def run(batch, rows):
        batch.expand("opt.gravity")[:] = gravity
        batch.bind("act")[:] = controls[:rows, 0]
        swing = move(batch, controls[:rows], ("site_xpos",))["site_xpos"][:, :, model.site("tip").id].copy()
        sites = batch.bind("site_xpos")
        timestep = relax(batch, model)
        moving, _ = come_to_rest(batch, timestep, 20.0)
        assert not len(moving)
        return swing, sites[:, model.site("tip").id].copy()

    batch = batch_of(model, len(LOADS))
    hang(batch, model, LOADS)
    swings, rests = run(batch, 3)
    for load, swing, rest in zip(LOADS, swings, rests, strict=True):
        (expected,), (settled,) = run(batch_of(compiled(load, turned), 1), 1)
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
