"""An arm that hangs crooked and was never tilted: its shape, stiffness and damping from releases alone."""

import mujoco
import numpy as np
import pytest

from tests.support.noisy_trials import WEIGHTS, with_values
from tests.support.small_arm import plain_spec
from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.identification.fit.fit import CoarseSearch, Fit, Method, Refinement
from trunkline.identification.fit.identify import identify
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.resting import resting_shape
from trunkline.recordings.trials.trial import Trial

FRAME, FRAMES = 1 / 120, 360
MARKERS = ("1", "2", "3")
CROOKED = np.array([0.06, -0.04, 0.02, 0.05, -0.05, 0.08, 0.03, 0.1])


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    places = dict(zip(MARKERS, (0.1, 0.2, 0.3), strict=True))
    return plain_spec(damping=2.0, timestep=FRAME / 8, load=0.1, markers=places).compile()


@pytest.fixture(scope="module")
def truth(model) -> mujoco.MjModel:
    truth = with_values(model, {"stiffness": 1.7, "damping": 0.15})
    truth.qpos_spring[:] = CROOKED
    return truth


def release(truth, x: float, y: float, split="identify", frames=FRAMES) -> Trial:
    """Let go of from hinges bent by (x, y) rad; positions alone."""
    data = mujoco.MjData(truth)
    data.qpos[:] = np.tile([x, y], 4)
    positions = np.empty((frames, 3, 3))
    sites = [truth.site(f"{name}_center").id for name in MARKERS]
    for frame in range(frames):
        mujoco.mj_forward(truth, data)
        positions[frame] = data.site_xpos[sites]
        mujoco.mj_step(truth, data, 8)
    nothing = np.zeros((frames, 0))
    return Trial(
        name=f"release_{x}_{y}", experiment="release", split=split, level=None, gravity=gravity_in_base(0.0),
        time=np.arange(frames) * FRAME, markers=MARKERS, positions=positions, quaternions=None,
        measured=np.ones((frames, 3), bool), tendons=(), commands=nothing, tendon_positions=nothing, start=0.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def experiments(model, truth):
    trials = [release(truth, 0.2, 0.1), release(truth, -0.15, 0.2), release(truth, 0.0, -0.2, "validate")]
    return [prepare(trial, model, 437) for trial in trials]


def test_the_shape_is_that_of_the_releases_ends(model, truth, experiments):
    rest = resting_shape(model, experiments, MARKERS)
    data = mujoco.MjData(model)
    data.qpos[:] = rest.pose
    mujoco.mj_kinematics(model, data)
    for place, name in enumerate(MARKERS):
        np.testing.assert_allclose(data.site(f"{name}_center").xpos, experiments[0].positions[-1, place], atol=5e-4)


def test_stiffness_and_damping_come_back_without_static_tilts(model, truth, experiments):
    bounds = {"stiffness": Bounds(0.3, 10.0), "damping": Bounds(0.005, 1.0)}
    rest = resting_shape(model, experiments, MARKERS)
    method = Method(
        LeastSquares(5, 1, 6, 1e-2), CoarseSearch(1.0, 200, 2), Refinement(8, 1e-6),
        LeastSquares(0, 1, 1, 1e-2), 0.1, np.inf, seed=3,
    )
    fit = Fit(MARKERS, bounds, (), "positions", WEIGHTS, method, rest)
    result = identify("test", model, experiments, fit)
    assert result.values["stiffness"] == pytest.approx(1.7, rel=0.05)
    assert result.values["damping"] == pytest.approx(0.15, rel=0.05)
    identified = result.models["identified"]
    data = mujoco.MjData(identified)
    data.qpos[:] = rest.pose
    mujoco.mj_forward(identified, data)
    np.testing.assert_allclose(data.qfrc_passive, data.qfrc_bias, atol=1e-9)


def test_releases_that_never_rest_are_refused(model, truth):
    moving = [prepare(release(truth, 0.2, 0.1, frames=90), model, 437)]
    with pytest.raises(InputError, match="rest_shape: found no release with split identify that is at rest"):
        resting_shape(model, moving, MARKERS)
