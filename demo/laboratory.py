"""The three experiments of the paper's table, done with the plant: tilts, releases, curls.

Everything is simulated in the base frame with gravity turned, then placed in the world (z-up).
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from demo.truth import Truth
from trunkline.frames import STANDARD_GRAVITY, wxyz_from_rotation
from trunkline.progress import progress
from trunkline.threads import thread_count

SAMPLE_RATE = 500.0  # Hz, of the truth that the instruments see
BASE_POSITION = (0.35, -0.2, 1.4)  # m, of the mount in the world
LOOSE = 0.3  # m of cable paid out, far more than any bend takes up


@dataclass
class Motors:
    """What winds the cables: it follows commands late and no faster than it can.

    rate_limit: m/s of cable. command_delay: s.
    """

    rate_limit: float
    command_delay: float


@dataclass
class Experiments:
    """The list of trials. Angles in degrees, pulls in mm, times in s, forces in N.

    tilts: each recorded `tilt_repeats` times at rest for `rest_duration`, after a hand has steadied the arm for
    `settle` (all damping `steady_factor` times as large); the mount is set to within `tilt_scatter_deg` about
    both horizontal axes.
    release_directions: azimuths (deg from +x) to which the arm is bent, with a pull of `release_pull` N times one
    of `release_factors` in turn, growing over `bend_duration`; recorded `bend_settle` later for `hold_duration`
    of hold and `release_duration` after letting go.
    curl_levels: pulled by each of `curl_tendons` (lists of tendons pulled together); a cycle is `curl_rest`, a
    ramp of `curl_ramp`, a hold of `curl_hold`, the ramp back and a rest of `curl_hold`.
    validate_every: every n-th trial of each experiment is the validate split.
    """

    tilts: list[float]
    tilt_repeats: int
    tilt_scatter_deg: float
    settle: float
    steady_factor: float
    rest_duration: float
    release_directions: list[float]
    release_pull: float
    release_factors: list[float]
    bend_duration: float
    bend_settle: float
    hold_duration: float
    release_duration: float
    curl_levels: list[float]
    curl_tendons: list[list[int]]
    curl_rest: float
    curl_ramp: float
    curl_hold: float
    validate_every: int


def record(
    plant: mujoco.MjModel,
    motors: Motors,
    experiments: Experiments,
    tendons: int,
    tracked: list[str],
    rng: np.random.Generator,
) -> list[Truth]:
    """Do all experiments.

    Args:
        plant: from `build_plant`.
        tracked: names of the tracked units.
        rng: draws how well the lab sets the tilts.
    """
    truths = _tilts(plant, experiments, tendons, tracked, rng)
    truths += _releases(plant, experiments, tendons, tracked, rng)
    truths += _curls(plant, motors, experiments, tendons, tracked, rng)
    return truths


def split_of(index: int, validate_every: int) -> str:
    """The last of every `validate_every` trials is for validation."""
    return "validate" if index % validate_every == validate_every - 1 else "identify"


def _tilts(plant, experiments, tendons, tracked, rng) -> list[Truth]:
    levels = [level for _ in range(experiments.tilt_repeats) for level in experiments.tilts]
    mounts = [_mount(level, experiments.tilt_scatter_deg, rng) for level in levels]
    steps = round((experiments.settle + experiments.rest_duration) / plant.opt.timestep)
    controls = np.zeros((len(levels), steps, plant.nu))
    controls[:, :, :tendons] = plant.tendon_length0 + LOOSE
    steadied = _simulate("tilts", plant, mounts, controls, experiments.settle, experiments.steady_factor)
    # every repeat leaves out another tilt, so that the validate split holds all of them in turn
    splits = [
        "validate"
        if i // len(experiments.tilts) % experiments.validate_every == i % experiments.validate_every
        else "identify"
        for i in range(len(levels))
    ]
    names = [f"tilt_{level:03.0f}_{chr(97 + i // len(experiments.tilts))}" for i, level in enumerate(levels)]
    return [
        _truth(plant, path, mount, name, "static_tilt", level, split, tracked, skip=experiments.settle)
        for path, mount, name, level, split in zip(steadied, mounts, names, levels, splits, strict=True)
    ]


def _releases(plant, experiments, tendons, tracked, rng) -> list[Truth]:
    step = plant.opt.timestep
    directions = experiments.release_directions
    mounts = [_mount(0.0, 0.0, rng) for _ in directions]
    bend = experiments.bend_duration
    hold = experiments.bend_settle + experiments.hold_duration
    time = np.arange(round((bend + hold + experiments.release_duration) / step)) * step
    strength = np.where(time < bend + hold, np.minimum(time / bend, 1.0), 0.0)
    controls = np.zeros((len(directions), len(time), plant.nu))
    controls[:, :, :tendons] = plant.tendon_length0 + LOOSE
    for index, azimuth in enumerate(directions):
        factor = experiments.release_factors[index % len(experiments.release_factors)]
        pull = experiments.release_pull * factor * _shares(azimuth, tendons)
        controls[index, :, tendons:] = strength[:, None] * pull
    paths = _simulate("releases", plant, mounts, controls)
    return [
        _truth(
            plant,
            path,
            mount,
            f"release_{azimuth:03.0f}",
            "release",
            None,
            split_of(index, experiments.validate_every),
            tracked,
            skip=bend + experiments.bend_settle,
        )
        for index, (path, mount, azimuth) in enumerate(zip(paths, mounts, directions, strict=True))
    ]


def _curls(plant, motors, experiments, tendons, tracked, rng) -> list[Truth]:
    step = plant.opt.timestep
    pulled = [(level, group) for group in experiments.curl_tendons for level in experiments.curl_levels]
    mounts = [_mount(0.0, 0.0, rng) for _ in pulled]
    ends = np.cumsum([0, experiments.curl_rest, experiments.curl_ramp, experiments.curl_hold, experiments.curl_ramp])
    time = np.arange(round((ends[-1] + experiments.curl_hold) / step)) * step
    profile = np.interp(time, ends, [0, 0, 1, 1, 0])
    controls = np.zeros((len(pulled), len(time), plant.nu))
    commands = np.full((len(pulled), len(time), tendons), -LOOSE)
    wound = commands.copy()
    for index, (level, group) in enumerate(pulled):
        for tendon in group:
            commands[index, :, tendon - 1] = profile * level / 1000
            wound[index, :, tendon - 1] = _wind(commands[index, :, tendon - 1], motors, step)
    controls[:, :, :tendons] = plant.tendon_length0 - wound
    paths = _simulate("curls", plant, mounts, controls)
    stride = round(1 / (SAMPLE_RATE * step))
    truths = []
    for index, (level, group) in enumerate(pulled):
        name = f"curl_{'_'.join(map(str, group))}_{level:03.0f}"
        split = split_of(index, experiments.validate_every)
        truth = _truth(plant, paths[index], mounts[index], name, "curl", level, split, tracked)
        truth.tendons = tuple(f"tendon_{k + 1}" for k in range(tendons))
        truth.command_time, truth.commands = time[::stride], commands[index, ::stride]
        truth.tendon_positions = wound[index, ::stride]
        truths.append(truth)
    return truths


def _mount(tilt_deg: float, scatter_deg: float, rng: np.random.Generator) -> Rotation:
    """Rotation world ← base of a mount tilted about +y, with the scatter of the hand that set it."""
    pitch, roll = rng.normal(0, scatter_deg, 2) if scatter_deg else (0.0, 0.0)
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
    batch = Batch(plant, len(mounts), nthread=thread_count())
    gravity = batch.expand("opt.gravity")
    for index, mount in enumerate(mounts):
        gravity[index] = mount.inv().apply([0, 0, -STANDARD_GRAVITY])
    damping = batch.expand("dof_damping")
    damping *= steady_factor
    stride = round(1 / (SAMPLE_RATE * plant.opt.timestep))
    angles = np.empty((len(mounts), controls.shape[1] // stride, plant.nq))
    with progress(angles.shape[1], f"record {label}", "instants") as bar:
        for start in range(angles.shape[1]):
            if start == round(steady * SAMPLE_RATE):
                damping[:] = plant.dof_damping
            angles[:, start] = batch.bind("qpos")
            commanded = controls[:, start * stride : (start + 1) * stride]
            batch.rollout(stride, control=np.ascontiguousarray(commanded), record=())
            bar.update(1)
    return angles


def _truth(plant, angles, mount, name, experiment, level, split, tracked, skip=0.0) -> Truth:
    """The trial as seen from the world, from `skip` seconds on."""
    angles = angles[round(skip * SAMPLE_RATE) :]
    data = mujoco.MjData(plant)
    sites = [plant.site(f"{segment}_center").id for segment in tracked]
    positions = np.empty((len(angles), len(sites), 3))
    matrices = np.empty((len(angles), len(sites), 3, 3))
    for frame, qpos in enumerate(angles):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(plant, data)
        positions[frame], matrices[frame] = data.site_xpos[sites], data.site_xmat[sites].reshape(-1, 3, 3)
    local = Rotation.from_matrix(matrices.reshape(-1, 3, 3))
    return Truth(
        name=name,
        experiment=experiment,
        level=level,
        split=split,
        time=np.arange(len(angles)) / SAMPLE_RATE,
        base_position=np.array(BASE_POSITION),
        base_quaternion=wxyz_from_rotation(mount),
        segments=tuple(tracked),
        positions=BASE_POSITION + mount.apply(positions.reshape(-1, 3)).reshape(positions.shape),
        quaternions=wxyz_from_rotation(mount * local).reshape(*positions.shape[:2], 4),
        tendons=(),
        command_time=np.empty(0),
        commands=np.empty((0, 0)),
        tendon_positions=np.empty((len(angles), 0)),
    )
