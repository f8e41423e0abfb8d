"""How often the 95 % intervals hold the truth, where it is known: `python -m studies.coverage`

A small arm of known parameters makes noisy trials again and again (`tests/support/noisy_trials.py`). Each time its
parameters are searched for as the stages do, by least squares, from a model whose own are drawn from the whole range,
a tenth to ten times the truth, and get their intervals. They are those of params.yaml, but for `capstan_friction`, as
the arm's cables do not rub, and with `stiffness` from releases too, as for an arm without shapes at rest. What may be 0
or less is searched for in the committed range, from 0. One stage is done for a second plant too, which is not the
model: heavier, with dry friction in its joints.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import cache, partial
from multiprocessing import get_context

import mujoco
import numpy as np
from scipy.stats import t as student
from threadpoolctl import threadpool_limits

from studies.stage_chain import committed
from tests.support.matched_plant import FRAME, curl, markers_of, motion, small_model, static_pull, tilt
from tests.support.noisy_trials import WEIGHTS, Stage, measured, releases, with_values
from trunkline.compute.processes import end_with_parent
from trunkline.compute.progress import progress
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from trunkline.identification.fit.intervals import certainty
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.fit.search import descend, search
from trunkline.identification.fit.surrogate import surrogate
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.simulate.experiment import prepare
from trunkline.model.arm.joints import Joints, MaxwellElement
from trunkline.recordings.trials.trial import Trial
from upkeep.results import recorded

REPETITIONS = 80
UNITS, STEPS = 3, 4  # of the arm, of a frame: small, so that so many repetitions take minutes
FRAMES = {"stiffness": 1, "damping": 100, "control": 60}  # of a trial
RANGE = 10.0  # times the truth and a share of it: where is searched
ROUGH = LeastSquares(starts=7, descents=1, iterations=6, tolerance=1e-2)
POLISH = 60, 1e-6  # iterations and tolerance
MASS_FACTOR, DRY_FRICTION = 1.05, 8e-4  # of the mismatched plant, as the stand-in lab's; the latter in rad
FORCES = ("stiffness", "damping")  # told by motion only over the masses


@dataclass
class Searched(Stage):
    """joints, motors: what the model needs for its parameters beside springs, dampers, gains and a lag."""

    joints: Joints = field(default_factory=Joints)
    motors: dict[str, float] = field(default_factory=dict)


def statics(truth: mujoco.MjModel, frames: int) -> list[Trial]:
    pulls = ([12, 0, 0], [0, 12, 0], [0, 0, 12], [10, 10, 0], [0, 10, 10])
    return [tilt(truth, angle) for angle in (20, 45, 70, 90)] + [static_pull(truth, pull) for pull in pulls]


def driven(truth: mujoco.MjModel, frames: int) -> list[Trial]:
    """Of the curls, the last two reach the force range."""
    curls = [curl(truth, level, frames=frames, tendon=index % 3) for index, level in enumerate((20, 30, 45, 60))]
    return [*curls, *(motion(truth, 20, frames=frames, seed=seed) for seed in (0, 1))]


STAGES = {
    "stiffness": Searched(
        {
            "stiffness": 2.0, "hardening": 1.5, "joint_place": 0.3, "mount_tilt_x": 0.02, "mount_tilt_y": -0.03,
            "rest_bend_x": 0.01, "rest_bend_y": -0.01, "rest_gradient_x": 0.02, "rest_gradient_y": -0.02,
            "kp": 600.0,
        }, statics,
    ),
    "damping": Searched(
        {
            "stiffness": 2.0, "damping": 0.07, "relaxation": 0.3, "relaxation_time": 0.2, "relaxation_2": 0.15,
            "relaxation_time_2": 0.03,
        }, releases, joints=Joints([MaxwellElement(0.3, 0.5), MaxwellElement(0.1, 0.03)]),
    ),
    "control": Searched(
        {"kp": 600.0, "kv": 25.0, "time_constant": 0.05, "dead_time": 0.02, "force_range": 1.6}, driven,
        motors={"dead_time": 0.02},
    ),
}  # fmt: skip


@cache  # each repetition asks
def bounds_of(name: str) -> dict[str, Bounds]:
    """The ranges of a stage's parameters: about the truth, and no wider than the committed ones that hold it, which
    keep a slow branch and a fast one apart."""
    found, ranges = {}, committed("identify_stiffness").parameters | committed(f"identify_{name}").parameters
    for key, value in STAGES[name].true.items():
        own = ranges[key]
        low = max(own.low, value / RANGE) if own.low < value else value / RANGE
        high = min(own.high, value * RANGE) if own.high > value else value * RANGE
        found[key] = own if parameter_named(key).signed else Bounds(low, high)
    return found


@dataclass
class IntervalCoverage:
    """errors: of ln(value), or of a signed value over the truth, per repetition and parameter. widths: half, of the
    intervals. lost: repetitions whose search did not converge."""

    names: list[str]
    trials: int
    errors: list[np.ndarray] = field(default_factory=list)
    widths: list[np.ndarray] = field(default_factory=list)
    lost: int = 0

    def rows(self, stage: str, plant: str) -> list[str]:
        """Of the table, one a parameter."""
        errors, widths = np.array(self.errors), np.array(self.widths)
        inside = np.abs(errors) < widths
        promised = np.median(widths, axis=0) / student.ppf(0.975, self.trials - 1)
        lines = []
        for i, name in enumerate(self.names):
            cells = [f"{100 * inside[:, i].mean():.1f} %"]
            far = np.mean(np.abs(errors[:, i]) > 0.5)
            cells += [f"{100 * np.median(errors[:, i]):+.2f} %", f"{100 * np.std(errors[:, i]):.2f} %"]
            cells += [f"{100 * promised[i]:.2f} %", f"{100 * far:.1f} %"]
            lines.append(f"| {stage} | {plant} | `{name}` | {' | '.join(cells)} | {self.lost} of {len(errors)} |")
        return lines


def mismatched(truth: mujoco.MjModel) -> mujoco.MjModel:
    """A plant that is not the model."""
    plant = truth.__copy__()
    plant.body_mass[:] *= MASS_FACTOR
    plant.body_inertia[:] *= MASS_FACTOR
    plant.dof_frictionloss[:] = DRY_FRICTION * plant.jnt_stiffness[plant.dof_jntid]
    return plant


@cache
def _lab(name: str, is_matched: bool) -> tuple[mujoco.MjModel, list[Trial], dict[str, float]]:
    """The model of a stage, trials without noise, and what its parameters should come to."""
    stage = STAGES[name]
    model = small_model(UNITS, stage.joints, **stage.motors)
    model.opt.timestep = FRAME / STEPS
    truth = with_values(model, stage.true)
    clean = stage.trials(truth if is_matched else mismatched(truth), FRAMES[name])
    expected = {
        key: value / MASS_FACTOR if key in FORCES and not is_matched else value for key, value in stage.true.items()
    }
    return model, clean, expected


def repeat(name: str, is_matched: bool, repetition: int) -> tuple[np.ndarray, np.ndarray, bool]:
    """One fit: errors and half widths, as `IntervalCoverage` has them, and whether it converged."""
    model, clean, expected = _lab(name, is_matched)
    scaled = [key for key in expected if not parameter_named(key).signed]
    exact = np.array([parameter_named(key).coordinate(value) for key, value in expected.items()])
    unit = np.array([1.0 if key in scaled else abs(value) for key, value in expected.items()])
    rng = np.random.default_rng([repetition, list(STAGES).index(name)])
    begin = with_values(model, {key: expected[key] * RANGE ** rng.uniform(-1, 1) for key in scaled})
    experiments = [prepare(measured(trial, rng), begin, FRAMES[name]) for trial in clean]
    problem = Problem(begin, experiments, markers_of(begin), bounds_of(name), "positions", WEIGHTS)
    rough = search(problem, ROUGH, repetition, lambda best: None)
    end = descend(problem, rough.vector, *POLISH, lambda best: None)
    around = surrogate(problem, end.vector, end.residuals)
    half_width = certainty(linearise(problem, end.vector, end.residuals), around=around).half_width
    return (end.vector - exact) / unit, half_width / unit, end.converged


def cover(name: str, is_matched: bool, repetitions: int, run: Callable[..., Iterable] = map) -> IntervalCoverage:
    """The repetitions of one stage, by `run`, which is as `map`."""
    found = IntervalCoverage(list(STAGES[name].true), len(_lab(name, is_matched)[1]))
    with redirect_stdout(sys.stderr), progress(repetitions, f"coverage of {name}", "repetitions") as bar:
        for error, width, converged in run(partial(repeat, name, is_matched), range(repetitions)):
            found.errors.append(error)
            found.widths.append(width)
            found.lost += not converged
            bar.update(1)
    return found


def begin_worker() -> None:
    """A process has one thread: many small problems, in which threads only get in each other's way."""
    end_with_parent()
    os.environ["TRUNKLINE_THREADS"] = "1"
    threadpool_limits(1, user_api="blas")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.coverage", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=REPETITIONS)
    arguments = parser.parse_args()
    pool = ProcessPoolExecutor(thread_count(), get_context("spawn"), begin_worker)
    with recorded("coverage", keep=arguments.repetitions >= REPETITIONS), pool:
        print(
            "| stage | plant | parameter | holds it | median error | scatter | promised | off by half | not converged |"
        )
        print("|---|---|---|---:|---:|---:|---:|---:|---:|")
        for name, is_matched in (("damping", True), ("damping", False), ("stiffness", True), ("control", True)):
            plant = "the model" if is_matched else "heavier, dry friction"
            covered = cover(name, is_matched, arguments.repetitions, pool.map)
            print("\n".join(covered.rows(f"`identify_{name}`", plant)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
