"""What one spoilt trial does to a session, and whether it is named: `python -m studies.spoilt`

Needs the trials and models of the demo session (`make demo`). Twenty sessions, each with one trial of those to identify
from spoilt: a start dated early, two labels exchanged, gravity turned, or a hand that swung the arm as it let go (that
trial is simulated by the identified arm, and its start detected as `filter` does). Onsets and swings spoil releases,
the others static tilts; the stage that identifies from them runs at a small size. Errors are mean position and tip
errors on the `validate` trials of that kind, over those of the session without a spoilt trial; beside them what the
loss without weights of trials gets: the minimum at which the same search is before any trial is weighed. A trial counts
as named if it decides too much or is outlying, and what is said to look wrong must be what was spoilt.

A session's row is kept in docs/results/spoilt.csv as soon as it is done; stopped, the study goes on from there. All
twenty take some fifteen minutes of one core. Progress goes to stderr.
"""

import argparse
import contextlib
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.identification.case import STAGES, require_demo, spread
from stages import filter
from studies.rows import Rows, digest
from trunkline.errors import in_one_line
from trunkline.frames import make_continuous
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import identify, values_of, with_parameters
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.problem import Problem
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import set_up
from trunkline.identification.simulate.experiment import Experiment, prepare
from trunkline.identification.simulate.loss import loss_of
from trunkline.identification.uncertainty.trial_diagnostics import suspicions
from trunkline.model.elements import unload_branches
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import TRIALS as FILTERED
from trunkline.pipeline.identify import read_reported
from trunkline.pipeline.inputs import read_spec
from trunkline.recordings.filtering.filter import start_of
from trunkline.recordings.signals.smoothing import low_pass
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import IDENTIFY, VALIDATE
from trunkline.recordings.trials.trial import Trial
from upkeep.results import recorded

SESSIONS = 20
TRIALS, FRAMES = {"identify_stiffness": 20, "identify_damping": 6}, 120  # of a session, of a trial
OPTIMIZER = LeastSquares(starts=5, descents=1, iterations=6, tolerance=1e-2)
PLANT = Path("artifacts/identify_control/arm.xml")
EARLY = 0.08, 0.2  # s
TURNED = np.radians([15, 30])
SWUNG, SWING_FREQUENCY = (0.05, 0.15), (0.5, 1.5)  # m/s of the tip, Hz
NOISE = 3e-4  # m, white, per axis
WITHIN = 1.1  # times the clean session's error
ERRORS = ("position", "tip", "plain_position", "plain_tip")
CLEAN = "none"  # is spoilt in the session that the others are compared with


def early(trial: Trial, rng: np.random.Generator) -> Trial:
    return replace(trial, start=trial.start - rng.uniform(*EARLY))


def exchanged(trial: Trial, rng: np.random.Generator) -> Trial:
    order = np.arange(len(trial.segments))
    first = rng.integers(0, len(order) - 2)
    second = rng.integers(first + 2, len(order))
    order[[first, second]] = second, first
    assert trial.quaternions is not None
    return replace(trial, positions=trial.positions[:, order], quaternions=trial.quaternions[:, order])


def turned(trial: Trial, rng: np.random.Generator) -> Trial:
    turn = rng.choice([-1, 1]) * rng.uniform(*TURNED)
    return replace(trial, gravity=Rotation.from_rotvec([0.0, turn, 0.0]).apply(trial.gravity))


def swung(trial: Trial, rng: np.random.Generator) -> Trial:
    """The same release from a hand that swings the whole arm to and fro, one sine in all joints, and lets go."""
    assert trial.quaternions is not None
    model = read_spec(PLANT).compile()
    start, step = prepare(trial, model, 1), float(trial.time[1] - trial.time[0])
    model.opt.gravity[:], model.opt.timestep = trial.gravity, step / 8
    data, sites = mujoco.MjData(model), [model.site(f"{name}_center").id for name in trial.segments]
    azimuth, phase = rng.uniform(0, 2 * np.pi), rng.uniform(-1, 1)
    speed, rate = rng.uniform(*SWUNG), 2 * np.pi * rng.uniform(*SWING_FREQUENCY)
    arm = len(start.start)
    along, jacobian = np.resize([np.cos(azimuth), np.sin(azimuth)], arm), np.zeros((3, model.nv))
    data.qpos[:arm] = start.start
    mujoco.mj_forward(model, data)
    mujoco.mj_jacSite(model, data, jacobian, None, sites[-1])
    along *= speed / np.linalg.norm(jacobian[:, :arm] @ along)
    settings = load_config(filter.Config, "filter")
    released = int(np.ceil(trial.start / step))
    positions, quaternions = np.empty(trial.positions.shape), np.empty(trial.quaternions.shape)
    for frame, time in enumerate(trial.time):
        if frame <= released:
            since = rate * (time - trial.time[released]) + phase
            data.qpos[:arm], data.qvel[:arm] = start.start + along / rate * np.sin(since), along * np.cos(since)
            unload_branches(model, data.qpos)
            data.ctrl[:] = start.controls[0]
            data.act[:] = start.controls[0][: model.na]
        else:
            mujoco.mj_step(model, data, 8)
        mujoco.mj_kinematics(model, data)
        positions[frame] = data.site_xpos[sites]
        for index, site in enumerate(sites):
            mujoco.mju_mat2Quat(quaternions[frame, index], data.site_xmat[site])
    positions += rng.normal(scale=NOISE, size=positions.shape)
    flat = low_pass(positions.reshape(len(positions), -1), 1 / step, settings.cutoff, settings.order)
    quaternions = np.stack([make_continuous(column) for column in quaternions.transpose(1, 0, 2)], axis=1)
    found = replace(trial, positions=flat.reshape(positions.shape), quaternions=quaternions)
    return replace(found, **start_of(found, EXPERIMENTS["release"], settings))


@dataclass
class Spoil:
    """says: words in what is said of the trial, any of them, if what is wrong with it was found."""

    title: str
    stage: str
    change: Callable[[Trial, np.random.Generator], Trial]
    says: tuple[str, ...]

    def is_told(self, said: str) -> bool:
        return any(words in said for words in self.says)


SPOILS = (
    Spoil("start dated early", "identify_damping", early, ("later fits better",)),
    Spoil("labels exchanged", "identify_stiffness", exchanged, ("look exchanged",)),
    Spoil("gravity turned", "identify_stiffness", turned, ("gravity turned", "gravity in its base frame")),
    Spoil("swinging start", "identify_damping", swung, ("in motion", "when it is let go")),
)


@dataclass
class Found:
    """Mean errors on the validate trials, mm: position and tip, and both without weights of trials. told: what is said
    of each trial that decides too much."""

    position: float
    tip: float
    plain_position: float
    plain_tip: float
    told: dict[str, list[str]]


@dataclass
class Best:
    """The best candidate of a search so far. weighed: whether trials have been weighed since."""

    loss: float = np.inf
    vector: np.ndarray | None = None
    weighed: bool = False


@dataclass
class PlainFit(Fit):
    """Keeps where least squares on whole trials, the last problem that `identify` sets, ends before trials are weighed.
    A fit whose loss has no weights of trials ends there."""

    plain: Best = field(default_factory=Best)

    def problem(self, model: mujoco.MjModel, experiments: list[Experiment], step_factor: float = 1.0) -> Problem:
        problem, best = super().problem(model, experiments, step_factor), Best()
        residuals = problem.residuals

        def noted(vectors: np.ndarray, near: np.ndarray | None = None, rough: bool = False) -> list[np.ndarray]:
            blocks = residuals(vectors, near, rough)
            best.weighed |= bool((problem.trial_weights != 1).any())
            loss = float(sum(loss_of(block)[0] for block in blocks))
            if len(vectors) == 1 and not best.weighed and loss < best.loss:  # others are tried around an iterate
                best.loss, best.vector = loss, vectors[0].copy()
            return blocks

        problem.residuals, self.plain = noted, best
        return problem


def settings_of(stage: str) -> IdentificationSettings:
    config = load_config(import_module(f"stages.{stage}").Config, stage)
    frames = min(config.frames, FRAMES)
    rough = replace(config.rough, step_factor=1.0, frames=min(config.rough.frames, FRAMES // 2))
    return replace(config, frames=frames, rough=rough, optimizer=OPTIMIZER, per_joint=[])


def found(stage: str, trials: list[Trial]) -> Found:
    """What the stage makes of a session."""
    model, experiments, fit = set_up(settings_of(stage), trials, read_spec(STAGES[stage]).compile())
    fit = PlainFit(**vars(fit))
    with contextlib.redirect_stdout(sys.stderr):
        result = identify(stage, model, experiments, fit)
    identified, told = result.models["identified"], result.influence.deciding()
    for trial, experiment in zip(trials, experiments, strict=True):
        if trial.name in told:
            told[trial.name] += suspicions(trial, experiment, experiments, identified, fit)
    assert fit.plain.vector is not None, "a search begins without weights"
    plain = with_parameters(model, values_of(fit.parameters, fit.plain.vector), rest=fit.rest)
    return Found(*errors_of(identified, experiments, fit), *errors_of(plain, experiments, fit), told)


def errors_of(model: mujoco.MjModel, experiments: list[Experiment], fit: Fit) -> tuple[float, float]:
    """Mean position and tip error on the validate trials, mm."""
    unseen = [e for e in experiments if e.split == VALIDATE]
    errors = scores(replay(model, unseen, fit.segments), unseen)[VALIDATE]
    return errors["e_position_mm"], errors["e_tip_mm"]


def sessions(count: int) -> list[tuple[Spoil, int]]:
    return [(SPOILS[seed % len(SPOILS)], seed) for seed in range(count)]


def clean_trials(stage: str) -> list[Trial]:
    """Of the demo session, those to identify from, as many as the study takes, and all of `validate`."""
    config = settings_of(stage)
    read = [t for t in read_reported(config) if t.experiment in config.experiments]
    return spread([t for t in read if t.split == IDENTIFY], TRIALS[stage]) + [t for t in read if t.split == VALIDATE]


def clean_row(stage: str) -> dict[str, float | str]:
    """Of a session without a spoilt trial. said: of the trials that are named all the same."""
    clean = found(stage, clean_trials(stage))
    said = [f"{name}: {'; '.join(told) or 'named'}" for name, told in clean.told.items()]
    return {"stage": stage, "spoilt": CLEAN, "trial": "", **errors_in(clean), "others": len(said),
            "said": " / ".join(said)}  # fmt: skip


def spoilt_row(spoil: Spoil, seed: int) -> dict[str, float | str]:
    """Of a session with a spoilt trial. said: of that one. others: how many others are named."""
    session, rng = clean_trials(spoil.stage), np.random.default_rng(seed)
    chosen = [i for i, t in enumerate(session) if t.split == IDENTIFY and (t.level is None or t.level > 20)]
    index = int(rng.choice(chosen))
    session[index] = spoilt = spoil.change(session[index], rng)
    result = found(spoil.stage, session)
    said = result.told.get(spoilt.name, []) + ["in motion at its start"] * spoilt.in_motion
    others = len(set(result.told) - {spoilt.name})
    return {"stage": spoil.stage, "spoilt": spoil.title, "trial": spoilt.name, **errors_in(result), "others": others,
            "said": "; ".join(said)}  # fmt: skip


def errors_in(found: Found) -> dict[str, float | str]:
    return {name: getattr(found, name) for name in ERRORS}


def report(rows: dict[str, dict], seeds: list[str]) -> None:
    """The table of the spoilt sessions beside those without."""
    clean = {row["stage"]: row for row in rows.values() if row["spoilt"] == CLEAN}
    for stage, row in clean.items():
        errors = f"position {row['position']:.3f} mm, tip {row['tip']:.3f} mm"
        print(f"{stage} without a spoilt trial: {errors}; named: {row['said'] or 'none'}")
    heads = ["session", "spoilt", "trial", "position", "tip", "without weights: position", "tip", "named"]
    print(f"| {' | '.join([*heads, 'found wrong', 'others named', 'said'])} |")
    print("|---:|---|---|---:|---:|---:|---:|---|---|---:|---|")
    shown = [rows[seed] for seed in seeds]
    ratios = np.array([[row[name] / clean[row["stage"]][name.removeprefix("plain_")] for name in ERRORS]
                       for row in shown])  # fmt: skip
    named = ["yes" if row["said"] else "no" for row in shown]
    by_title = {spoil.title: spoil for spoil in SPOILS}
    right = ["yes" if by_title[row["spoilt"]].is_told(row["said"]) else "no" for row in shown]
    for seed, row, ratio, *told in zip(seeds, shown, ratios, named, right, strict=True):
        cells = [seed, row["spoilt"], row["trial"], *(f"{value:.3f}" for value in ratio), *told]
        print("| " + " | ".join([*cells, str(row["others"]), row["said"]]) + " |")
    within = (ratios[:, :2] <= WITHIN).sum(axis=0)
    near = f"{within[0]} by position and {within[1]} by tip of {len(shown)}"
    print(f"within 10 % of the clean session: {near}; named: {named.count('yes')}; rightly: {right.count('yes')}")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.spoilt", description=__doc__)
    parser.add_argument("--sessions", type=int, default=SESSIONS)
    arguments = parser.parse_args()
    models = dict.fromkeys([*STAGES.values(), PLANT])
    for model in models:
        require_demo(model)
    settings = [settings_of(stage) for stage in TRIALS]
    told = [*settings, load_config(filter.Config, "filter"), TRIALS, TURNED, EARLY, SWUNG, SWING_FREQUENCY, NOISE]
    table = Rows("spoilt", digest(told, *models, FILTERED), "session")
    work = {stage: partial(clean_row, stage) for stage in TRIALS}
    work |= {str(seed): partial(spoilt_row, spoil, seed) for spoil, seed in sessions(arguments.sessions)}
    with recorded("spoilt", keep=arguments.sessions == SESSIONS, origin=table.origin):
        done = table.read()
        for key in [key for key in work if key not in done]:
            table.add(key, **work[key]())
        rows = {key: row for key, row in table.read().items() if key in work}
        report(rows, [key for key in work if key not in TRIALS])
        if line := table.attempts():
            print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
