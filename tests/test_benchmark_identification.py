"""The rivals of the benchmark do what identification does, on a tiny arm."""

import mujoco
import numpy as np
import pytest

from benchmarks import identification as benchmark
from tests.matched_plant import release, segments_of, small_model
from trunkline.arm.parameters import candidate_fields, set_fields
from trunkline.identification.experiment import prepare
from trunkline.identification.identify import Coarse
from trunkline.identification.loss import LossWeights
from trunkline.identification.population import Population
from trunkline.identification.problem import Bounds

TRUTH = np.log([0.09, 0.5])
SIZE = benchmark.Size(budget=0.5, seeds=2, repeats=1, units=(3, 5))


@pytest.fixture(scope="module")
def case():
    model = small_model(units=4)
    bounds = {"damping": Bounds(0.01, 1.0), "tendon_friction": Bounds(0.05, 3.0)}
    truth = model.__copy__()
    set_fields(truth, candidate_fields(model, dict(zip(bounds, np.exp(TRUTH)[:, None], strict=True))))
    trials = [release(truth, 0.3, frames=20), release(truth, -0.25, frames=20), release(truth, 0.2, "validate", 20)]
    experiments = [prepare(trial, model, 20) for trial in trials]
    return benchmark.Case(
        model, experiments[:2], experiments[2:], segments_of(model), bounds, "positions",
        LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.01), Coarse(6, 4, 1e-3, 2.0, 20, 6),
    )  # fmt: skip


def test_bare_simulations_end_where_the_populations_do(case):
    fields = case.problem().fields(TRUTH + np.array([[0.0, 0.0], [0.3, -0.5], [-1.0, 1.0]]))
    batch, run = benchmark.bare_batch(case, fields, 3, 1.0)
    seen = batch.bind("site_xpos")
    simulated = Population(case.model, case.experiments, case.segments).simulate(fields)
    assert run() == simulated.steps
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
    sites = [case.model.site(f"{name}_center").id for name in case.segments]
    for trial, positions in enumerate(simulated.positions):
        np.testing.assert_array_equal(seen[3 * trial : 3 * trial + 3, sites], positions[:, -1])


def test_the_loop_as_first_written_has_the_same_loss(case):
    vectors = TRUTH + np.array([[0.0, 0.0], [0.5, -0.5]])
    loss = benchmark.as_first_written(case)
    np.testing.assert_allclose([loss(v) for v in vectors], case.problem().losses(vectors), rtol=1e-12)


def test_the_recipe_ends_at_its_target(case):
    target = float(case.problem().losses(TRUTH[None] + 0.3)[0])
    search = benchmark.by_recipe(case, target, 20.0)
    assert search.best <= target
    assert search.reached(target) is search.history[-1][1]
    assert case.problem().losses(search.vector[None])[0] == pytest.approx(search.best, rel=1e-12)


def test_a_rival_out_of_time_stops(case):
    search = benchmark.by_recipe(case, 0.0, 0.05)
    assert search.reached(0.0) is None
    assert search.evaluations < 50


def test_sysid_finds_the_truth_through_the_same_residuals(case):
    search = benchmark.by_sysid(case, 20.0)
    np.testing.assert_allclose(search.vector, TRUTH, atol=0.1)
    assert case.problem().losses(search.vector[None])[0] == pytest.approx(search.best, rel=1e-12)


def test_halving_compares_two_time_steps(case):
    fine, coarse = case.model.__copy__(), case.model.__copy__()
    coarse.opt.timestep = 4 * fine.opt.timestep
    moves = []
    for model in (fine, coarse):
        whole, half = benchmark.halving(model, case.unseen, case.segments, case)["validate"]
        moves.append(abs(half - whole))
    assert 0 < moves[0] < moves[1]


def test_every_part_prints_its_rivals(case, monkeypatch, capsys):
    monkeypatch.setattr(benchmark, "read_case", lambda stage, size: case)
    for part in benchmark.PARTS.values():
        part(SIZE)
    lines = capsys.readouterr().out
    for words in ("bare Batch.step", "first written", "sysid, as it comes", "units      3: "):
        assert words in lines


def test_without_the_demo_it_says_what_to_run(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["identification"])
    assert benchmark.main() == 1
    assert "make demo" in capsys.readouterr().err
