"""The three experiments of the paper's table, done with the plant: tilts, releases, curls.

Everything is simulated in the base frame with gravity turned, then placed in the world (z-up).
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from demo.experiments import Experiments, curl_trials, release_trials, tilt_trials
from demo.truth import Truth
from trunkline.frames import STANDARD_GRAVITY, wxyz_from_rotation
from trunkline.progress import progress
from trunkline.simulation.motion import batch_of, move
from trunkline.trials.recording import Planned
from trunkline.trials.splits import TEST

SAMPLE_RATE = 500.0  # Hz, of the truth that the instruments see
LOOSE = 0.3  # m of cable paid out, far more than any bend takes up


@dataclass
class Motors:
    """What winds the cables: it follows commands late and no faster than it can.

    rate_limit: m/s of cable. command_delay: s.
    """

    rate_limit: Annotated[float, Field(gt=0, le=100)]
    command_delay: Annotated[float, Field(ge=0, le=10)]


def record(
    plant: mujoco.MjModel,
    motors: Motors,
    experiments: Experiments,
    tendons: int,
    tracked: list[str],
    rng: np.random.Generator,
    test_rng: np.random.Generator,
) -> list[Truth]:
    """Do all experiments, those of the test split last.

    Args:
        plant: from `build_plant`; 1 / SAMPLE_RATE is a multiple of its step.
        tendons: how many the plant has.
        tracked: names of the tracked units.
        rng, test_rng: draw how well the lab sets the tilts; the latter for the test split, whose trials therefore
            change no other.
    """

    def done(planned: Experiments, draws: np.random.Generator) -> list[Truth]:
        return [
            *record_tilts(plant, planned, tendons, tracked, draws),
            *record_releases(plant, planned, tendons, tracked),
            *record_curls(plant, motors, planned, tendons, tracked),
        ]

    tested = done(experiments.tested(), test_rng)
    return [*done(experiments, rng), *(replace(truth, split=TEST) for truth in tested)]


def record_tilts(plant, experiments: Experiments, tendons: int, tracked, rng) -> list[Truth]:
    """The arm at rest, its cables loose, under a tilted mount."""
    trials = tilt_trials(experiments)
    mounts = [_mount(trial.level, experiments.tilt_scatter_deg, rng) for trial in trials]
    steps = round((experiments.settle + experiments.rest_duration) / plant.opt.timestep)
    controls = np.zeros((len(trials), steps, plant.nu))
    controls[:, :, :tendons] = plant.tendon_length0 + LOOSE
    paths = _simulate("tilts", plant, mounts, controls, experiments.settle, experiments.steady_factor)
    view = _View(plant, experiments.mount_position, tracked)
    skipped = round(experiments.settle * SAMPLE_RATE)
    return [view.truth(trial, mount, path[skipped:]) for trial, mount, path in zip(trials, mounts, paths, strict=True)]


def record_releases(plant, experiments: Experiments, tendons: int, tracked) -> list[Truth]:
    """The arm bent by hand and let go, its cables loose."""
    step, trials = plant.opt.timestep, release_trials(experiments)
    bend = experiments.bend_duration
    hold = experiments.bend_settle + experiments.hold_duration
    time = np.arange(round((bend + hold + experiments.release_duration) / step)) * step
    strength = np.where(time < bend + hold, np.minimum(time / bend, 1.0), 0.0)
    controls = np.zeros((len(trials), len(time), plant.nu))
    controls[:, :, :tendons] = plant.tendon_length0 + LOOSE
    for index, azimuth in enumerate(experiments.release_directions):
        factor = experiments.release_factors[index % len(experiments.release_factors)]
        pull = experiments.release_pull * factor * _shares(azimuth, tendons)
        controls[index, :, tendons:] = strength[:, None] * pull
    paths = _simulate("releases", plant, [Rotation.identity()] * len(trials), controls)
    view = _View(plant, experiments.mount_position, tracked)
    skipped = round((bend + experiments.bend_settle) * SAMPLE_RATE)
    return [
        view.truth(trial, Rotation.identity(), path[skipped:], experiments.hold_duration)
        for trial, path in zip(trials, paths, strict=True)
    ]


def record_curls(plant, motors: Motors, experiments: Experiments, tendons: int, tracked) -> list[Truth]:
    """The arm curled and uncurled by its motors; the tendons that do not pull are loose."""
    step, trials = plant.opt.timestep, curl_trials(experiments)
    groups = [group for group in experiments.curl_tendons for _ in experiments.curl_levels]
    ends = np.cumsum([0, experiments.curl_rest, experiments.curl_ramp, experiments.curl_hold, experiments.curl_ramp])
    time = np.arange(round((ends[-1] + experiments.curl_hold) / step)) * step
    profile = np.interp(time, ends, [0, 0, 1, 1, 0])
    controls = np.zeros((len(trials), len(time), plant.nu))
    commands = np.full((len(trials), len(time), tendons), -LOOSE)
    wound = commands.copy()
    for index, (trial, group) in enumerate(zip(trials, groups, strict=True)):
        for tendon in group:
            commands[index, :, tendon - 1] = profile * trial.level / 1000
            wound[index, :, tendon - 1] = _wind(commands[index, :, tendon - 1], motors, step)
    controls[:, :, :tendons] = plant.tendon_length0 - wound
    paths = _simulate("curls", plant, [Rotation.identity()] * len(trials), controls)
    stride = round(1 / (SAMPLE_RATE * step))
    view = _View(plant, experiments.mount_position, tracked)
    truths = []
    for index, trial in enumerate(trials):
        truth = view.truth(trial, Rotation.identity(), paths[index], experiments.curl_rest)
        truth.tendons = tuple(f"tendon_{k + 1}" for k in range(tendons))
        sampled = slice(None, len(truth.time) * stride, stride)
        truth.command_time, truth.commands = time[sampled], commands[index, sampled]
        truth.tendon_positions = wound[index, sampled]
        truths.append(truth)
    return truths


def _mount(tilt_deg: float, scatter_deg: float, rng: np.random.Generator) -> Rotation:
    """Rotation world ← base of a mount tilted about +y, with the scatter of the hand that set it."""
    pitch, roll = rng.normal(0, scatter_deg, 2)
    return Rotation.from_euler("YX", [tilt_deg + pitch, roll], degrees=True)


def _shares(azimuth_deg: float, tendons: int) -> np.ndarray:
    """Non-negative pulls whose sum of moments has length 1 and points to the azimuth. Shape (tendons,)."""
    angles = 2 * np.pi * np.arange(tendons) / tendons
    azimuth = np.radians(azimuth_deg)
    return nnls(np.stack([np.cos(angles), np.sin(angles)]), np.array([np.cos(azimuth), np.sin(azimuth)]))[0]


def _wind(command: np.ndarray, motors: Motors, step: float) -> np.ndarray:
    """Cable wound by a motor that follows `command` (T,) late and at a limited rate, in m."""
    delay = round(motors.command_delay / step)
    target = np.concatenate([np.full(delay, command[0]), command])[: len(command)]
    wound = np.empty_like(target)
    position = target[0]
    for i, goal in enumerate(target):
        position += np.clip(goal - position, -motors.rate_limit * step, motors.rate_limit * step)
        wound[i] = position
    return wound


def _simulate(
    label: str,
    plant: mujoco.MjModel,
    mounts: list[Rotation],
    controls: np.ndarray,
    steady: float = 0.0,
    steady_factor: float = 1.0,
) -> np.ndarray:
    """Joint angles (n, T, nq) at SAMPLE_RATE of n trials that start straight and at rest.

    For the first `steady` seconds all damping is `steady_factor` times as large.
    """
    batch = batch_of(plant, len(mounts))
    gravity = batch.expand("opt.gravity")
    for index, mount in enumerate(mounts):
        gravity[index] = mount.inv().apply([0, 0, -STANDARD_GRAVITY])
    damping = batch.expand("dof_damping")
    damping *= steady_factor
    stride = round(1 / (SAMPLE_RATE * plant.opt.timestep))
    instants = controls.shape[1] // stride
    parts = [batch.bind("qpos")[:, None].copy()]
    with progress(instants, f"record {label}", "instants") as bar:
        for start, end in pairwise((0, round(steady * SAMPLE_RATE), instants)):
            if start or not steady:
                damping[:] = plant.dof_damping
            rows = controls[:, start * stride : end * stride]
            if len(rows[0]):
                parts.append(move(batch, rows, ("qpos",), stride, at=stride - 1, moved=bar.update)["qpos"])
    return np.concatenate(parts, axis=1)[:, :instants]


@dataclass
class _View:
    """What there is to see of the plant's `tracked` units, in the world. mount_position: m."""

    plant: mujoco.MjModel
    mount_position: tuple[float, float, float]
    tracked: list[str]

    def truth(self, trial: Planned, mount: Rotation, angles: np.ndarray, begin: float = 0.0) -> Truth:
        """The trial with joint angles (T, nq), under a mount turned by `mount` (world ← base)."""
        data = mujoco.MjData(self.plant)
        sites = [self.plant.site(f"{segment}_center").id for segment in self.tracked]
        positions = np.empty((len(angles), len(sites), 3))
        matrices = np.empty((len(angles), len(sites), 3, 3))
        for frame, qpos in enumerate(angles):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(self.plant, data)
            positions[frame], matrices[frame] = data.site_xpos[sites], data.site_xmat[sites].reshape(-1, 3, 3)
        local = Rotation.from_matrix(matrices.reshape(-1, 3, 3))
        origin = np.array(self.mount_position)
        return Truth(
            **vars(trial),
            time=np.arange(len(angles)) / SAMPLE_RATE,
            base_position=origin,
            base_quaternion=wxyz_from_rotation(mount),
            segments=tuple(self.tracked),
            positions=origin + mount.apply(positions.reshape(-1, 3)).reshape(positions.shape),
            quaternions=wxyz_from_rotation(mount * local).reshape(*positions.shape[:2], 4),
            tendons=(),
            begin=begin,
            command_time=np.empty(0),
            commands=np.empty((0, 0)),
            tendon_positions=np.empty((len(angles), 0)),
        )
