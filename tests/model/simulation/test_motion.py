"""The stepper in batch against plain mj_step, to the last bit."""

import mujoco
import numpy as np
import pytest

from tests.support.matched_plant import small_model
from tests.support.small_arm import small_spec
from trunkline.model.simulation import motion
from trunkline.model.simulation.motion import batch_of, hold, move

STEPS = 24


@pytest.fixture
def model():
    return small_model()


def pulled(model, pulls):
    """Controls (n, STEPS, nu) that draw tendon 1 in by up to `pulls` m, (n,)."""
    controls = np.tile(model.tendon_length0, (len(pulls), STEPS, 1))
    controls[:, :, 0] -= np.outer(pulls, np.linspace(0, 1, STEPS))
    return controls


def stepped(model, controls):
    """Sites before and angles after each step, by mj_step."""
    data, sites, angles = mujoco.MjData(model), [], []
    for control in controls:
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        sites.append(data.site_xpos.copy())
        angles.append(data.qpos.copy())
    return np.array(sites), np.array(angles)


@pytest.mark.parametrize("chunk", [5, 8, 1000])
def test_a_batch_moves_as_mj_step_does(model, monkeypatch, chunk):
    monkeypatch.setattr(motion, "CHUNK", chunk)
    controls = pulled(model, [0.0, 0.02, 0.04])
    counts = []
    batch = batch_of(model, 3)
    recorded = move(batch, controls, ("site_xpos", "qpos"), every=4, at=3, moved=counts.append)
    assert sum(counts) == STEPS // 4
    for row, control in enumerate(controls):
        sites, angles = stepped(model, control)
        np.testing.assert_array_equal(recorded["site_xpos"][row], sites[3::4])
        np.testing.assert_array_equal(recorded["qpos"][row], angles[3::4])


def test_only_those_named_move(model):
    controls = pulled(model, [0.02, 0.04])
    batch = batch_of(model, 3)
    recorded = move(batch, controls, ("qpos",), ids=np.array([0, 2], dtype=np.int32))
    angles = batch.bind("qpos")
    np.testing.assert_array_equal(angles[1], model.qpos0)
    np.testing.assert_array_equal(angles[[0, 2]], recorded["qpos"][:, -1])


def test_contacts_are_left_out_only_where_nothing_can_touch(model):
    contact = mujoco.mjtDisableBit.mjDSBL_CONTACT
    assert batch_of(model, 1).get_model(0).opt.disableflags & contact
    model.geom_contype[1:] = model.geom_conaffinity[1:] = 1
    assert not batch_of(model, 1).get_model(0).opt.disableflags & contact


DELAY = 12  # steps


def delayed(model_of=small_spec):
    spec = model_of()
    for actuator in spec.actuators:
        actuator.delay, actuator.nsample = DELAY * spec.option.timestep, 2 * DELAY
    return spec.compile()


def test_a_dead_time_moves_the_motion_and_changes_nothing_else():
    """Held beforehand, the arm does the same, so many steps later."""
    prompt, late = small_spec().compile(), delayed()
    paths = []
    for model in (prompt, late):
        batch = batch_of(model, 1)
        batch.expand("opt.gravity")[:] = 0  # straight and without pull, it is at rest
        hold(batch, model, model.tendon_length0[None])
        paths.append(move(batch, pulled(model, [0.03]), ("qpos",))["qpos"][0])
    np.testing.assert_array_equal(paths[1][:DELAY], 0)
    np.testing.assert_allclose(paths[1][DELAY:], paths[0][:-DELAY], atol=1e-12)


def test_motors_that_are_held_pull_as_long_before():
    """Neither filter nor dead time begins at a length of 0, which would pull with all force."""
    model = delayed()
    batch = batch_of(model, 2)
    hold(batch, model, np.repeat(model.tendon_length0[None] - 0.01, 2, axis=0))
    forces = move(batch, np.tile(model.tendon_length0 - 0.01, (2, 3, 1)), ("actuator_force",))["actuator_force"]
    kp = model.actuator_gainprm[0, 0]
    np.testing.assert_allclose(forces[:, 0], -0.01 * kp, rtol=1e-6)
