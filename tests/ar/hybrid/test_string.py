"""A string pulls and does not push; the assistant's places are those of a mount that is elsewhere."""

import mujoco
import numpy as np
import pytest

from tests.ar.hybrid.conftest import rubbing_arm
from tests.ar.hybrid.test_rollouts import SIZE, way_of
from trunkline.ar.hybrid.assistant import try_places
from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.rollouts import ComposedTwin
from trunkline.ar.hybrid.string import hang
from trunkline.ar.hybrid.uncertainty import Contact, GraspUncertainty
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm.spiral import spiral_chain

BALL, PLACE, LENGTH = GraspObject("sphere", 0.05, 0.05, 0.1, "plastic"), np.array([0.0, 0.0, 1.0]), 0.15


def hung() -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    BALL.add_to(spec, PLACE)
    hang(spec, PLACE, BALL.diameter / 2, LENGTH)
    return spec.compile()


def run(model: mujoco.MjModel, seconds: float, force=(0.0, 0.0, 0.0), speed=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Path of the ball, m."""
    data, body = mujoco.MjData(model), model.body("object").id
    dof = model.jnt_dofadr[model.joint("object").id]
    data.qvel[dof : dof + 3] = speed
    data.xfrc_applied[body, :3] = force
    path = []
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        path.append(data.xpos[body].copy())
    return np.array(path)


def test_it_bears_what_hangs():
    path = run(hung(), 2.0)
    assert np.abs(path - PLACE).max() < 2e-3


def test_it_does_not_push_what_is_lifted():
    weight = BALL.mass * 9.81
    rises = run(hung(), 0.1, force=(0.0, 0.0, 1.5 * weight))
    free = 0.5 * (0.5 * 9.81) * 0.1**2
    assert rises[-1, 2] - PLACE[2] == pytest.approx(free, rel=0.1)


def test_it_swings_as_a_pendulum():
    path = run(hung(), 2.0, speed=(0.1, 0.0, 0.0))
    crossings = np.flatnonzero(np.diff(np.sign(path[:, 0])))
    period = 2 * np.mean(np.diff(crossings)) * 0.002
    length = LENGTH + BALL.diameter / 2
    inertia = 1 + 0.4 * (BALL.diameter / 2) ** 2 / length**2  # the ball turns along, tied at its surface
    assert period == pytest.approx(2 * np.pi * np.sqrt(length * inertia / 9.81), rel=0.1)


@pytest.fixture(scope="module")
def beside() -> ComposedTwin:
    """A short arm that curls towards a ball on a string."""
    arm = rubbing_arm(spiral_chain(**SIZE), 3)
    place = np.array([0.045, 0.0, -0.17])
    spec = compose(arm, FixedMount("fixed"), None, Placed(BALL, place))
    hang(spec, place, BALL.diameter / 2, LENGTH)
    return ComposedTwin(spec.compile(), arm.compile())


def test_a_place_from_which_nothing_is_touched_differs_from_one_that_pushes(beside):
    doubts = GraspUncertainty(contact=Contact(0.0, (0.0, 0.0, 0.0)))
    still = Holding(0.1, sag=0.002, slip=0.5)  # here: it stays where it hangs
    offsets = np.array([[0.0, 0.0, 0.0], [-0.3, 0.0, 0.0]])  # m, of the mount
    shares = try_places(beside, way_of(beside.arm), doubts, still, offsets, 2)
    assert shares.tolist() == [0.0, 1.0]
