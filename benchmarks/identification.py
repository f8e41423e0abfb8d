"""Identification side by side with raw simulation, with the paper's recipe as first written, and with mujoco.sysid.

    python -m benchmarks.identification [--quick] [--only rate recipe sysid growth] [--halve]

Needs what `make demo` leaves behind. Uses TRUNKLINE_THREADS threads; runs of rivals alternate, and the best of each
counts. CPU time is that of all threads: on a busy machine it says more than wall time.
"""

import argparse
import contextlib
import copy
import io
import os
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.optimize import differential_evolution

from stages.build_mjcf import Config as ArmConfig
from trunkline.arm.material import unit_properties
from trunkline.arm.mjcf import Solver, Tendons, build_spec
from trunkline.arm.parameters import PARAMETERS, Fields, set_fields
from trunkline.arm.spiral import spiral_chain
from trunkline.config import load_config
from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.identification.evaluation import arm_length, replay, scores
from trunkline.identification.experiment import SLACK, Experiment
from trunkline.identification.identify import Coarse, Fine, identify
from trunkline.identification.loss import RESIDUALS, LossWeights, loss_of
from trunkline.identification.population import Population
from trunkline.identification.pose_fit import PoseFit
from trunkline.identification.problem import DIVERGED_LOSS, Bounds, Problem
from trunkline.identification.run import CAD_MODEL, TRIALS, read_experiments, read_spec
from trunkline.identification.search import DIFFERENCE
from trunkline.threads import thread_count

# every stage, and the model that it begins with
STAGES = {
    "identify_stiffness": CAD_MODEL,
    "identify_damping": Path("artifacts/identify_stiffness/arm.xml"),
    "identify_control": Path("artifacts/identify_damping/arm.xml"),
}
IDENTIFIED = Path("artifacts/identify_control/arm.xml")
SAME_LOSS = 1.01  # within 1 % counts as the same
HALVING = 0.05  # share of E_internal by which half the time step may move it


@dataclass
class Size:
    """How much is run. trials, frames: of each problem, at most. budget: s for each search of a rival.

    seeds: runs against the recipe, whose luck differs. repeats: of each timing. rate_frames, growth_frames: frames
    simulated there. units: of the arms in `growth`.
    """

    trials: int = 3
    frames: int = 437
    budget: float = 120.0
    seeds: int = 3
    repeats: int = 3
    rate_frames: int = 60
    growth_frames: int = 40
    units: tuple[int, ...] = (6, 12, 24, 36)


QUICK = Size(trials=2, frames=90, budget=25.0, seeds=1, repeats=2, rate_frames=40, growth_frames=12, units=(6, 12, 24))


@dataclass
class Case:
    """What one stage searches for, and the trials of the same kinds that it never sees."""

    model: mujoco.MjModel
    experiments: list[Experiment]
    unseen: list[Experiment]
    segments: tuple[str, ...]
    bounds: dict[str, Bounds]
    loss: str
    weights: LossWeights
    coarse: Coarse
    seed: int = 1

    def problem(self) -> Problem:
        """At the model's own time step, over whole trials."""
        return Problem(self.model, self.experiments, self.segments, self.bounds, self.loss, self.weights)

    def values(self, vector: np.ndarray) -> str:
        """A candidate in words."""
        pairs = zip(self.bounds, np.exp(vector), strict=True)
        return ", ".join(f"{name} {value:.4g} {PARAMETERS[name].unit}" for name, value in pairs)

    def unseen_errors(self, vector: np.ndarray) -> str:
        """E_internal and position error of a candidate on the unseen trials, in words."""
        model = copy.copy(self.model)
        set_fields(model, self.problem().fields(vector[None]))
        table = scores(
            replay(model, self.unseen, self.segments), self.unseen, self.loss, self.weights, arm_length(model)
        )["validate"]
        return f"validate: E_internal {table['e_internal_mm']:.3f} mm, position {table['e_position_mm']:.2f} mm"


@dataclass
class Spent:
    """Seconds on the clock, and of all threads together."""

    wall: float
    cpu: float

    def __add__(self, other: "Spent") -> "Spent":
        return Spent(self.wall + other.wall, self.cpu + other.cpu)

    def __str__(self) -> str:
        return f"{self.wall:.1f} s (CPU {self.cpu:.1f} s)"


class Stopwatch:
    def __init__(self):
        self._wall, self._cpu = time.perf_counter(), _cpu_time()

    def read(self) -> Spent:
        return Spent(time.perf_counter() - self._wall, _cpu_time() - self._cpu)


def _cpu_time() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


@dataclass
class Search:
    """A rival at work: its candidates' losses and when each was known; stops it at a target or out of time."""

    target: float = 0.0
    budget: float = np.inf
    best: float = np.inf
    vector: np.ndarray | None = None
    evaluations: int = 0
    history: list[tuple[float, Spent]] = field(default_factory=list)
    clock: Stopwatch = field(default_factory=Stopwatch)

    class Stop(Exception):
        """Reached the target, or ran out of time."""

    def note(self, vectors: np.ndarray, losses: np.ndarray) -> None:
        self.evaluations += len(losses)
        index = int(np.argmin(losses))
        spent = self.clock.read()
        if losses[index] < self.best:
            self.best, self.vector = float(losses[index]), vectors[index].copy()
            self.history.append((self.best, spent))
        if self.best <= self.target or spent.wall > self.budget:
            raise Search.Stop

    def reached(self, loss: float) -> Spent | None:
        """When it first had a candidate of at most this loss."""
        return next((spent for best, spent in self.history if best <= loss), None)


def rate(case: Case, count: int, step_factor: float, repeats: int) -> dict[str, Spent]:
    """Time per simulation step, s: bare `Batch.step`, `Population.simulate` and `Problem.losses`.

    All three run the same candidates through the same trials; the first reads nothing back on the way.
    """
    problem = replace(case.problem(), step_factor=step_factor)
    vectors = np.random.default_rng(0).uniform(*problem.bounds(0.0), (count, len(case.bounds)))
    fields = problem.fields(vectors)
    population = Population(case.model, case.experiments, case.segments, step_factor)

    def losses() -> int:
        before = problem.steps
        problem.losses(vectors)
        return problem.steps - before

    rivals = {
        "bare Batch.step": bare_batch(case, fields, count, step_factor)[1],
        "Population.simulate": lambda: population.simulate(fields).steps,
        "Problem.losses": losses,
    }
    return alternate(rivals, repeats)


def bare_batch(case: Case, fields: Fields, count: int, step_factor: float) -> tuple[Batch, Callable[[], int]]:
    """A batch of simulations t·C + c, and what brings it to its start, runs it and returns the steps that it took.

    Commands stay what they are at first, as in a release.
    """
    experiments = case.experiments
    repeat = partial(np.repeat, repeats=count, axis=0)
    substeps = round(experiments[0].frame_step / (case.model.opt.timestep * step_factor))
    model = copy.copy(case.model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    batch = Batch(model, count * len(experiments), nthread=thread_count())
    for name, values in fields.items():
        batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
    batch.expand("opt.gravity")[:] = repeat([e.gravity for e in experiments])

    def run() -> int:
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        batch.bind("qpos")[:] = repeat([e.start for e in experiments])
        batch.bind("ctrl")[:] = batch.bind("act")[:] = repeat([e.controls[0] for e in experiments])
        batch.expand("opt.timestep")[:] = repeat([e.lead / substeps for e in experiments])
        batch.step(nstep=substeps)
        batch.expand("opt.timestep")[:] = experiments[0].frame_step / substeps
        batch.step(nstep=(experiments[0].frames - 1) * substeps)
        return experiments[0].frames * substeps * batch.nsim

    return batch, run


def alternate(rivals: dict[str, Callable[[], int]], repeats: int) -> dict[str, Spent]:
    """Best time per step of each; every rival returns how many steps it took. One round more warms up."""
    best = {name: Spent(np.inf, np.inf) for name in rivals}
    for turn in range(repeats + 1):
        for name, run in rivals.items():
            clock = Stopwatch()
            steps = run()
            spent = clock.read()
            if turn:
                best[name].wall = min(best[name].wall, spent.wall / steps)
                best[name].cpu = min(best[name].cpu, spent.cpu / steps)
    return best


def as_first_written(case: Case) -> Callable[[np.ndarray], float]:
    """The loss of one candidate (P,), the way one would write it first: a Python loop of mj_step, trial by trial."""
    model, problem = copy.copy(case.model), case.problem()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    sites = [model.site(f"{name}_center").id for name in case.segments]

    def loss(vector: np.ndarray) -> float:
        set_fields(model, problem.fields(vector[None]))
        losses = []
        for experiment in case.experiments:
            substeps = round(experiment.frame_step / case.model.opt.timestep)
            model.opt.gravity[:] = experiment.gravity
            data = mujoco.MjData(model)
            data.qpos[:], data.act[:] = experiment.start, experiment.controls[0]
            seen = np.empty(experiment.positions.shape)
            for frame in range(experiment.frames):
                model.opt.timestep = (experiment.frame_step if frame else experiment.lead) / substeps
                data.ctrl[:] = experiment.controls[frame]
                for _ in range(substeps):
                    mujoco.mj_step(model, data)
                mujoco.mj_kinematics(model, data)
                seen[frame] = data.site_xpos[sites]
            if not np.isfinite(seen).all():
                return DIVERGED_LOSS
            residuals = RESIDUALS[case.loss](seen[None], experiment.positions, experiment.measured, case.weights)
            losses.append(float(loss_of(residuals)[0]))
        return float(np.mean(losses))

    return loss


def identified(case: Case) -> tuple[np.ndarray, float, Spent]:
    """Scalars (P,) by `identify`, their loss over whole trials, and the time that it took; no factors of joints."""
    clock = Stopwatch()
    with contextlib.redirect_stdout(io.StringIO()):
        result = identify(
            "", case.model, case.experiments, case.segments, case.bounds, (), case.loss, case.weights,
            case.coarse, Fine("none", 0.1, 5, 1, 1, 1e-3), case.seed,
        )  # fmt: skip
    spent = clock.read()
    vector = np.log([result.values[name] for name in case.bounds])
    return vector, float(case.problem().losses(vector[None])[0]), spent


def by_recipe(case: Case, target: float, budget: float) -> Search:
    """scipy's differential evolution as it comes, one candidate at a time, until it is as good as `target`.

    It searches on the same logarithmic scale, and changes the model's fields in place: kinder than most first drafts.
    """
    loss, search = as_first_written(case), Search(target, budget)

    def objective(vector: np.ndarray) -> float:
        value = loss(vector)
        search.note(vector[None], np.array([value]))
        return value

    with contextlib.suppress(Search.Stop):
        differential_evolution(objective, list(zip(*case.problem().bounds(0.0), strict=True)), rng=case.seed)
    return search


def by_sysid(case: Case, budget: float, **options) -> Search:
    """`mujoco.sysid.optimize` from the values in the model, on the same residuals, columns as one batch."""
    from mujoco import sysid

    problem = case.problem()
    low, high = problem.bounds(0.0)
    start = np.clip(np.log([PARAMETERS[name].read(case.model) for name in case.bounds]), low, high)
    rows = zip(case.bounds, start, low, high, strict=True)
    parameters = sysid.ParameterDict({row[0]: sysid.Parameter(*row) for row in rows})
    search = Search(budget=budget)

    def residual(x: np.ndarray, _) -> tuple:
        vectors = np.ascontiguousarray(x.reshape(len(x), -1).T)
        residuals = np.concatenate(problem.residuals(vectors), axis=1)
        search.note(vectors, loss_of(residuals))
        return [residuals.T if x.ndim == 2 else residuals[0]], None, None

    with contextlib.suppress(Search.Stop), contextlib.redirect_stdout(io.StringIO()):
        sysid.optimize(parameters, residual, verbose=False, **options)
    return search


def hanging_arm(units: int) -> mujoco.MjModel:
    """The initial model, with another number of units."""
    config = load_config(ArmConfig, "build_mjcf")
    arm, actuation = config.arm, config.actuation
    chain = spiral_chain(arm.length, arm.base_width, arm.tip_width, units)
    properties = unit_properties(chain, arm.modulus, arm.density, arm.core_ratio, arm.damping_ratio)
    drive = actuation.kp, 2 * np.sqrt(actuation.kp * properties.masses.sum()), actuation.max_force
    tendons = Tendons(arm.tendons, arm.hole_ratio, actuation.friction, *drive, actuation.time_constant)
    return build_spec(chain, properties, tendons, Solver(**vars(config.solver))).compile()


def bent_release(model: mujoco.MjModel, frames: int, frame_step: float) -> tuple[Experiment, tuple[str, ...]]:
    """A release from a bend of 270° in all that is compared with nothing, and the segments it tracks."""
    units = model.nq // 2
    start = np.tile([0.0, np.radians(270) / units], units)
    segments = tuple(model.body(i).name for i in range(2, model.nbody))
    positions = np.zeros((frames, len(segments), 3))
    experiment = Experiment(
        name="bent",
        kind="release",
        split="identify",
        gravity=gravity_in_base(0.0),
        start=start,
        velocity=np.zeros(model.nv),
        lead=frame_step,
        controls=np.tile(model.tendon_length0 + SLACK, (frames, 1)),
        positions=positions,
        measured=np.ones(positions.shape[:2], bool),
        frame_step=frame_step,
        fit=PoseFit(start, np.zeros(len(segments)), 0, True),
    )
    return experiment, segments


def growth(case: Case, size: Size) -> dict[str, dict[int, Spent]]:
    """Time of one evaluation of a population, s, over its size, its trials and the arm's units."""
    base, trials = 10, len(case.experiments)
    return {
        "candidates": {n: _evaluation_time(case, n, trials, size.repeats) for n in (5, base, 2 * base, 4 * base)},
        "trials": {n: _evaluation_time(case, base, n, size.repeats) for n in sorted({1, (trials + 1) // 2, trials})},
        "units": {n: _evaluation_time(_case_of_units(case, n), base, 1, size.repeats) for n in size.units},
    }


def _case_of_units(case: Case, units: int) -> Case:
    first = case.experiments[0]
    model = hanging_arm(units)
    experiment, segments = bent_release(model, first.frames, first.frame_step)
    return replace(case, model=model, experiments=[experiment], segments=segments)


def _evaluation_time(case: Case, count: int, trials: int, repeats: int) -> Spent:
    problem = replace(case, experiments=case.experiments[:trials]).problem()
    own = np.log([PARAMETERS[name].read(case.model) for name in case.bounds])
    vectors = own + np.random.default_rng(0).uniform(-0.2, 0.2, (count, len(own)))
    return alternate({"": lambda: len([problem.losses(vectors)])}, repeats)[""]


def halving(
    model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...], case: Case
) -> dict[str, tuple[float, float]]:
    """E_internal, mm, per split, at the model's time step and at half of it."""
    half = copy.copy(model)
    half.opt.timestep = model.opt.timestep / 2
    tables = [
        scores(replay(m, experiments, segments), experiments, case.loss, case.weights, arm_length(m))
        for m in (model, half)
    ]
    return {split: tuple(table[split]["e_internal_mm"] for table in tables) for split in tables[0]}


def read_case(stage: str, size: Size) -> Case:
    """The stage's problem of the demo session, as `stages/<stage>.py` sets it up, with fewer trials.

    Raises:
        InputError: if the pipeline has not run so far.
    """
    need(STAGES[stage], TRIALS / "trials.parquet")
    config = load_config(import_module(f"stages.{stage}").Config, stage)
    model = read_spec(STAGES[stage]).compile()
    experiments, segments = read_experiments(config, model)
    chosen = [shortened(e, size.frames) for e in experiments if e.kind in config.experiments]
    return Case(
        model=model,
        experiments=spread([e for e in chosen if e.split == "identify"], size.trials),
        unseen=[e for e in chosen if e.split == "validate"],
        segments=segments,
        bounds={name: Bounds(r.low, r.high) for name, r in config.parameters.items()},
        loss=config.loss.kind,
        weights=LossWeights(**{k: v for k, v in vars(config.loss).items() if k != "kind"}),
        coarse=Coarse(**vars(config.coarse)),
        seed=config.seed,
    )


def need(*paths: Path) -> None:
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path}: no such file, expected what `make demo` writes; run it first")


def spread(items: list, count: int) -> list:
    """At most `count` of `items`, evenly spread from first to last."""
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, count).round().astype(int))]


def shortened(experiment: Experiment, frames: int) -> Experiment:
    window = slice(0, frames)
    parts = {name: getattr(experiment, name)[window] for name in ("controls", "positions", "measured")}
    return replace(experiment, **parts)


def print_rate(size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=99, frames=size.rate_frames))
    count = case.coarse.population
    print(f"(1) steps: {count} candidates x {len(case.experiments)} releases of {size.rate_frames} frames")
    for factor in sorted({1.0, case.coarse.step_factor}):
        times = rate(case, count, factor, size.repeats)
        bare = times["bare Batch.step"]
        print(f"    {case.model.opt.timestep * factor * 1e3:.2f} ms a step   steps/s  of bare   CPU us/step  of bare")
        for name, spent in times.items():
            print(
                f"    {name:20s} {1 / spent.wall:10.0f} {100 * bare.wall / spent.wall:6.0f} %"
                f" {1e6 * spent.cpu:11.1f} {100 * bare.cpu / spent.cpu:8.0f} %"
            )


def print_recipe(size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=2))
    print(f"(2) damping stage, {len(case.experiments)} releases of {size.frames} frames, to the same loss within 1 %")
    own_total, total, sign = Spent(0.0, 0.0), Spent(0.0, 0.0), ""
    for seed in range(case.seed, case.seed + size.seeds):
        seeded = replace(case, seed=seed)
        vector, loss, own = identified(seeded)
        search = by_recipe(seeded, SAME_LOSS * loss, size.budget)
        spent = search.reached(SAME_LOSS * loss) or search.clock.read()
        late = search.best > SAME_LOSS * loss
        print(f"    seed {seed}: identify      loss {loss:.4g} in {own}: {case.values(vector)}")
        end = ", and then out of time" if late else ""
        print(f"            first written loss {search.best:.4g} in {spent}, {search.evaluations} candidates{end}")
        own_total, total, sign = own_total + own, total + spent, ">= " if late else sign
    print(f"    ratio: {sign}{total.wall / own_total.wall:.1f} (CPU {sign}{total.cpu / own_total.cpu:.1f})")


def print_sysid(size: Size) -> None:
    print("(3) against mujoco.sysid.optimize from the CAD values, same residuals, its columns batched too")
    for stage in STAGES:
        case = read_case(stage, replace(size, trials=2 * size.trials) if stage == "identify_stiffness" else size)
        vector, loss, own = identified(case)
        print(f"    {stage}, {len(case.experiments)} trials")
        print(f"      identify           {loss:.4g} in {own}; {case.unseen_errors(vector)}")
        print(f"                         {case.values(vector)}")
        for name, options in {"as it comes": {}, f"eps {DIFFERENCE:g}": {"eps": DIFFERENCE}}.items():
            search = by_sysid(case, size.budget / 2, **options)
            total, first = search.clock.read(), search.reached(SAME_LOSS * search.best)
            same = search.reached(SAME_LOSS * loss)
            print(f"      sysid, {name:11s} {search.best:.4g} in {first}; {case.unseen_errors(search.vector)}")
            print(f"                         {case.values(search.vector)}")
            ended = f"as good as identify after {same}" if same else "never as good as identify"
            print(
                f"                         {ended}, ended after {total}; identify: {loss / search.best:.3f} x its loss "
                f"in {own.wall / first.wall:.1f} times its time (CPU {own.cpu / first.cpu:.1f})"
            )


def print_growth(size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=99, frames=size.growth_frames))
    trials = len(case.experiments)
    print(f"(4) one evaluation: 10 candidates x {trials} releases (units: x 1) of {size.growth_frames} frames")
    for axis, times in growth(case, size).items():
        (least, first), *_, (most, last) = times.items()
        power = np.log(last.cpu / first.cpu) / np.log(most / least)
        row = ", ".join(f"{n}: {spent.wall:.2f} s (CPU {spent.cpu:.2f})" for n, spent in times.items())
        print(f"    {axis:10s} {row}; CPU time grows as {axis}^{power:.2f}")


def print_halving(size: Size) -> bool:
    need(IDENTIFIED)
    case = read_case("identify_control", size)
    config = load_config(import_module("stages.identify_control").Config, "identify_control")
    model = read_spec(IDENTIFIED).compile()
    experiments, segments = read_experiments(config, model)
    table = halving(model, [shortened(e, size.frames) for e in experiments], segments, case)
    passed = True
    for split, (whole, half) in table.items():
        change = half / whole - 1
        passed &= abs(change) < HALVING
        step = model.opt.timestep * 1e3
        print(
            f"{split}: E_internal {whole:.4f} mm at {step:.3f} ms, {half:.4f} mm at {step / 2:.3f} ms: "
            f"{100 * change:+.2f} % ({'within' if abs(change) < HALVING else 'NOT within'} {100 * HALVING:.0f} %)"
        )
    return passed


PARTS = {"rate": print_rate, "recipe": print_recipe, "sysid": print_sysid, "growth": print_growth}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a small run, about 2 minutes on 2 quiet cores")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="some of the parts")
    parser.add_argument("--halve", action="store_true", help="check the time step instead: exit code 1 if too coarse")
    arguments = parser.parse_args()
    size = QUICK if arguments.quick else Size()
    print(f"{thread_count()} threads; load average before: {os.getloadavg()[0]:.1f}", flush=True)
    try:
        if arguments.halve:
            return 0 if print_halving(size) else 1
        for name in arguments.only:
            PARTS[name](size)
            sys.stdout.flush()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
