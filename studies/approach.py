"""Does it matter, with friction, how the commands are sent? Tip errors of several ways: Markdown tables.

    python -m studies.approach [--targets N] [--seconds S]

Needs the samples and the calibrated arm of `make demo`. N targets are drawn as for `as_controls` of `train_ik`, those
that take nearly all of a motor's force left out. Their commands are those of the equilibrium without friction, so that
no network is part of it. The arm starts straight, and is driven in MuJoCo by trajectories along the line from the
straight arm's commands to the target's. First with the friction of the model, which creeps; then with friction made as
dry as MuJoCo gets, for an arm that sticks.
"""

import argparse
import contextlib
import copy
import sys
from pathlib import Path

import mujoco
import numpy as np

from trunkline.compute.progress import progress
from trunkline.frames import gravity_in_base
from trunkline.kinematics.dataset.columns import command_columns
from trunkline.kinematics.dataset.samples import read_samples
from trunkline.kinematics.ik.as_controls import NEAR_LIMIT, PULL_SHARE, draw_commands
from trunkline.model.elements import capstan_friction
from trunkline.model.simulation.drive import LOOK, ROW, drive
from trunkline.model.statics.chain import Chain, read_chain
from trunkline.model.statics.equilibria import Equilibrium, actuated
from trunkline.model.statics.hysteresis import friction_band, model_friction
from trunkline.pipeline.inputs import read_model
from upkeep.results import recorded

MODEL = Path("artifacts/identify_control/arm.xml")
SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
AFTER = (2.5, 5.0, 8.0)  # s
GOOD = 1e-3  # m
DRY = 0.9999  # impedance of friction that hardly creeps
OVER = 0.1  # of the pulls
SHAKES, SHAKEN = 3.0, 3.0  # Hz, s


def ramp(seconds: float, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    """Shares of the way from the straight arm's commands to the target's, a row every ROW s, with the least jerk."""
    share = np.linspace(0, 1, round(seconds / ROW) + 1)
    return low + (high - low) * share**3 * (10 - 15 * share + 6 * share**2)


def over_and_back(seconds: float) -> np.ndarray:
    """Half of the time until OVER further than the target, half of it back."""
    return np.concatenate([ramp(seconds / 2, 0, 1 + OVER), ramp(seconds / 2, 1 + OVER, 1)])


def shaken(seconds: float) -> np.ndarray:
    """A ramp, then a sine of OVER that dies away."""
    time = np.arange(0, SHAKEN + ROW, ROW)
    return np.concatenate([ramp(seconds), 1 + OVER * (1 - time / SHAKEN) * np.sin(2 * np.pi * SHAKES * time)])


WAYS: dict[str, np.ndarray] = {  # with shares of the way
    "sent at once": np.ones(1),
    "ramp of 4 s": ramp(4),
    f"{OVER:.0%} further and back, in 4 s": over_and_back(4),
    f"ramp of 2 s, shaken for {SHAKEN:g} s": shaken(2),
    "ramp of 16 s": ramp(16),
    f"{OVER:.0%} further and back, in 16 s": over_and_back(16),
    f"ramp of 16 s, shaken for {SHAKEN:g} s": shaken(16),
}


def targets(chain: Chain, count: int, rng: np.random.Generator) -> tuple[Equilibrium, np.ndarray]:
    """Equilibria without friction, no motor near its limit, and their gravity (N, 3), m/s²."""
    samples = read_samples(SAMPLES, chain.tendons)
    deepest = chain.straight_lengths - samples[command_columns(chain.tendons)].to_numpy().min(axis=0)
    known = samples[["theta_g"]].to_numpy()
    angles, commands = draw_commands(chain, known, PULL_SHARE * deepest, count, rng, True)
    gravity = gravity_in_base(angles[:, 0])
    found = actuated(chain, commands, gravity)
    good = found.converged & (found.tensions < NEAR_LIMIT * chain.max_tension).all(axis=1)
    return found[good], gravity[good]


def dry(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model with friction that creeps as little as MuJoCo can do at the step of `drive`."""
    model = copy.copy(model)
    model.tendon_solimp_fri[:, :2] = model.dof_solimp[:, :2] = DRY
    model.tendon_solref_fri[:, 0] = model.dof_solref[:, 0] = 1e-3  # MuJoCo takes two time steps for it at least
    return model


def row(name: str, errors: np.ndarray, rested: np.ndarray) -> str:
    """A row of the table, errors (N, F) at every LOOK, m."""
    looks = [round(after / LOOK) - 1 for after in AFTER]
    away = errors > GOOD
    last = np.where(away.any(axis=1), away.shape[1] - np.argmax(away[:, ::-1], axis=1), 0)
    seconds = np.where(away[:, -1], np.inf, LOOK * last)
    half = np.quantile(seconds, 0.5, method="higher")
    cells = [three(errors[:, look]) for look in (*looks, -1)]
    there = f"{half:.1f} s" if np.isfinite(half) else "never"
    return f"| {name} | {' | '.join(cells)} | {there} | {np.mean(~away[:, -1]):.0%} | {np.mean(rested):.0%} |"


def three(errors: np.ndarray) -> str:
    median, p95 = np.quantile(errors, (0.5, 0.95)) * 1e3
    return f"{median:.2f} / {p95:.2f} / {errors.max() * 1e3:.1f}"


@recorded("approach")
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=140)
    parser.add_argument("--seconds", type=float, default=30.0)
    arguments = parser.parse_args()
    model = read_model(MODEL)
    chain = read_chain(model).smooth
    rest, gravity = targets(chain, arguments.targets, np.random.default_rng(0))
    band = friction_band(chain, rest.tensions, gravity, *model_friction(model), capstan=capstan_friction(model))
    known = np.isfinite(band.width)
    print(f"{len(rest.position)} targets; a tip error is its median / 95th percentile / maximum over them, in mm")
    pulling = np.linalg.norm(band.loaded - rest.position, axis=1)
    print(f"band of friction, found for {known.sum()}: {three(band.width[known])} wide")
    print(f"its end after pulling: {three(pulling[known])} from the target")
    rows: dict[str, list[str]] = {}
    with contextlib.redirect_stdout(sys.stderr), progress(2 * len(WAYS), "approach", "ways") as bar:
        for title, driven in (("friction of the model", model), ("dry friction", dry(model))):
            rows[title] = []
            for name, shares in WAYS.items():
                sent = chain.straight_lengths + shares[:, None] * (rest.commands[:, None] - chain.straight_lengths)
                found = drive(driven, sent[..., model.actuator_trnid[:, 0]], gravity, arguments.seconds)
                errors = np.linalg.norm(found.tips - rest.position[:, None], axis=2)
                rows[title].append(row(name, errors, found.rested))
                bar.update(1)
    for title, table in rows.items():
        after = " | ".join(f"after {seconds:g} s" for seconds in AFTER)
        print(f"| {title} | {after} | at the end | within 1 mm, median | within 1 mm | rested |")
        print("|---|---:|---:|---:|---:|---:|---:|---:|", *table, sep="\n")


if __name__ == "__main__":
    main()
