"""Known parameters come back, from a plant that is the model."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.support.matched_plant import curl, markers_of, motion, release, small_model, tilt, with_load
from tests.support.noisy_trials import WEIGHTS, with_values
from trunkline.identification.fit import identify as identifying
from trunkline.identification.fit.fit import CoarseSearch, Fit, Method, Refinement
from trunkline.identification.fit.identify import identify
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import DIVERGED_LOSS, Bounds, Problem
from trunkline.identification.fit.search import search
from trunkline.identification.parameters.parameters import PARAMETERS, candidate_fields, parameter_named, set_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement


def identified(trials, model, parameters, per_joint=(), optimizer=LeastSquares(5, 2, 6, 1e-3), rough=99):  # noqa: B008
    experiments = [prepare(trial, model, 437) for trial in trials]
    bounds = {name: span if isinstance(span, Bounds) else Bounds(*span) for name, span in parameters.items()}
    fine = LeastSquares(0, 1, 30, 1e-9)
    method = Method(optimizer, CoarseSearch(1.0, 437, rough), Refinement(8, 1e-9), fine, 0.1, np.inf, seed=3)
    fit = Fit(markers_of(model), bounds, per_joint, "positions", WEIGHTS, method)
    return identify("test", model, experiments, fit)


def test_stiffness_and_hardening_come_back():
    model = small_model()
    true = {"stiffness": 0.6 * PARAMETERS["stiffness"].read(model), "hardening": 1.5}
    truth = with_values(model, true)
    trials = [tilt(truth, 30), tilt(truth, 60), tilt(truth, 90), tilt(truth, 45, "validate")]
    result = identified(trials, model, {"stiffness": (0.2, 20.0), "hardening": (0.02, 20.0)})
    assert result.values["stiffness"] == pytest.approx(true["stiffness"], rel=0.02)
    assert result.values["hardening"] == pytest.approx(true["hardening"], rel=0.05)
    assert not result.at_bound


def test_per_joint_factors_come_back():
    model = small_model()
    factors = np.array([0.93, 1.06, 1.0, 0.96, 1.05, 0.98])
    truth = model.__copy__()
    set_fields(truth, candidate_fields(model, {}, {"stiffness": factors[None]}))
    trials = [tilt(truth, angle) for angle in (30, 60, 90)]
    span = PARAMETERS["stiffness"].read(model)
    result = identified(trials, model, {"stiffness": (0.99 * span, 1.01 * span)}, ("stiffness",))
    stiffness = result.models["identified"].jnt_stiffness / model.jnt_stiffness
    np.testing.assert_allclose(stiffness[::2][:3], factors[:3], atol=0.02)  # beyond, gravity bends too little


def test_a_maxwell_branch_comes_back():
    """From an arm that was held for long before it was let go: its branches had given way."""
    model = small_model(joints=Joints([MaxwellElement(0.3, 0.5)]))
    true = {"damping": 1.5 * PARAMETERS["damping"].read(model), "relaxation": 0.6, "relaxation_time": 0.2}
    truth = with_values(model, true)
    trials = [release(truth, bend, frames=100) for bend in (0.3, -0.25, 0.15)]
    ranges = {"damping": (0.005, 1.0), "relaxation": (0.05, 3.0), "relaxation_time": (0.02, 3.0)}
    result = identified(trials, model, ranges)
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, rel=0.05), name
    assert not result.at_bound


def test_a_slider_comes_back():
    model = small_model(joints=Joints(sliders=[JenkinsElement(0.2, 0.05)]))
    true = {"hysteresis": 0.5, "yield_bend": 0.03}
    truth = with_values(model, true)
    trials = [release(truth, bend, frames=100) for bend in (0.3, -0.25, 0.15)]
    result = identified(trials, model, {"hysteresis": (0.05, 3.0), "yield_bend": (0.005, 0.2)})
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, rel=0.05), name


def test_damping_and_tendon_friction_and_its_creep_come_back():
    model = small_model()
    true = {"damping": 2.5 * PARAMETERS["damping"].read(model), "tendon_friction": 0.6, "friction_time": 0.03}
    truth = with_values(model, true)
    trials = [release(truth, 0.3, frames=100), release(truth, -0.25, frames=100)]
    ranges = {"damping": (0.005, 1.0), "tendon_friction": (0.02, 3.0), "friction_time": (0.003, 0.3)}
    result = identified(trials, model, ranges)
    for name, tolerance in (("damping", 0.05), ("tendon_friction", 0.2), ("friction_time", 0.2)):
        assert result.values[name] == pytest.approx(true[name], rel=tolerance), name


def test_the_winches_rate_limit_and_backlash_come_back():
    """From curls faster than the limit, and from motions that turn round."""
    model = small_model(4, rate_limit=0.5, backlash=1e-3)
    true = {"rate_limit": 0.12, "backlash": 4e-3}
    truth = with_values(model, true)
    trials = [curl(truth, 50, frames=110), motion(truth, 30, frames=120), motion(truth, 30, frames=120, seed=1)]
    result = identified(trials, model, {"rate_limit": (0.02, 2.0), "backlash": (2e-4, 0.02)})
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, rel=0.02), name


def weighing(model, mass, load=0.0, **values):
    """A plant whose units weigh `mass` times the model's, and that was compiled with `load` kg at its tip."""
    plant = with_load(with_values(model, values), load) if load else with_values(model, values)
    units = [body for body in range(plant.nbody) if plant.body(body).name.startswith("unit_")]
    plant.body_mass[units] *= mass
    plant.body_inertia[units] *= mass
    mujoco.mj_setConst(plant, mujoco.MjData(plant))
    return plant


def with_loads(make, model, mass, arguments, loads=(0.0, 0.08), **values):
    """Trials that `make` makes of each plant, a row of `arguments` at a time."""
    return [
        replace(make(weighing(model, mass, load, **values), *row), load=load, name=f"{row}, {load} kg")
        for load in loads
        for row in arguments
    ]


def test_the_arm_s_mass_comes_back_from_shapes_with_a_load_and_without():
    model = small_model()
    true = {"stiffness": 1.4 * PARAMETERS["stiffness"].read(model), "mass": 1.7 * PARAMETERS["mass"].read(model)}
    trials = with_loads(tilt, model, 1.7, [(30,), (60,), (90,)], stiffness=true["stiffness"])
    result = identified(trials, model, {"stiffness": (0.2, 50.0), "mass": (0.05, 20.0)})
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, rel=0.02), name
    assert not result.at_bound


def test_the_arm_s_mass_comes_back_from_releases_and_the_coarse_search_has_one_with_a_load(monkeypatch):
    model, searched = small_model(), []

    def watched(problem, *rest):
        searched.append(problem)
        return search(problem, *rest)

    monkeypatch.setattr(identifying, "search", watched)
    plain, factor = with_values(model, {"tendon_friction": 1e-9}), 0.6
    true = {name: factor * PARAMETERS[name].read(model) * scale for name, scale in
            (("stiffness", 1.3), ("damping", 0.8), ("mass", 1.0))}  # fmt: skip
    forces = {"stiffness": true["stiffness"], "damping": true["damping"]}
    trials = [
        *with_loads(release, plain, factor, [(0.3,), (-0.1,)], (0.0,), **forces),
        *with_loads(release, plain, factor, [(0.2,)], (0.08,), **forces),
    ]
    ranges = {"stiffness": (0.2, 50.0), "damping": (0.002, 2.0), "mass": (0.02, 20.0)}
    result = identified(trials, plain, ranges, rough=2)
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, rel=0.03), name
    assert not result.at_bound
    assert [experiment.load for experiment in searched[0].experiments] == [0.0, 0.0, 0.08]


def test_validate_trials_are_never_fitted():
    model = small_model()
    stiffness = PARAMETERS["stiffness"].read(model)
    truth, other = (with_values(model, {"stiffness": f * stiffness}) for f in (0.7, 1.6))
    trials = [tilt(truth, 60), tilt(truth, 90), tilt(other, 60, "validate"), tilt(other, 90, "validate")]
    result = identified(trials, model, {"stiffness": (0.2, 20.0)})
    assert result.values["stiffness"] == pytest.approx(PARAMETERS["stiffness"].read(truth), rel=0.02)


def test_a_parameter_on_its_bound_is_named():
    model = small_model()
    trials = [tilt(model, 60), tilt(model, 90)]
    true = PARAMETERS["stiffness"].read(model)
    result = identified(trials, model, {"stiffness": (1.5 * true, 3 * true)})
    assert result.at_bound == ["stiffness"]


def test_control_parameters_move_the_loss_the_right_way():
    model = small_model()
    trials = [curl(model, 60, frames=110)]
    experiments = [prepare(trial, model, 437) for trial in trials]
    spans = {name: Bounds(1e-4, 1e6) for name in ("kp", "kv", "force_range", "time_constant")}
    problem = Problem(model, experiments, markers_of(model), spans, "positions", WEIGHTS)
    truth = np.log([parameter_named(name).read(model) for name in spans])
    candidates = truth + np.concatenate([np.zeros((1, 4)), np.diag(np.log([0.5, 3, 0.01, 2]))])
    losses = problem.losses(candidates)
    assert (losses[1:] > 10 * losses[0]).all()


def test_divergence_is_a_finite_penalty_and_counted():
    model = small_model()
    experiments = [prepare(release(model, 0.25, frames=30), model, 30)]
    problem = Problem(model, experiments, markers_of(model), {"stiffness": Bounds(1, 1e7)}, "positions", WEIGHTS)
    losses = problem.losses(np.log([[PARAMETERS["stiffness"].read(model)], [1e6]]))
    assert losses[0] < 1e-3
    assert losses[1] == pytest.approx(DIVERGED_LOSS)
    assert problem.diverged == 1
    assert problem.evaluations == 2
