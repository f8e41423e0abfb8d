"""The stranger on a base that moves: its accelerations against MuJoCo's inverse dynamics of the same chain."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from demo.plants.bench import LOOSE
from demo.plants.stranger import Stranger
from demo.plants.stranger_kernel import accelerate, bend, place, pull, work_for
from rehearsal.robot.kernel import set_moving
from rehearsal.robot.stand_in import straight_state
from tests.rehearsal.arm import stranger
from tests.support.stranger_links import add_link
from trunkline.frames import wxyz_from_rotation
from trunkline.model.arm.spiral import spiral_chain

UNITS = 4
GRAVITY = np.array([0.0, 0.0, -9.80665])


@pytest.fixture(scope="module")
def plant() -> Stranger:
    """Springs alone: no friction, nothing that relaxes."""
    bare = replace(stranger().settings, branches=[], sliders=[], viscous_time=1e-12, hardening=0.0)
    return Stranger(spiral_chain(0.507, 0.08, 0.012, UNITS), bare, 3, np.random.default_rng(1))


def chain(plant: Stranger) -> mujoco.MjModel:
    """The same links on a free base."""
    links, spec = plant.links, mujoco.MjSpec()
    spec.compiler.degree = spec.compiler.autolimits = False
    spec.option.gravity = GRAVITY
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    body = spec.worldbody.add_body(name="base")
    body.add_freejoint()
    body.explicitinertial, body.mass, body.inertia, body.ipos = True, 1.0, [1e-3] * 3, [0, 0, 0]
    for i in range(len(links.lengths)):
        body = add_link(body, links, i)
    return spec.compile()


@pytest.mark.parametrize("seed", range(3))
def test_no_force_beyond_the_springs_is_needed_for_its_accelerations(plant, seed):
    """The base in any pose, at any velocity and acceleration, turning too: MuJoCo finds no torque left in any joint."""
    rng = np.random.default_rng(seed)
    state, work, h = straight_state(plant, np.full(3, -LOOSE)), work_for(plant.links, 3), 1e-9
    state.q[:], state.v[:] = 0.03 * rng.normal(size=state.q.shape), 2 * rng.normal(size=state.v.shape)
    turn = Rotation.from_quat(rng.normal(size=4))
    spin, speed, spinning, speeding = 3 * rng.normal(size=(4, 3))
    before = state.v.copy()
    place(plant.links, state, work)
    bend(plant.links, state, work, h, 1.0, False)
    pull(plant.links, state, work, h, np.zeros(3), plant.straight)
    rows = tuple(map(tuple, turn.as_matrix()))
    set_moving(work, state, rows, tuple(spin), tuple(speed), tuple(spinning), tuple(speeding))
    accelerate(plant.links, state, work, h, turn.inv().apply(GRAVITY), 0.0)

    model = chain(plant)
    data = mujoco.MjData(model)
    data.qpos[:] = [0.1, 0.2, 0.3, *wxyz_from_rotation(turn), *state.q.ravel()]
    data.qvel[:] = [*speed, *turn.inv().apply(spin), *before.ravel()]
    data.qacc[:] = [*speeding, *turn.inv().apply(spinning), *(state.v - before).ravel() / h]
    mujoco.mj_inverse(model, data)
    scale = np.abs(data.qfrc_bias[6:]).max()
    assert np.abs(data.qfrc_inverse[6:]).max() < 1e-4 * scale
    data.qacc[:6] = 0.0  # without the base's acceleration there would be some
    mujoco.mj_inverse(model, data)
    assert np.abs(data.qfrc_inverse[6:]).max() > 1e-2 * scale
