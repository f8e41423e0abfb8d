"""Batches that MuJoCo Warp moves: when they are, what they refuse, and how far off from MuJoCo's."""

import json
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from tests.identification.test_stage import settings, truth_of
from tests.model.simulation.test_capstan import rubbing_arm
from tests.model.simulation.test_motion import delayed
from tests.support.matched_plant import begin_project, curl, markers_of, release, small_model
from tests.support.noisy_trials import WEIGHTS
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.parameters.parameters import PARAMETERS, candidate_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.population import Population
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation import motion
from trunkline.model.simulation.divergence import CountingBatch
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.pipeline.identify import CAD_MODEL, run
from trunkline.recordings.trials.trial import write_trials

SECONDS = 0.5
BOUND = 5e-6  # m, of any site in that time, as docs/speed.md states it


@pytest.fixture
def warp(monkeypatch):
    """Selected by name, for batches of any size."""
    monkeypatch.setenv("TRUNKLINE_BATCHES", "warp")
    monkeypatch.delenv("TRUNKLINE_SCHEDULER", raising=False)
    monkeypatch.setattr(motion, "LEAST_BY_WARP", 1)


@pytest.fixture
def library(warp):
    pytest.importorskip("mujoco_warp", reason="no GPU's library, mujoco_warp")
    from trunkline.model.simulation import warp_batch

    return warp_batch


@pytest.fixture
def no_library(warp, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco_warp", None)


def varied(batch: Batch, model: mujoco.MjModel, kind: str) -> np.ndarray:
    """Simulations with damping, gravity and time steps of their own, let go from a bend or to be pulled, and their
    controls. Shape (n, T, nu)."""
    count, steps = batch.nsim, round(SECONDS / model.opt.timestep)
    batch.reset()
    batch.expand("dof_damping")[:] = model.dof_damping * np.linspace(1, 1.5, count)[:, None]
    batch.expand("opt.gravity")[:] = model.opt.gravity * np.linspace(1, 0.9, count)[:, None]
    batch.expand("opt.timestep")[:] = model.opt.timestep * np.linspace(1, 0.8, count)
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    controls = np.tile(straight + 0.005, (count, steps, 1))
    if kind == "pull":
        wound = np.minimum(np.arange(steps) * model.opt.timestep / 0.2, 1)
        controls[:, :, 0] = straight[0] - np.outer(np.linspace(0.01, 0.03, count), wound)
    else:
        angles, hinges = batch.bind("qpos"), ArmModel(model).hinge_count
        angles[:, :hinges] = np.tile([0.02, 0.04], hinges // 2)
        ArmModel(model).unload_branches(angles)
    hold(batch, model, controls[:, 0])
    return controls


def sites(batch: Batch, model: mujoco.MjModel, kind: str) -> np.ndarray:
    return move(batch, varied(batch, model, kind), ("site_xpos",))["site_xpos"]


def test_an_unknown_name_is_refused(monkeypatch):
    monkeypatch.setenv("TRUNKLINE_BATCHES", "wrap")
    with pytest.raises(InputError, match="found 'wrap', expected one of mujoco, warp, did you mean 'warp'"):
        batch_of(small_model(), 1)


def test_workers_and_a_gpu_are_not_used_together(warp, monkeypatch):
    monkeypatch.setenv("TRUNKLINE_SCHEDULER", "tcp://nowhere:1")
    with pytest.raises(InputError, match="found warp beside TRUNKLINE_SCHEDULER"):
        batch_of(small_model(), 1)


@pytest.mark.parametrize("name", ["", "mujoco"])
def test_mujoco_moves_what_nobody_gives_to_warp(no_library, monkeypatch, name):
    monkeypatch.setenv("TRUNKLINE_BATCHES", name)
    assert type(batch_of(small_model(), 2, rough=True)) is CountingBatch


def test_mujoco_moves_small_batches_and_those_that_have_to_be_exact(no_library, monkeypatch):
    assert type(batch_of(small_model(), 2)) is CountingBatch
    monkeypatch.setattr(motion, "LEAST_BY_WARP", 3)
    assert type(batch_of(small_model(), 2, rough=True)) is CountingBatch


def test_a_missing_library_is_told(no_library):
    with pytest.raises(InputError, match="no library mujoco_warp, expected it .pip install mujoco-warp"):
        batch_of(small_model(), 2, rough=True)


def touching():
    model = small_model()
    model.geom_contype[1:] = model.geom_conaffinity[1:] = 1
    return model


def cut_down():
    model = small_model()
    ArmModel(model).switch_off_cables()
    return model


@pytest.mark.parametrize(
    ("model_of", "message"),
    [
        (touching, "found a model of which parts may touch.*leave TRUNKLINE_BATCHES empty"),
        (delayed, "found a dead time without interpolation"),
        (cut_down, "found a cable cut down to a point"),
    ],
)
def test_what_warp_cannot_move_is_refused(warp, model_of, message):
    with pytest.raises(InputError, match=message):
        batch_of(model_of(), 2, rough=True)


def test_cables_that_rub_are_refused(library):
    model = rubbing_arm(4)
    batch = batch_of(model, 2, rough=True)
    with pytest.raises(InputError, match="found wrap_prm for each simulation on its own"):
        move(batch, np.tile(model.tendon_length0[:3], (2, 8, 1)), ("qpos",))


def test_what_warp_does_not_compute_is_not_recorded(library):
    model = small_model()
    with pytest.raises(InputError, match="found userdata_of_nobody to be recorded"):
        batch_of(model, 2, rough=True).rollout(1, record=("userdata_of_nobody",))


def late():
    spec = small_spec()
    for actuator in spec.actuators:
        actuator.delay, actuator.nsample, actuator.interp = 0.02, 24, 1
    return spec.compile()


def with_elements():
    return small_model(joints=Joints([MaxwellElement(0.3, 0.5)], [JenkinsElement(0.2, 0.02)], True))


@pytest.mark.parametrize("model_of", [small_model, with_elements, late])
@pytest.mark.parametrize("kind", ["release", "pull"])
def test_its_sites_are_where_mujoco_has_them(library, kind, model_of):
    model = model_of()
    batch = batch_of(model, 4, rough=True)
    assert type(batch) is library.WarpBatch
    ours, theirs = (sites(batched, model, kind) for batched in (batch_of(model, 4), batch))
    assert np.linalg.norm(ours - ours[:, :1], axis=-1).max() > 1000 * BOUND
    assert np.linalg.norm(ours[1:] - ours[:-1], axis=-1).max() > 100 * BOUND  # each simulation has its own
    assert np.linalg.norm(theirs - ours, axis=-1).max() < BOUND


def test_on_a_gpu_a_thousand_are_where_mujoco_has_them(library):
    if not library.libraries()[0].is_cuda_available():
        pytest.skip("no GPU")
    model = small_model()
    ours, theirs = (sites(batch, model, "pull") for batch in (batch_of(model, 1024), batch_of(model, 1024, rough=True)))
    assert np.linalg.norm(theirs - ours, axis=-1).max() < BOUND


def test_only_those_named_move_and_outputs_follow(library):
    model = small_model()
    batch = batch_of(model, 3, rough=True)
    places, last = batch.bind("qpos"), batch.bind("site_xpos")
    controls, before = varied(batch, model, "pull"), places.copy()
    ids = np.array([0, 2], dtype=np.int32)
    recorded = move(batch, controls[ids, :8], ("site_xpos", "qpos"), ids=ids)
    np.testing.assert_array_equal(places[1], before[1])
    np.testing.assert_array_equal(places[ids], recorded["qpos"][:, -1])
    np.testing.assert_array_equal(last[ids], recorded["site_xpos"][:, -1])


@pytest.mark.parametrize(("field", "value"), [("opt.gravity", 1e30), ("opt.gravity", 1e12), ("dof_damping", -5)])
def test_one_that_diverges_is_warned_of_and_stays(library, field, value):
    model = small_model()
    batch = batch_of(model, 2, rough=True)
    controls, places = varied(batch, model, "release"), batch.bind("qpos")
    batch.expand(field)[1] = value
    before = places.copy()
    recorded = batch.rollout(len(controls[0]), control=controls, record=("qpos",))["qpos"]
    assert batch.warning.any(axis=(1, 2)).tolist() == [False, True]
    np.testing.assert_array_equal(places[0], recorded[0, -1])
    np.testing.assert_array_equal(places[1], before[1])
    batch.reset()
    assert not batch.warning.any()


def test_friction_that_some_simulations_have_alone_acts(library):
    """What Warp asks of a model once, whether anything is not 0, is asked of all simulations."""
    model = small_model(joints=Joints([MaxwellElement(0.3, 0.5)]))
    recorded = []
    for batch in (batch_of(model, 2), batch_of(model, 2, rough=True)):
        controls = varied(batch, model, "release")
        for name in ("tendon_stiffness", "tendon_frictionloss"):
            batch.expand(name)[0] = 0
        recorded.append(move(batch, controls, ("site_xpos",))["site_xpos"])
    assert np.linalg.norm(recorded[0][1] - recorded[0][0], axis=-1).max() > 100 * BOUND
    assert np.linalg.norm(recorded[1] - recorded[0], axis=-1).max() < BOUND


@pytest.fixture(scope="module")
def trials():
    model = small_model(4)
    tilted = release(model, -0.25, frames=20, tilt_deg=20)
    recordings = [release(model, 0.3, frames=30), tilted, curl(model, 15, frames=60)]
    return model, [prepare(trial, model, len(trial.time)) for trial in recordings]


@pytest.mark.parametrize("load", [0.0, 0.05])
@pytest.mark.parametrize("friction", [0.3, 0.0])
def test_a_population_is_where_mujoco_has_it(library, trials, load, friction):
    """With what follows from inertia and from where joints are, as it is set anew, and with cables that are left out
    where they are slack and rub on nothing."""
    model, experiments = trials
    model = model.__copy__()
    model.tendon_frictionloss[ArmModel(model).cables] = friction
    experiments = [replace(experiment, load=load * (i > 0)) for i, experiment in enumerate(experiments)]
    spans = {"damping": (0.02, 0.05), "joint_place": (0, 0.2), "mass": (0.9, 1.4)}
    fields = candidate_fields(model, {name: np.linspace(*span, 3) for name, span in spans.items()})
    ours, theirs = (Population(model, experiments, markers_of(model)).simulate(fields, rough=r) for r in (False, True))
    for their, our in zip(theirs.positions, ours.positions, strict=True):
        assert not np.array_equal(their, our)
        assert np.abs(their - our).max() < BOUND


def test_derivatives_stay_with_mujoco(no_library, trials):
    """Candidates to be ranked ask for the library, which is missing; differences do not."""
    model, experiments = trials
    free = {"damping": Bounds(0.005, 1.0)}
    problem = Problem(model, experiments, markers_of(model), free, "positions", WEIGHTS)
    assert np.concatenate(linearise(problem, problem.start()).jacobians).any()
    assert np.isfinite(problem.losses(problem.start()[None])).all()
    with pytest.raises(InputError, match="no library mujoco_warp"):
        problem.losses(problem.start()[None], rough=True)


def test_a_stage_whose_starts_warp_ranks_finds_what_it_finds_by_mujoco(library, tmp_path, monkeypatch):
    """End to end: the search's population goes by Warp, its descents and all that is written by MuJoCo."""
    monkeypatch.chdir(tmp_path)
    model = begin_project(tmp_path, 4)
    truth, middle = truth_of(model, damping=1.4), PARAMETERS["damping"].read(model)
    write_trials(tmp_path / "data/processed/filter",
                 [release(truth, 0.3, frames=40), release(truth, -0.25, frames=40),
                  release(truth, 0.2, "validate", frames=40)])  # fmt: skip
    config = settings(["release"], ["release"], {"damping": (0.3 * middle, 3 * middle)})
    damping, moved, begin = {}, [], library.WarpBatch.__init__
    monkeypatch.setattr(library.WarpBatch, "__init__",
                        lambda self, *arguments: (moved.append(arguments), begin(self, *arguments))[1])  # fmt: skip
    for name in ("warp", "mujoco"):
        monkeypatch.setenv("TRUNKLINE_BATCHES", name)
        moved.clear()
        run("identify_damping", config, CAD_MODEL)
        assert bool(moved) == (name == "warp")
        table = json.loads((tmp_path / "artifacts/identify_damping/parameters.json").read_text())
        damping[name] = table["parameters"]["damping"]["value"]
    assert damping["warp"] == pytest.approx(damping["mujoco"], rel=1e-4)
    assert damping["warp"] == pytest.approx(1.4 * middle, rel=0.02)
