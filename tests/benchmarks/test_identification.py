"""The rivals of the benchmark do what identification does, on a tiny arm."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from benchmarks.identification import __main__ as benchmark
from benchmarks.identification.case import Case, Size, identified
from benchmarks.identification.physics import (
    BACKLASH,
    DEAD_TIME,
    HOLES,
    NONE,
    OF_CABLES,
    OF_JOINTS,
    RATE_LIMIT,
    model_with,
)
from benchmarks.identification.rate import bare_batch
from benchmarks.identification.recipe import as_first_written, by_recipe
from benchmarks.identification.sysid import by_sysid, stalled
from tests.support.matched_plant import curl, release, segments_of, small_model
from trunkline.identification.fit.fit import Fit, Method, Polish, Rough
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import candidate_fields, set_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.loss import LossWeights
from trunkline.identification.simulate.population import Population
from trunkline.model.elements import BRANCH, SLIDER, all_elements, capstan_friction, hole_tendons, numeric

TRUTH = np.log([0.09, 0.5])
SIZE = Size(budget=0.5, seeds=2, repeats=1, units=(3, 5))


@pytest.fixture(scope="module")
def case():
    model = small_model(units=4)
    bounds = {"damping": Bounds(0.01, 1.0), "tendon_friction": Bounds(0.05, 3.0)}
    truth = model.__copy__()
    set_fields(truth, candidate_fields(model, dict(zip(bounds, np.exp(TRUTH)[:, None], strict=True))))
    trials = [release(truth, 0.3, frames=20), release(truth, -0.25, frames=20), release(truth, 0.2, "validate", 20)]
    experiments = [prepare(trial, model, 20) for trial in trials]
    weights = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.03)
    method = Method(
        LeastSquares(4, 1, 4, 1e-3), Rough(2.0, 20, 2), Polish(8, 1e-9), LeastSquares(0, 1, 1, 1.0), 0.1, np.inf, seed=1
    )
    fit = Fit(segments_of(model), bounds, (), "positions", weights, method)
    return Case(model, experiments[:2], experiments[2:], fit)


def test_bare_simulations_end_where_the_populations_do(case):
    fields = case.problem().fields(TRUTH + np.array([[0.0, 0.0], [0.3, -0.5], [-1.0, 1.0]]))
    batch, run = bare_batch(case, fields, 3, 1.0)
    seen = batch.bind("site_xpos")
    simulated = Population(case.model, case.experiments, case.fit.segments).simulate(fields)
    assert run() == simulated.steps
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
    sites = [case.model.site(f"{name}_center").id for name in case.fit.segments]
    for trial, positions in enumerate(simulated.positions):
        np.testing.assert_array_equal(seen[3 * trial : 3 * trial + 3, sites], positions[:, -1])


def test_the_loop_as_first_written_has_the_same_loss(case):
    vectors = TRUTH + np.array([[0.0, 0.0], [0.5, -0.5]])
    loss = as_first_written(case)
    np.testing.assert_allclose([loss(v) for v in vectors], case.problem().losses(vectors), rtol=1e-12)


def test_the_recipe_ends_at_its_target(case):
    target = float(case.problem().losses(TRUTH[None] + 0.3)[0])
    rival = by_recipe(case, target, 20.0)
    assert rival.best <= target
    assert rival.reached(target) is rival.history[-1][1]
    assert case.problem().losses(rival.vector[None])[0] == pytest.approx(rival.best, rel=1e-12)


def test_a_rival_out_of_time_stops(case):
    rival = by_recipe(case, 0.0, 0.05)
    assert rival.reached(0.0) is None
    assert rival.evaluations < 50


def test_sysid_finds_the_truth_through_the_same_residuals(case):
    rival = by_sysid(case, 20.0)
    np.testing.assert_allclose(rival.vector, TRUTH, atol=0.1)
    assert case.problem().losses(rival.vector[None])[0] == pytest.approx(rival.best, rel=1e-12)


def test_what_a_search_left_where_it_was_is_named(case):
    start, own = case.problem().start(), identified(case)
    np.testing.assert_allclose(own.vector, TRUTH, atol=0.1)
    assert stalled(case, own.vector, own) == []
    half_way = np.array([own.vector[0], start[1]])
    (line,) = stalled(case, half_way, own)
    assert line.startswith("stalls: tendon_friction left at 0.3 N, residuals do depend on it there; identify: 0.5")


def test_every_part_prints_its_rivals(case, capsys):
    curled = replace(case, experiments=[*case.experiments, prepare(curl(case.model, 30, frames=20), case.model, 20)])
    for part in benchmark.PARTS.values():
        part(lambda stage, size: curled if stage == "identify_control" else case, SIZE)
    lines = capsys.readouterr().out
    for words in ("bare Batch.step", "first written", "sysid, as it comes", "units      3: "):
        assert words in lines
    rows = [line.split()[-4] for line in lines.splitlines() if line.strip().startswith(tuple(OF_JOINTS | OF_CABLES))]
    assert rows == ["release"] * len(OF_JOINTS) + ["curl"] * len(OF_CABLES)


def test_the_row_of_all_terms_has_all_of_them():
    model = model_with(OF_CABLES["all, those of joints too"])
    assert (len(all_elements(model, BRANCH)), len(all_elements(model, SLIDER))) == (2, 3)
    assert capstan_friction(model) == HOLES.friction
    assert hole_tendons(model).shape == (3, HOLES.stretches)
    assert (model.actuator_delay == DEAD_TIME).all()
    assert (numeric(model, "rate_limit"), numeric(model, "backlash")) == (RATE_LIMIT, BACKLASH)
    plain = model_with(OF_CABLES[NONE])
    assert (plain.ntendon, plain.nhistory, plain.nnumeric) == (3, 0, 0)


def test_without_the_demo_it_says_what_to_run(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dvc.yaml").touch()  # the top of a checkout
    monkeypatch.setattr("sys.argv", ["identification", "--quick"])  # nothing of it is kept
    assert benchmark.main() == 1
    assert "make demo" in capsys.readouterr().err
