"""What one spoilt trial does to a session, and whether it is named: `python -m studies.spoilt`

Needs the trials and models of the demo session (`make demo`). Twenty sessions, each with one trial of those to identify
from spoilt: a start dated early, two labels exchanged, gravity turned, or a hand that swung the arm as it let go (that
trial is simulated by the identified arm, and its start detected as `filter` does). Onsets and swings spoil releases,
the others static tilts; the stage that identifies from them runs at a small size. Errors are mean position and tip
errors on the `validate` trials of that kind, over those of the session without a spoilt trial; beside them what the
loss without weights of trials gets. A trial counts as named if it decides too much or is outlying, and what is said to
look wrong must be what was spoilt. Progress goes to stderr.
"""

import argparse
import contextlib
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.identification.case import STAGES, require_demo, spread
from stages import filter
from trunkline.elements import give_way
from trunkline.errors import in_one_line
from trunkline.filtering.filter import start_of
from trunkline.frames import make_continuous
from trunkline.identification.evaluation import replay, scores
from trunkline.identification.experiment import prepare
from trunkline.identification.identify import identify
from trunkline.identification.optimizers import LeastSquares
from trunkline.identification.settings import IdentificationSettings
from trunkline.identification.setup import set_up
from trunkline.identification.suspicion import suspicions
from trunkline.pipeline.config import load_config
from trunkline.pipeline.identify import CAD_MODEL, read_reported
from trunkline.pipeline.inputs import read_spec
from trunkline.pipeline.results import recorded
from trunkline.signals.smoothing import low_pass
from trunkline.trials.experiments import EXPERIMENTS
from trunkline.trials.splits import IDENTIFY, VALIDATE
from trunkline.trials.trial import Trial

SESSIONS = 20
TRIALS, FRAMES = {"identify_stiffness": 20, "identify_damping": 6}, 120  # of a session, of a trial
OPTIMIZER = LeastSquares(starts=5, descents=1, iterations=6, tolerance=1e-2)
PLANT = Path("artifacts/identify_control/arm.xml")
EARLY = 0.08, 0.2  # s
TURNED = np.radians([15, 30])
SWUNG, SWING_FREQUENCY = (0.05, 0.15), (0.5, 1.5)  # m/s of the tip, Hz
NOISE = 3e-4  # m, white, per axis
WITHIN = 1.1  # times the clean session's error
NEVER = 1e9  # times the usual loss, from which on a trial counts less


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
            give_way(model, data.qpos)
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
    """says: in what is printed of the trial, if what is wrong with it was found."""

    title: str
    stage: str
    change: Callable[[Trial, np.random.Generator], Trial]
    says: str


SPOILS = (
    Spoil("start dated early", "identify_damping", early, "later fits better"),
    Spoil("labels exchanged", "identify_stiffness", exchanged, "look exchanged"),
    Spoil("gravity turned", "identify_stiffness", turned, "gravity"),
    Spoil("swinging start", "identify_damping", swung, "in motion"),
)


@dataclass
class Found:
    """position, tip: errors on the validate trials, mm. told: what is said of each trial that decides too much.
    parameters: values."""

    position: float
    tip: float
    told: dict[str, list[str]]
    parameters: dict[str, float]

    def over(self, clean: "Found") -> np.ndarray:
        """Both errors over those of the clean session. Shape (2,)."""
        return np.array([self.position / clean.position, self.tip / clean.tip])


def settings_of(stage: str, outlying: float | None = None) -> IdentificationSettings:
    config = load_config(import_module(f"stages.{stage}").Config, stage)
    loss = config.loss if outlying is None else replace(config.loss, outlying=outlying)
    frames = min(config.frames, FRAMES)
    rough = replace(config.rough, frames=min(config.rough.frames, FRAMES // 2))
    return replace(config, loss=loss, frames=frames, rough=rough, optimizer=OPTIMIZER, per_joint=[])


def found(stage: str, trials: list[Trial], outlying: float | None = None) -> Found:
    """What the stage makes of a session."""
    config = settings_of(stage, outlying)
    model, experiments, fit = set_up(config, trials, read_spec(STAGES[stage]).compile())
    with contextlib.redirect_stdout(sys.stderr):
        result = identify(stage, model, experiments, fit)
    identified, told = result.models["identified"], result.influence.deciding()
    for trial, experiment in zip(trials, experiments, strict=True):
        if trial.name in told:
            told[trial.name] += suspicions(trial, experiment, experiments, identified, fit)
    errors = scores(replay(identified, experiments, fit.segments), experiments)
    return Found(errors[VALIDATE]["e_position_mm"], errors[VALIDATE]["e_tip_mm"], told, result.values)


def sessions(count: int) -> list[tuple[Spoil, int]]:
    return [(SPOILS[seed % len(SPOILS)], seed) for seed in range(count)]


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.spoilt", description=__doc__)
    parser.add_argument("--sessions", type=int, default=SESSIONS)
    arguments = parser.parse_args()
    for model in (CAD_MODEL, *STAGES.values(), PLANT):
        require_demo(model)
    with recorded("spoilt", keep=arguments.sessions == SESSIONS):
        clean: dict[str, tuple[list[Trial], Found]] = {}
        for stage, count in TRIALS.items():
            config = settings_of(stage)
            read = [t for t in read_reported(config) if t.experiment in config.experiments]
            seen = spread([t for t in read if t.split == IDENTIFY], count)
            trials = seen + [t for t in read if t.split == VALIDATE]
            clean[stage] = trials, found(stage, trials)
            own = clean[stage][1]
            errors = f"position {own.position:.3f} mm, tip {own.tip:.3f} mm"
            print(f"{stage} without a spoilt trial: {errors}; named: {own.told or 'none'}", flush=True)
        heads = ["session", "spoilt", "trial", "position", "tip", "without weights: position", "tip", "named"]
        print(f"| {' | '.join([*heads, 'found wrong', 'others named', 'said'])} |")
        print("|---:|---|---|---:|---:|---:|---:|---|---|---:|---|", flush=True)
        within, named, right = np.zeros(2, dtype=int), 0, 0
        for spoil, seed in sessions(arguments.sessions):
            trials, reference = clean[spoil.stage]
            rng = np.random.default_rng(seed)
            chosen = [i for i, t in enumerate(trials) if t.split == IDENTIFY and (t.level is None or t.level > 20)]
            index = int(rng.choice(chosen))
            session = list(trials)
            session[index] = spoil.change(trials[index], rng)
            robust, plain = found(spoil.stage, session), found(spoil.stage, session, NEVER)
            name = session[index].name
            said = robust.told.get(name, []) + ["in motion at its start"] * session[index].in_motion
            ratios = robust.over(reference)
            within, named = within + (ratios <= WITHIN), named + bool(said)
            is_right = any(spoil.says in sentence for sentence in said)
            right += is_right
            cells = [spoil.title, name, *(f"{ratio:.3f}" for ratio in (*ratios, *plain.over(reference)))]
            cells += ["yes" if true else "no" for true in (said, is_right)]
            cells += [str(len(set(robust.told) - {name})), "; ".join(said)]
            print(f"| {seed} | " + " | ".join(cells) + " |", flush=True)
        near = f"{within[0]} by position and {within[1]} by tip of {arguments.sessions}"
        print(f"within 10 % of the clean session: {near}; named: {named}; rightly: {right}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
