"""What the lab's instruments make of the truth: cameras with noise, gaps and a frame of their own, motors with a
clock of their own."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from demo.truth import Truth
from trunkline.recordings.trials.recording import PlannedTrial

BASE = "base"

Milliseconds = Annotated[float, Field(gt=0, le=60_000)]
Coordinate = Annotated[float, Field(ge=-100, le=100)]
Share = Annotated[float, Field(ge=0, lt=1)]


@dataclass
class InstrumentSettings:
    """Every imperfection of the measurement.

    frame_rate: Hz. position_noise_mm, orientation_noise_deg: standard deviation, white, per axis.
    occlusions_per_s: how often a body vanishes. occlusion_ms: for how long, shortest and longest.
    dropped_frames, outliers: share of frames, and of samples. outlier_mm, outlier_deg: how far off.
    stamp_jitter_ms: standard deviation of a frame's stamp. delivery_ms: mean delay until a message is logged.
    motor_rate: Hz of the measured tendon positions. tendon_noise_mm: their standard deviation.
    clock_offset_s: what the motors' clock reads ahead of the cameras'.
    up, heading_deg, origin: the vertical in the cameras' frame, its turn about it, and where the world's origin is (m).
    epoch_s: the cameras' clock at the first trial's begin. pause_s: between trials.
    """

    frame_rate: Annotated[float, Field(ge=1, le=2000)]
    position_noise_mm: Annotated[float, Field(ge=0, le=1000)]
    orientation_noise_deg: Annotated[float, Field(ge=0, le=180)]
    occlusions_per_s: Annotated[float, Field(ge=0, le=1000)]
    occlusion_ms: tuple[Milliseconds, Milliseconds]
    dropped_frames: Share
    outliers: Share
    outlier_mm: Annotated[float, Field(ge=0, le=10000)]
    outlier_deg: Annotated[float, Field(ge=0, le=180)]
    stamp_jitter_ms: Annotated[float, Field(ge=0, le=1000)]
    delivery_ms: Annotated[float, Field(ge=0, le=10000)]
    motor_rate: Annotated[float, Field(ge=1, le=10000)]
    tendon_noise_mm: Annotated[float, Field(ge=0, le=1000)]
    clock_offset_s: Annotated[float, Field(ge=-3600, le=3600)]
    up: tuple[Coordinate, Coordinate, Coordinate]
    heading_deg: Annotated[float, Field(ge=-360, le=360)]
    origin: tuple[Coordinate, Coordinate, Coordinate]
    epoch_s: Annotated[int, Field(ge=1, le=4_000_000_000)]
    pause_s: Annotated[float, Field(gt=0, le=86_400)]


@dataclass(kw_only=True)
class Measurement(PlannedTrial):
    """A trial as the instruments saw it: F frames of B bodies, the base first; K tendons.

    frames (F,): frame numbers. stamps, logged (F,): ns, by the cameras' and by the recorder's clock.
    positions (F, B, 3) m, quaternions (F, B, 4) wxyz: in the cameras' frame, NaN where a body was hidden.
    command_stamps (C,), tendon_stamps (M,): ns on the motors' clock; *_logged: on the recorder's.
    commands (C, K), tendon_positions (M, K): m of pull.
    """

    bodies: tuple[str, ...]
    frames: np.ndarray
    stamps: np.ndarray
    logged: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    tendons: tuple[str, ...]
    command_stamps: np.ndarray
    command_logged: np.ndarray
    commands: np.ndarray
    tendon_stamps: np.ndarray
    tendon_logged: np.ndarray
    tendon_positions: np.ndarray


def rotation_mocap_world(settings: InstrumentSettings) -> Rotation:
    """R_mocap_world: the world's z axis becomes `up`, after a turn by `heading_deg` about it."""
    up = np.array(settings.up) / np.linalg.norm(settings.up)
    axis = np.cross([0, 0, 1], up)
    length = np.linalg.norm(axis)
    angle = np.arctan2(length, up[2])
    axis = axis / length if length > 0 else np.array([1.0, 0, 0])
    return Rotation.from_rotvec(angle * axis) * Rotation.from_euler(
        "z", settings.heading_deg, degrees=True
    )


def measure(
    truth: Truth, settings: InstrumentSettings, rng: np.random.Generator, start_s: float = 0.0
) -> Measurement:
    """Measure one trial that begins `start_s` after the session's epoch."""
    epoch = settings.epoch_s * 1_000_000_000 + round(start_s * 1e9)
    duration = truth.time[-1]
    numbers = np.arange(int(duration * settings.frame_rate) + 1)
    numbers = numbers[rng.random(len(numbers)) >= settings.dropped_frames]
    time = numbers / settings.frame_rate
    positions, quaternions = _in_mocap_frame(truth, time, settings)
    _add_noise(positions, quaternions, settings, rng)
    _add_outliers(positions, quaternions, settings, rng)
    hidden = _occlusions(time, positions.shape[1], settings, rng)
    positions[hidden] = quaternions[hidden] = np.nan

    motor_time = np.arange(int(duration * settings.motor_rate) + 1) / settings.motor_rate
    motor_time = motor_time if len(truth.tendons) else motor_time[:0]
    wound = np.empty((len(motor_time), len(truth.tendons)))
    for k in range(len(truth.tendons)):
        wound[:, k] = np.interp(motor_time, truth.time, truth.tendon_positions[:, k])
    wound += rng.normal(scale=settings.tendon_noise_mm * 1e-3, size=wound.shape)
    jitter = rng.normal(scale=settings.stamp_jitter_ms * 1e-3, size=len(time))
    frame_number = round(start_s * settings.frame_rate)
    return Measurement(  # `_logged` draws: their order is part of a seed's session
        name=truth.name,
        experiment=truth.experiment,
        split=truth.split,
        level=truth.level,
        load=truth.load,
        bodies=(BASE, *truth.markers),
        frames=frame_number + numbers,
        stamps=_nanoseconds(epoch, time + jitter),
        logged=_logged(epoch, time, settings, rng),
        positions=positions,
        quaternions=quaternions,
        tendons=truth.tendons,
        command_stamps=_nanoseconds(epoch, truth.command_time + settings.clock_offset_s),
        command_logged=_logged(epoch, truth.command_time, settings, rng),
        commands=truth.commands,
        tendon_stamps=_nanoseconds(epoch, motor_time + settings.clock_offset_s),
        tendon_logged=_logged(epoch, motor_time, settings, rng),
        tendon_positions=wound,
    )


def _in_mocap_frame(
    truth: Truth, time: np.ndarray, settings: InstrumentSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Exact poses of the base and the markers at `time` (F,): (F, B, 3) and (F, B, 4)."""
    bodies = 1 + len(truth.markers)
    positions = np.empty((len(truth.time), bodies, 3))
    quaternions = np.empty((len(truth.time), bodies, 4))
    positions[:, 0], quaternions[:, 0] = truth.base_position, truth.base_quaternion
    positions[:, 1:], quaternions[:, 1:] = truth.positions, truth.quaternions
    # linear between the truth's instants: within (1/500 s)² / 8 times the acceleration, some 0.03 mm
    row = np.clip(np.searchsorted(truth.time, time, side="right") - 1, 0, len(truth.time) - 2)
    share = ((time - truth.time[row]) / (truth.time[row + 1] - truth.time[row]))[:, None, None]
    position = positions[row] + share * (positions[row + 1] - positions[row])
    sign = np.sign(np.einsum("fbi,fbi->fb", quaternions[row], quaternions[row + 1]))[..., None]
    quaternion = quaternions[row] + share * (sign * quaternions[row + 1] - quaternions[row])
    turn = rotation_mocap_world(settings)
    rotation = turn * Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True)
    position = turn.apply(position.reshape(-1, 3)).reshape(position.shape) + np.array(settings.origin)
    return position, rotation.as_quat(scalar_first=True, canonical=True).reshape(quaternion.shape)


def _add_noise(positions, quaternions, settings: InstrumentSettings, rng: np.random.Generator) -> None:
    positions += rng.normal(scale=settings.position_noise_mm * 1e-3, size=positions.shape)
    turns = rng.normal(scale=np.deg2rad(settings.orientation_noise_deg), size=positions.shape)
    _turn(quaternions, np.ones(positions.shape[:2], bool), turns.reshape(-1, 3))


def _add_outliers(positions, quaternions, settings: InstrumentSettings, rng: np.random.Generator) -> None:
    hit = rng.random(positions.shape[:2]) < settings.outliers
    direction = rng.normal(size=(hit.sum(), 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    reach = rng.uniform(0.5, 1.0, (hit.sum(), 1))
    positions[hit] += settings.outlier_mm * 1e-3 * reach * direction
    _turn(quaternions, hit, np.deg2rad(settings.outlier_deg) * reach * direction)


def _turn(quaternions, where: np.ndarray, rotvecs: np.ndarray) -> None:
    turned = Rotation.from_rotvec(rotvecs) * Rotation.from_quat(quaternions[where], scalar_first=True)
    quaternions[where] = turned.as_quat(scalar_first=True, canonical=True)


def _occlusions(
    time: np.ndarray, bodies: int, settings: InstrumentSettings, rng: np.random.Generator
) -> np.ndarray:
    """(F, B) True where a body is hidden; the gaps begin as a Poisson process, each body on its own."""
    hidden = np.zeros((len(time), bodies), bool)
    for body in range(bodies):
        for begin in rng.uniform(0, time[-1], rng.poisson(settings.occlusions_per_s * time[-1])):
            length = rng.uniform(*settings.occlusion_ms) * 1e-3
            hidden[:, body] |= (time >= begin) & (time < begin + length)
    return hidden


def _nanoseconds(epoch: int, time: np.ndarray) -> np.ndarray:
    return epoch + np.round(time * 1e9).astype(np.int64)


def _logged(
    epoch: int, time: np.ndarray, settings: InstrumentSettings, rng: np.random.Generator
) -> np.ndarray:
    """ns: when messages sent at `time` reach the recorder, in the order in which they were sent."""
    delay = rng.exponential(settings.delivery_ms * 1e-3, size=len(time))
    return (
        np.maximum.accumulate(_nanoseconds(epoch, time + delay)) if len(time) else np.empty(0, np.int64)
    )
