"""(1) Simulator steps per second inside identification against the bare batch on the same model."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
from mujoco.batch import Batch

from benchmarks.identification.case import Case, ReadCase, Size
from benchmarks.identification.timing import Spent, alternate
from trunkline.identification.parameters.parameters import Fields
from trunkline.identification.simulate.population import Population
from trunkline.model.simulation.motion import batch_of, hold

CANDIDATES = 12


def report(read_case: ReadCase, size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=99, frames=size.rate_frames))
    print(f"(1) steps: {CANDIDATES} candidates x {len(case.experiments)} releases of {size.rate_frames} frames")
    for factor in sorted({1.0, case.fit.method.rough.step_factor}):
        times = rate(case, CANDIDATES, factor, size.repeats)
        bare = times["bare Batch.step"]
        print(f"    {case.model.opt.timestep * factor * 1e3:.2f} ms a step   steps/s  of bare   CPU us/step  of bare")
        for name, spent in times.items():
            print(
                f"    {name:20s} {1 / spent.wall:10.0f} {100 * bare.wall / spent.wall:6.0f} %"
                f" {1e6 * spent.cpu:11.1f} {100 * bare.cpu / spent.cpu:8.0f} %"
            )


def rate(case: Case, count: int, step_factor: float, repeats: int) -> dict[str, Spent]:
    """Time per simulation step, s: bare `Batch.step`, `Population.simulate` and `Problem.losses`.

    All three run the same candidates through the same trials; the first reads nothing back on the way.
    """
    problem = replace(case.problem(), step_factor=step_factor)
    vectors = np.random.default_rng(0).uniform(*problem.bounds(), (count, len(case.fit.parameters)))
    fields = problem.fields(vectors)
    population = Population(case.model, case.experiments, case.fit.segments, step_factor)

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
    batch = batch_of(case.model, count * len(experiments))
    for name, values in fields.items():
        batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
    batch.expand("opt.gravity")[:] = repeat([e.gravity for e in experiments])

    def run() -> int:
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        batch.bind("qpos")[:, : len(experiments[0].start)] = repeat([e.start for e in experiments])
        hold(batch, case.model, repeat([e.controls[0] for e in experiments]))
        batch.expand("opt.timestep")[:] = repeat([e.lead / substeps for e in experiments])
        batch.step(nstep=substeps)
        batch.expand("opt.timestep")[:] = experiments[0].frame_step / substeps
        batch.step(nstep=(experiments[0].frames - 1) * substeps)
        return experiments[0].frames * substeps * batch.nsim

    return batch, run
