"""(2) Time to the same loss against the paper's recipe as one would first write it."""

import contextlib
import copy
from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
from scipy.optimize import differential_evolution

from benchmarks.identification.case import SAME_LOSS, Case, ReadCase, Size, identified
from benchmarks.identification.rival import Rival
from benchmarks.identification.timing import Spent
from trunkline.identification.fit.problem import DIVERGED_LOSS
from trunkline.identification.parameters.parameters import set_fields
from trunkline.identification.simulate.loss import RESIDUALS, loss_of


def report(read_case: ReadCase, size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=2))
    print(f"(2) damping stage, {len(case.experiments)} releases of {size.frames} frames, to the same loss within 1 %")
    own_total, total, sign = Spent(0.0, 0.0), Spent(0.0, 0.0), ""
    for seed in range(case.fit.method.seed, case.fit.method.seed + size.seeds):
        seeded = replace(case, fit=replace(case.fit, method=replace(case.fit.method, seed=seed)))
        own = identified(seeded)
        target = SAME_LOSS * own.loss
        rival = by_recipe(seeded, target, size.budget)
        spent = rival.reached(target) or rival.clock.read()
        late = rival.best > target
        print(f"    seed {seed}: identify      loss {own.loss:.4g} in {own.spent}: {case.values(own.vector)}")
        end = ", and then out of time" if late else ""
        print(f"            first written loss {rival.best:.4g} in {spent}, {rival.evaluations} candidates{end}")
        own_total, total, sign = own_total + own.spent, total + spent, ">= " if late else sign
    print(f"    ratio: {sign}{total.wall / own_total.wall:.1f} (CPU {sign}{total.cpu / own_total.cpu:.1f})")


def by_recipe(case: Case, target: float, budget: float) -> Rival:
    """scipy's differential evolution as it comes, one candidate at a time, until it is as good as `target`.

    It searches on the same logarithmic scale, and changes the model's fields in place: kinder than most first drafts.
    """
    loss, rival = as_first_written(case), Rival(target, budget)

    def objective(vector: np.ndarray) -> float:
        value = loss(vector)
        rival.note(vector[None], np.array([value]))
        return value

    with contextlib.suppress(Rival.Stop):
        differential_evolution(objective, list(zip(*case.problem().bounds(), strict=True)), rng=case.fit.method.seed)
    return rival


def as_first_written(case: Case) -> Callable[[np.ndarray], float]:
    """The loss of one candidate (P,), the way one would write it first: a Python loop of mj_step, trial by trial."""
    model, problem = copy.copy(case.model), case.problem()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    sites = [model.site(f"{name}_center").id for name in case.fit.segments]

    def loss(vector: np.ndarray) -> float:
        set_fields(model, problem.fields(vector[None]))
        losses = []
        for experiment in case.experiments:
            substeps = round(experiment.frame_step / case.model.opt.timestep)
            model.opt.gravity[:] = experiment.gravity
            data = mujoco.MjData(model)
            data.qpos[: len(experiment.start)], data.act[:] = experiment.start, experiment.controls[0]
            seen = np.empty(experiment.positions.shape)
            for frame in range(experiment.frames):
                model.opt.timestep = (experiment.frame_step if frame else experiment.lead) / substeps
                data.ctrl[:] = experiment.controls[frame]
                for _ in range(substeps):
                    mujoco.mj_step(model, data)
                mujoco.mj_kinematics(model, data)
                seen[frame] = data.site_xpos[sites]
            if not np.isfinite(seen).all() or any(warning.number for warning in data.warning):
                return DIVERGED_LOSS
            compared = seen[None], experiment.positions, experiment.measured, case.fit.weights
            residuals = RESIDUALS[case.fit.loss](*compared)
            losses.append(float(loss_of(residuals)[0]))
        return float(np.mean(losses))

    return loss
