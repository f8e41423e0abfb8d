"""Losses of a population against a Python loop of mj_step, candidate by candidate and trial by trial."""

import mujoco
import numpy as np

from tests.support.matched_plant import markers_of, release, small_model
from tests.support.noisy_trials import WEIGHTS, with_values
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.parameters.parameters import set_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.loss import LOSSES, loss_of

TRUTH = np.log([0.09, 0.5])


def plain_loss(problem, model, experiments, vector):
    """The loss of one candidate (P,), the way one would write it first."""
    sites = [model.site(f"{name}_center").id for name in markers_of(model)]
    model, step, losses = model.__copy__(), model.opt.timestep, []
    set_fields(model, problem.fields(vector[None]))
    for experiment in experiments:
        substeps = round(experiment.frame_step / step)
        model.opt.gravity[:] = experiment.gravity
        data = mujoco.MjData(model)
        data.qpos[: len(experiment.start)], data.act[:] = experiment.start, experiment.controls[0]
        simulated = np.empty(experiment.positions.shape)
        for frame in range(experiment.frames):
            model.opt.timestep = (experiment.frame_step if frame else experiment.lead) / substeps
            data.ctrl[:] = experiment.controls[frame]
            mujoco.mj_step(model, data, nstep=substeps)
            mujoco.mj_kinematics(model, data)
            simulated[frame] = data.site_xpos[sites]
        residuals = LOSSES["positions"](simulated[None], experiment.positions, experiment.measured, WEIGHTS)
        losses.append(float(loss_of(residuals)[0]))
    return float(np.mean(losses))


def test_a_plain_loop_has_the_same_losses():
    model = small_model(units=4)
    bounds = {"damping": Bounds(0.01, 1.0), "tendon_friction": Bounds(0.05, 3.0)}
    truth = with_values(model, dict(zip(bounds, np.exp(TRUTH), strict=True)))
    experiments = [prepare(release(truth, bend, frames=20), model, 20) for bend in (0.3, -0.25)]
    problem = Problem(model, experiments, markers_of(model), bounds, "positions", WEIGHTS)
    vectors = TRUTH + np.array([[0.0, 0.0], [0.5, -0.5]])
    expected = [plain_loss(problem, model, experiments, vector) for vector in vectors]
    np.testing.assert_allclose(problem.losses(vectors), expected, rtol=1e-12)
