"""How well each loss brings known parameters back from noisy releases: a Markdown table.

    python -m studies.losses [--repetitions N] [--trials N] [--frames N] [--weight-velocity W]

Needs the demo session up to `identify_damping` (`make demo`). The plant is the arm that this stage identified, let go
from where the session's own releases start; the laboratory's noise comes on top, low-passed as `filter` does, over the
pose from which a simulation starts, too. Both losses see the same trials, and search from the same place near the
truth for the same parameters. Bias and scatter (standard deviation) are of ln(value). Progress goes to stderr.
"""

import argparse
import contextlib
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from omegaconf import OmegaConf
from scipy.spatial.transform import Rotation

from benchmarks.identification.case import STAGES, Case, Size, read_case, require_demo
from stages.filter import Config as FilterConfig
from trunkline.compute.progress import progress
from trunkline.errors import in_one_line
from trunkline.frames import wxyz_from_rotation
from trunkline.identification.evaluation.evaluation import replay
from trunkline.identification.fit.certainty import certainty
from trunkline.identification.fit.search import descend
from trunkline.identification.fit.surrogate import surrogate
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.loss import RESIDUALS
from trunkline.identification.simulate.pose_fit import PoseFit, fit_pose
from trunkline.pipeline.config import load_config
from trunkline.pipeline.inputs import read_spec
from trunkline.recordings.signals.smoothing import low_pass
from upkeep.results import recorded

STAGE = "identify_damping"
PLANT = Path("artifacts") / STAGE / "arm.xml"
LABORATORY = Path("demo/conf/record/config.yaml")
MARGIN = 30  # frames, beyond which the low-pass's ends are not felt
PERTURBATION = 0.05  # of ln(value), standard deviation of where the searches start
ITERATIONS, TOLERANCE = 15, 1e-6  # of the least squares, which ends long before


@dataclass
class Noise:
    """position: m, angle: rad, standard deviations, white, per axis. rate: Hz of the frames. cutoff: Hz and order:
    of the low-pass that follows."""

    position: float
    angle: float
    rate: float
    cutoff: float
    order: int

    def draw(self, deviation: float, frames: int, segments: int, rng: np.random.Generator) -> np.ndarray:
        """Low-passed noise (frames, segments, 3)."""
        white = rng.normal(0, deviation, (frames + 2 * MARGIN, 3 * segments))
        smooth = low_pass(white, self.rate, self.cutoff, self.order)[MARGIN:-MARGIN]
        return smooth.reshape(frames, segments, 3)


@dataclass
class Recovered:
    """Errors of ln(value), half widths of their 95 % intervals, each (repetitions, P), and searches that converged."""

    errors: np.ndarray
    widths: np.ndarray
    converged: int


def read_noise() -> Noise:
    """The laboratory's noise and the pipeline's filter."""
    instruments = OmegaConf.load(LABORATORY).instruments
    config = load_config(FilterConfig, "filter")
    angle = np.radians(instruments.orientation_noise_deg)
    return Noise(instruments.position_noise_mm * 1e-3, angle, config.rate, config.cutoff, config.order)


def played(plant: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> list[Experiment]:
    """The experiments as the plant would have made them, without noise and without gaps, each with its start's fit."""
    replayed = replay(plant, experiments, segments)
    still = np.zeros((len(segments), 3))
    return [
        replace(
            experiment,
            positions=positions,
            measured=np.ones(positions.shape[:2], bool),
            fit=fitted_start(experiment, plant, segments, still, still),
        )
        for experiment, positions in zip(experiments, replayed.positions, strict=True)
    ]


def noisy(
    clean: Experiment, model: mujoco.MjModel, segments: tuple[str, ...], noise: Noise, rng: np.random.Generator
) -> Experiment:
    """An experiment as cameras and filter see it.

    The first frame of noise is on the pose at the start, which moves by as much as its fit does. That the fit smooths
    a pose, noise or not, is left out: it would bias both losses alike.
    """
    shifts = noise.draw(noise.position, 1 + clean.frames, len(segments), rng)
    turns = noise.draw(noise.angle, 1 + clean.frames, len(segments), rng)
    fit = fitted_start(clean, model, segments, shifts[0], turns[0])
    start = clean.start + fit.qpos - clean.fit.qpos
    return replace(clean, start=start, positions=clean.positions + shifts[1:])


def fitted_start(experiment: Experiment, model: mujoco.MjModel, segments, shifts, turns) -> PoseFit:
    """The fit to an experiment's start, of which every segment is seen off by `shifts`, m, and `turns`, rad (S, 3)."""
    data = mujoco.MjData(model)
    data.qpos[: len(experiment.start)] = experiment.start
    mujoco.mj_kinematics(model, data)
    sites = [model.site(f"{name}_center").id for name in segments]
    rotation = Rotation.from_rotvec(turns) * Rotation.from_matrix(data.site_xmat[sites].reshape(-1, 3, 3))
    return fit_pose(model, segments, data.site_xpos[sites] + shifts, wxyz_from_rotation(rotation))


def recover(case: Case, plant: mujoco.MjModel, noise: Noise, repetitions: int, seed: int = 1) -> dict[str, Recovered]:
    """Identify the plant's parameters with every loss from the same noisy trials, again and again."""
    exact = np.array([PARAMETERS[name].coordinate(PARAMETERS[name].read(plant)) for name in case.fit.parameters])
    clean = played(plant, case.experiments, case.fit.segments)
    rng = np.random.default_rng(seed)
    rows: dict[str, list] = {loss: [] for loss in RESIDUALS}
    with progress(repetitions * len(RESIDUALS), "losses", "searches") as bar:
        for _ in range(repetitions):
            trials = [noisy(experiment, case.model, case.fit.segments, noise, rng) for experiment in clean]
            start = exact + rng.normal(0, PERTURBATION, len(exact))
            for loss, table in rows.items():
                problem = replace(case.fit, loss=loss).problem(case.model, trials)
                found = descend(problem, start, ITERATIONS, TOLERANCE, lambda best: None)
                assert found.linear is not None
                width = certainty(found.linear, moves=surrogate(problem, found.vector).moves).half_width
                table.append((found.vector - exact, width, found.converged))
                bar.update(1)
    return {
        loss: Recovered(
            np.array([row[0] for row in table]), np.array([row[1] for row in table]), sum(row[2] for row in table)
        )
        for loss, table in rows.items()
    }


def table(names: list[str], results: dict[str, Recovered]) -> str:
    """A line a parameter: bias and scatter in per cent, and how many intervals hold the truth, by loss."""
    heads = [f"{loss}: {what}" for loss in results for what in ("bias", "scatter", "inside 95 %")]
    lines = ["| parameter | " + " | ".join(heads) + " |", "|---|" + "---:|" * len(heads)]
    for index, name in enumerate(names):
        cells = []
        for found in results.values():
            errors, inside = found.errors[:, index], np.abs(found.errors[:, index]) < found.widths[:, index]
            cells += [f"{100 * errors.mean():+.2f} %", f"{100 * errors.std(ddof=1):.2f} %"]
            cells += [f"{inside.sum()} of {len(inside)}"]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.losses", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=20, help="with noise drawn anew, at least 2")
    parser.add_argument("--trials", type=int, default=6, help="releases of the session, at most")
    parser.add_argument("--frames", type=int, default=180, help="of each release")
    parser.add_argument("--weight-velocity", type=float, help="of the velocity term, in place of the configured one")
    arguments = parser.parse_args()
    for model in (STAGES[STAGE], PLANT):
        require_demo(model)
    case = read_case(STAGE, Size(trials=arguments.trials, frames=arguments.frames))
    if arguments.weight_velocity is not None:
        weights = replace(case.fit.weights, weight_velocity=arguments.weight_velocity)
        case = replace(case, fit=replace(case.fit, weights=weights))
    with recorded("losses", keep=len(sys.argv) == 1):
        with contextlib.redirect_stdout(sys.stderr):
            results = recover(case, read_spec(PLANT).compile(), read_noise(), arguments.repetitions)
        print(table(list(case.fit.parameters), results))
    for loss, found in results.items():
        print(f"{loss}: {found.converged} of {arguments.repetitions} searches converged", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
