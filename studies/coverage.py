"""How often the 95 % intervals hold the truth, where it is known: `python -m studies.coverage`

A small arm of known parameters makes noisy trials again and again (`tests/support/noisy_trials.py`). Each time its
parameters are searched for as the stages do, by least squares, from a model whose own are drawn from the whole range,
a tenth to ten times the truth, and get their intervals. One stage is done for a second plant too, which is not the
model: heavier, with dry friction in its joints. Takes some ten minutes of one core.
"""

import argparse
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.stats import t as student
from threadpoolctl import threadpool_limits

from tests.support.matched_plant import FRAME, segments_of, small_model
from tests.support.noisy_trials import STAGES, TRIALS, WEIGHTS, measured, with_values
from trunkline.errors import in_one_line
from trunkline.identification.certainty import certainty
from trunkline.identification.experiment import prepare
from trunkline.identification.optimizers import LeastSquares
from trunkline.identification.problem import Bounds, Problem
from trunkline.identification.search import descend, search
from trunkline.identification.surrogate import surrogate
from trunkline.pipeline.results import recorded
from trunkline.progress import progress

REPETITIONS = 200
UNITS, STEPS = 3, 4  # of the arm, of a frame: small, so that so many repetitions take minutes
FRAMES = {"stiffness": 1, "damping": 36, "control": 60}  # of a trial
RANGE = 10.0  # times the truth and a share of it: where is searched
ROUGH = LeastSquares(starts=7, descents=1, iterations=6, tolerance=1e-2)
POLISH = 12, 1e-6  # iterations and tolerance
MASS_FACTOR, DRY_FRICTION = 1.05, 8e-4  # of the mismatched plant, as the stand-in lab's; the latter in rad
FORCES = ("damping", "tendon_friction")  # told by motion only over the masses


@dataclass
class Coverage:
    """errors: of ln(value), per repetition and parameter. widths: half, of the intervals. lost: repetitions whose
    search did not converge."""

    names: list[str]
    errors: list[np.ndarray] = field(default_factory=list)
    widths: list[np.ndarray] = field(default_factory=list)
    lost: int = 0

    def rows(self, stage: str, plant: str) -> list[str]:
        """Of the table, one a parameter."""
        errors, widths = np.array(self.errors), np.array(self.widths)
        inside = np.abs(errors) < widths
        promised = np.median(widths, axis=0) / student.ppf(0.975, TRIALS - 1)
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


def cover(name: str, is_matched: bool, repetitions: int) -> Coverage:
    """The repetitions of one stage."""
    stage, model, frames = STAGES[name], small_model(UNITS), FRAMES[name]
    model.opt.timestep = FRAME / STEPS
    truth = with_values(model, stage.true)
    clean = stage.trials(truth if is_matched else mismatched(truth), frames)
    bounds = {key: Bounds(value / RANGE, value * RANGE) for key, value in stage.true.items()}
    expected = {
        key: value / MASS_FACTOR if key in FORCES and not is_matched else value for key, value in stage.true.items()
    }
    exact, found = np.log(list(expected.values())), Coverage(list(stage.true))
    with redirect_stdout(sys.stderr), progress(repetitions, f"coverage of {name}", "repetitions") as bar:
        for repetition in range(repetitions):
            rng = np.random.default_rng([repetition, list(STAGES).index(name)])
            drawn = np.exp(exact + rng.uniform(-1, 1, len(exact)) * np.log(RANGE))
            begin = with_values(model, dict(zip(stage.true, drawn, strict=True)))
            experiments = [prepare(measured(trial, rng), begin, frames) for trial in clean]
            problem = Problem(begin, experiments, segments_of(begin), bounds, "positions", WEIGHTS)
            rough = search(problem, ROUGH, repetition, lambda best: None)
            end = descend(problem, rough.vector, *POLISH, lambda best: None)
            assert end.linear is not None, "least squares ends on its own linearisation"
            moves = surrogate(problem, end.vector, end.linear.residuals).moves
            found.errors.append(end.vector - exact)
            found.widths.append(certainty(end.linear, moves=moves).half_width)
            found.lost += not end.converged
            bar.update(1)
    return found


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.coverage", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=REPETITIONS)
    arguments = parser.parse_args()
    with recorded("coverage", keep=arguments.repetitions >= REPETITIONS):
        print(
            "| stage | plant | parameter | holds it | median error | scatter | promised | off by half | not converged |"
        )
        print("|---|---|---|---:|---:|---:|---:|---:|---:|")
        for name, is_matched in (("damping", True), ("damping", False), ("stiffness", True), ("control", True)):
            plant = "the model" if is_matched else "heavier, dry friction"
            with threadpool_limits(1, user_api="blas"):  # many small problems: threads only get in each other's way
                covered = cover(name, is_matched, arguments.repetitions)
            print("\n".join(covered.rows(f"`identify_{name}`", plant)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
