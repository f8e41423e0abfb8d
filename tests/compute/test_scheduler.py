"""Work spread over a real cluster of two processes: the same bits, whoever dies on the way; mistakes are one line."""

import gc
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from rehearsal import runs
from rehearsal.experiments.result import Result
from tests.identification.test_stage import settings, truth_of
from tests.support.bent_chain import hardening_stump
from tests.support.matched_plant import FRAME, begin_project, curl, markers_of, release, small_model, tilt
from tests.support.small_arm import small_spec
from trunkline.compute import cluster as workers
from trunkline.compute import scheduler
from trunkline.compute.cluster import VARIABLE
from trunkline.compute.scheduler import arriving, pieces, spread
from trunkline.errors import InputError
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.loss import LossWeights
from trunkline.identification.simulate.population import Population
from trunkline.kinematics.dataset import sampling
from trunkline.kinematics.dataset.deviation import mujoco_deviation
from trunkline.kinematics.dataset.table import sample_table
from trunkline.kinematics.panda import labels
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.statics.chain import read_chain
from trunkline.pipeline.identify import CAD_MODEL, run
from trunkline.pipeline.stage import output_folder
from trunkline.recordings.trials.trial import write_trials

WEIGHTS = LossWeights(
    delta_position=0.2, delta_velocity=2.0, epsilon=0.02, epsilon_velocity=0.002, weight_position=1.0,
    weight_velocity=0.03,
)  # fmt: skip
DOWN = np.array([0.5, 0.0, -np.sqrt(0.75)])


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs="CRITICAL"
    ) as cluster:
        yield cluster
        scheduler._connected.cache_clear()


@pytest.fixture
def spreading(cluster, monkeypatch):
    """Call it, and from then on work goes to the cluster."""
    return lambda: monkeypatch.setenv(VARIABLE, cluster.scheduler_address)


def same(first, second) -> bool:
    pairs = zip(first, second, strict=True)
    return len(first) == len(second) and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def rubbing_model():
    """Cables rub, winches wind at a limited rate and with backlash: all that goes on between two steps."""
    spec = small_spec(4, rate_limit=0.3, backlash=1e-3)
    spec.option.timestep = FRAME / 8
    add_holes(spec, GuideHoles(0.1, 2))
    return spec.compile()


@pytest.fixture(scope="module")
def trials():
    """Experiments of one model: at rest, let go, drawn in, of several lengths; a load hangs from one."""
    model, at_rest = rubbing_model(), small_model(4)
    recorded = [
        tilt(at_rest, 60), tilt(at_rest, 30), release(model, 0.25, frames=30), release(model, -0.2, frames=20),
        curl(model, 40, frames=30), curl(model, 25, tendon=1, frames=16), curl(model, 30, tendon=2, frames=20),
    ]  # fmt: skip
    experiments = [prepare(trial, model, 437) for trial in recorded]
    experiments[4] = replace(experiments[4], load=0.02, lead=0.6 / 120)
    return model, experiments


def as_problem(model, experiments) -> Problem:
    bounds = {"damping": Bounds(1e-3, 1.0), "stiffness": Bounds(0.1, 1e3), "rate_limit": Bounds(0.02, 2.0)}
    return Problem(model, experiments, markers_of(model), bounds, "positions", WEIGHTS)


@pytest.mark.parametrize("count", [1, 3, 11])
def test_candidates_times_trials_are_the_same_bits(trials, spreading, count):
    """Cut into trials, into both, into candidates."""
    here, there = as_problem(*trials), as_problem(*trials)
    vectors = here.start() + np.linspace(-0.2, 0.2, count)[:, None]
    near = vectors[0] + 0.01
    alone, beside = here.residuals(vectors), here.residuals(vectors, near)
    spreading()
    assert same(there.residuals(vectors), alone)
    assert same(there.residuals(vectors, near), beside)
    assert (there.steps, there.evaluations, there.diverged) == (here.steps, here.evaluations, here.diverged)
    assert same(there._last[1], here._last[1])


def test_pieces_are_really_cut_and_done_elsewhere(trials, spreading):
    model, experiments = trials
    population = Population(model, experiments, markers_of(model))

    def cut(count):
        return population._cut({"dof_damping": np.arange(count)}, None)

    (whole,) = cut(5)
    assert whole.fields["dof_damping"].tolist() == [0, 1, 2, 3, 4]
    assert sorted(whole.trials) == list(range(7)), "here, one piece"
    spreading()
    assert [pieces(most) for most in (0, 1, 3, 99)] == [1, 1, 3, 8]
    assert sorted(piece.trials for piece in cut(1)) == [[0, 1], [2], [3], [4], [5], [6]], "each by itself, but at rest"
    assert [len(piece.fields["dof_damping"]) for piece in cut(11)] == [1, 1, 2, 1, 1, 2, 1, 2]
    pids = spread(_pid, list(range(8)))
    assert os.getpid() not in pids
    assert len(set(pids)) == 2


def _pid(_, piece):
    time.sleep(0.05)
    return os.getpid()


def test_a_candidate_that_diverges_does_so_there_too(spreading):
    model = small_model()
    experiments = [prepare(release(model, 0.25, frames=30), model, 30)]
    fields = candidate_fields(model, {"stiffness": model.jnt_stiffness[:1] * [1.0, 1e5, 1.1]})
    here = Population(model, experiments, markers_of(model)).simulate(fields)
    spreading()
    there = Population(model, experiments, markers_of(model)).simulate(fields)
    assert there.diverged.tolist() == here.diverged.tolist() == [False, True, False]
    assert same(there.positions, here.positions)


def _run_or_die(shared, piece):
    population, flag = shared
    try:
        flag.touch(exist_ok=False)
    except FileExistsError:
        return Population.run(population, piece)
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_worker_killed_on_the_way_changes_no_bit(trials, spreading, tmp_path, monkeypatch):
    model, experiments = trials
    fields = candidate_fields(model, {"damping": np.linspace(0.01, 0.05, 5)})
    here = Population(model, experiments, markers_of(model)).simulate(fields)
    spreading()
    flag = tmp_path / "killed"
    population = Population(model, experiments, markers_of(model))
    monkeypatch.setattr(
        "trunkline.identification.simulate.population.spread",
        lambda work, pieces, shared: spread(_run_or_die, pieces, (shared, flag)),
    )
    there = population.simulate(fields)
    assert flag.exists(), "one was killed"
    assert same(there.positions, here.positions)


def test_samples_of_forward_kinematics_are_the_same_bits(spreading, monkeypatch):
    model = hardening_stump()
    chain = read_chain(model)

    def made():
        rng = np.random.default_rng(3)
        table, _ = sample_table(chain, DOWN, 60, 12, 10, rng)
        return table, mujoco_deviation(model, chain, table, 9, rng)

    here = made()
    spreading()
    monkeypatch.setattr(sampling, "LEAST", 20)
    for result, expected in zip(made(), here, strict=True):
        assert result.equals(expected)


def test_labels_of_the_rigid_map_are_the_same(spreading, monkeypatch):
    points = labels.draw_points(np.array([-0.9, -0.9, -0.3]), np.array([0.9, 0.9, 0.9]), 120, 5)
    how = {"seed": 2, "starts": 6, "starts_in_doubt": 6, "mount_offset": 0.1, "avoid_collisions": True}
    here = labels.label(points, **how)
    assert 0.1 < here.mean() < 0.9
    spreading()
    monkeypatch.setattr(labels, "LEAST", 10)
    assert np.array_equal(labels.label(points, **how), here)


def test_rehearsals_arrive_from_workers_too(monkeypatch, tmp_path):
    """In this process, so that the bench can be another one."""
    monkeypatch.setenv("TRUNKLINE_THREADS", "1")
    source, package = runs.RunSource("package", "code"), tmp_path / "package.tgz"
    package.write_bytes(b"a package")
    monkeypatch.setattr(runs, "bench_of", lambda file: file.read_bytes().decode())
    monkeypatch.setattr(runs, "source_of", lambda file: source)
    touched = lambda bench, run: (Result(run.experiment, run.seed, True, bench), 1.0)  # noqa: E731
    monkeypatch.setattr(runs, "make_one", touched)
    wanted = runs.wanted({"touch": 5}, 0)
    with LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster:
        monkeypatch.setenv(VARIABLE, cluster.scheduler_address)
        made = runs.make(wanted, package, source, tmp_path / "runs.csv", workers=1)
        assert sorted(rehearsed.seed for rehearsed in made) == [0, 1, 2, 3, 4]
        assert {rehearsed.cause for rehearsed in made} == {"a package"}
        other = replace(source, code="other")
        answers = iter([source, *[other] * 9])
        monkeypatch.setattr(runs, "source_of", lambda file: next(answers))
        workers._unpacked.cache_clear()  # another worker
        with pytest.raises(InputError, match="found code and settings other, expected code as here"):
            runs.make([runs.Run("touch", 9)], package, source, tmp_path / "runs.csv", workers=1)
        assert len(runs.read_results(tmp_path / "runs.csv")) == 5
        scheduler._connected(cluster.scheduler_address)._client.close()
        scheduler._connected.cache_clear()


@pytest.mark.parametrize("enabled", [True, False])
def test_no_old_client_is_collected_while_one_begins_or_ends(monkeypatch, enabled):
    """It would wait for a lock that the new one holds."""
    collecting = []

    class Client:
        def __init__(self, *_, **__):
            collecting.append(gc.isenabled())

        def wait_for_workers(self, *_, **__):
            raise TimeoutError

        def close(self, timeout):
            collecting.append(gc.isenabled())

    monkeypatch.setattr("distributed.Client", Client)
    (gc.enable if enabled else gc.disable)()
    try:
        with pytest.raises(InputError, match="no workers"):
            workers.Cluster("tcp://127.0.0.1:9")
        assert collecting == [False, False]
        assert gc.isenabled() == enabled
    finally:
        gc.enable()


def test_a_mistake_in_the_work_comes_back_as_it_is(spreading):
    spreading()
    with pytest.raises(InputError, match="trial 3: found nothing"):
        spread(_mistaken, [1, 3])
    assert spread(_mistaken, [1, 2]) == [1, 2], "and the workers go on"


def _mistaken(_, piece):
    if piece == 3:
        raise InputError("trial 3: found nothing, expected something")
    return piece


@pytest.mark.parametrize("joined_late", [False, True])
def test_a_worker_with_another_library_is_refused_in_one_line(spreading, monkeypatch, joined_late):
    spreading()
    real = workers.environment("tests")
    monkeypatch.setattr(workers, "environment", lambda package: real | {"mujoco": "9.9.9"})
    here = scheduler._cluster()
    monkeypatch.setattr(here, "_checked", set())
    if joined_late:
        monkeypatch.setattr(here, "_check", lambda package: None)
    else:
        monkeypatch.setattr(workers, "_do", None)  # no work is sent
    message = rf"^{VARIABLE}: worker tcp://\S+: found mujoco {real['mujoco']}, expected 9\.9\.9 as here$"
    with pytest.raises(InputError, match=message):
        spread(_mistaken, [1, 2])


def _missing():
    """Where a worker lacks the code."""
    raise ModuleNotFoundError("No module named 'trunkline'")


def test_a_worker_without_the_library_is_refused_in_one_line(spreading, monkeypatch):
    spreading()
    here = scheduler._cluster()
    monkeypatch.setattr(here, "_checked", set())
    monkeypatch.setattr(workers, "difference", lambda package, expected: _missing())
    with pytest.raises(InputError, match=r"found no trunkline like this one \(.*No module named"):
        spread(_mistaken, [1, 2])


def test_code_is_part_of_the_environment(tmp_path, monkeypatch):
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "__init__.py").write_text("x = 1")
    monkeypatch.syspath_prepend(tmp_path)
    before = workers.environment("room")
    assert {"Python", "trunkline", "mujoco", "mink", "code of trunkline", "code of room"} <= set(before)
    (tmp_path / "room" / "more.py").write_text("y = 2")
    workers.environment.cache_clear()
    after = workers.environment("room")
    assert [name for name in before if before[name] != after[name]] == ["code of room"]


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("tcp://127.0.0.1:9", "found no scheduler at tcp://127.0.0.1:9, expected one that answers"),
        ("nonsense", "found 'nonsense', expected an address such as tcp://host:8786"),
    ],
)
def test_a_stage_without_its_scheduler_ends_in_one_line_and_writes_nothing(monkeypatch, tmp_path, address, message):
    monkeypatch.chdir(tmp_path)
    model = begin_project(tmp_path, 4)
    truth = truth_of(model, stiffness=0.7)
    write_trials(tmp_path / "data/processed/filter", [tilt(truth, 60), tilt(truth, 75, "validate")])
    monkeypatch.setenv(VARIABLE, address)
    monkeypatch.setattr(workers, "CONNECTING", 1.0)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=f"^{VARIABLE}: {message}$"):
        run("identify_stiffness", settings(["static_tilt"], ["static_tilt"], {"stiffness": (1, 9)}), CAD_MODEL)
    assert sorted(tmp_path.rglob("*")) == before


def _slowly(_, piece):
    time.sleep(0.2)
    return piece


def _started(file: Path, *command: str) -> subprocess.Popen:
    output = file.with_suffix(".log").open("w")
    return subprocess.Popen([sys.executable, "-m", *command], stdout=output, stderr=output, start_new_session=True)


def test_a_scheduler_that_goes_away_is_told_in_one_line(monkeypatch, tmp_path):
    """A real one, with a worker as docs/speed.md starts it; before the worker is there, that is told."""
    file = tmp_path / "scheduler.json"
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    processes = [_started(file, "distributed.cli.dask_scheduler", *options)]
    try:
        while not file.exists():
            assert processes[0].poll() is None, file.with_suffix(".log").read_text()
            time.sleep(0.1)
        monkeypatch.setattr(workers, "CONNECTING", 120.0)
        monkeypatch.setattr(workers, "FIRST_WORKER", 0.1)
        address = scheduler_address(file)
        monkeypatch.setenv(VARIABLE, address)
        with pytest.raises(InputError, match=f"^{VARIABLE}: found no workers at {address}, expected at least one$"):
            spread(_slowly, [1])
        monkeypatch.setattr(workers, "FIRST_WORKER", 120.0)
        worker = ["trunkline.compute.worker", address, "--nworkers", "1", "--no-nanny", "--no-dashboard"]
        processes.append(_started(tmp_path / "worker", *worker, "--local-directory", str(tmp_path)))
        rows = arriving(_slowly, list(range(100)))
        received = [next(rows)]
        processes[0].kill()
        with pytest.raises(InputError, match=f"the scheduler at {address} went away"), output_folder(tmp_path / "out"):
            received += rows
        assert not (tmp_path / "out").exists()
        assert received
    finally:
        for process in processes:
            process.kill()
            process.wait()


def scheduler_address(file: Path) -> str:
    return json.loads(file.read_text())["address"]
