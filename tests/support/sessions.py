"""A small made-up session: a flexible pendulum of four markers, tilted, released and curled, in a few seconds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from demo.instruments import InstrumentSettings, Measurement, measure
from demo.recorder import write_log, write_session
from demo.truth import Truth
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.sanity_checks import SanityLimits

MARKERS = ("unit_02", "unit_04", "unit_06", "unit_08")
TENDONS = ("tendon_1", "tendon_2", "tendon_3")
RELEASE, CURL_BEGIN = 0.4, 0.3  # s
RATE = 480.0  # Hz
LIMITS = TrialLimits(duration=0.5, coverage=0.3, disorder=0.1, clock_offset=1.0)
PLAUSIBLE = SanityLimits(still=0.02, distance=0.1, pull=3.0, clock=0.1, otherwise="refuse")


def instruments(**changes) -> InstrumentSettings:
    """Cameras and motors of ordinary quality, with `changes`."""
    ordinary = {
        "frame_rate": 120.0,
        "position_noise_mm": 0.3,
        "orientation_noise_deg": 0.3,
        "occlusions_per_s": 0.05,
        "occlusion_ms": (50.0, 300.0),
        "dropped_frames": 0.005,
        "outliers": 0.0005,
        "outlier_mm": 40.0,
        "outlier_deg": 25.0,
        "stamp_jitter_ms": 1.0,
        "delivery_ms": 3.0,
        "motor_rate": 200.0,
        "tendon_noise_mm": 0.05,
        "clock_offset_s": 0.137,
        "up": (0.0, 1.0, 0.0),
        "heading_deg": 25.0,
        "origin": (0.4, 1.1, -0.3),
        "epoch_s": 1_760_000_000,
        "pause_s": 30.0,
    }
    return InstrumentSettings(**{**ordinary, **changes})


def bent_truth(
    name: str,
    experiment: str,
    level: float | None,
    split: str,
    tilt_deg: float,
    bend: np.ndarray,
    pulls: np.ndarray,
) -> Truth:
    """An arm of 0.4 m whose every part bends by `bend` (T,) rad in all, as a circle in the base's x-z plane."""
    time = np.arange(len(bend)) / RATE
    along = np.linspace(0.1, 0.4, len(MARKERS))  # m from the mount
    angle = bend[:, None] * along / 0.4
    curvature = np.where(np.abs(bend) < 1e-6, 1e-6, bend)[:, None] / 0.4
    local = np.stack([(1 - np.cos(angle)) / curvature, 0 * angle, -np.sin(angle) / curvature], axis=-1)
    local = np.where(
        np.abs(bend[:, None, None]) < 1e-6, np.stack([0 * along, 0 * along, -along], axis=-1), local
    )
    # gravity in the base frame is g (sin tilt, 0, -cos tilt), and (0, 0, -g) in the world
    base = Rotation.from_euler("z", 40, degrees=True) * Rotation.from_euler("y", tilt_deg, degrees=True)
    turns = base * Rotation.from_rotvec(np.stack([0 * angle, -angle, 0 * angle], axis=-1).reshape(-1, 3))
    position = np.array([0.2, -0.1, 1.5])
    return Truth(
        name=name,
        experiment=experiment,
        split=split,
        level=level,
        time=time,
        base_position=position,
        base_quaternion=base.as_quat(scalar_first=True),
        markers=MARKERS,
        positions=base.apply(local.reshape(-1, 3)).reshape(local.shape) + position,
        quaternions=turns.as_quat(scalar_first=True).reshape(*angle.shape, 4),
        tendons=TENDONS if pulls.any() else (),
        command_time=time[::5],
        commands=pulls[::5] if pulls.any() else np.empty((len(time[::5]), 0)),
        tendon_positions=pulls if pulls.any() else np.empty((len(time), 0)),
    )


def static_truth(tilt_deg: float, split: str = "identify") -> Truth:
    """At rest for 1 s, sagging by a third of the tilt."""
    bend = np.full(int(1.0 * RATE), np.deg2rad(tilt_deg) / 3)
    return bent_truth(
        f"tilt_{tilt_deg:02.0f}", "static_tilt", tilt_deg, split, tilt_deg, bend, np.zeros((len(bend), 3))
    )


def release_truth(split: str = "identify") -> Truth:
    """Held bent by 1.5 rad until `RELEASE`, then ringing down at 1.5 Hz."""
    time = np.arange(int(2.5 * RATE)) / RATE
    since = np.clip(time - RELEASE, 0, None)
    omega, decay = 2 * np.pi * 1.5, 1.2
    bend = 1.5 * np.exp(-decay * since) * (np.cos(omega * since) + decay / omega * np.sin(omega * since))
    return bent_truth("release_a", "release", None, split, 0.0, bend, np.zeros((len(bend), 3)))


def curl_truth(level_mm: float = 40.0, split: str = "validate") -> Truth:
    """Tendon 1 pulled by `level_mm` from `CURL_BEGIN` and let out again; the bend follows the pull at once."""
    time = np.arange(int(2.5 * RATE)) / RATE
    phase = np.clip((time - CURL_BEGIN) / 1.8, 0, 1)
    pull = 1e-3 * level_mm * 0.5 * (1 - np.cos(2 * np.pi * phase))
    pulls = np.stack([pull, -pull / 2, -pull / 2], axis=1)
    return bent_truth(f"curl_{level_mm:.0f}", "curl", level_mm, split, 0.0, pull / 0.03, pulls)


def pull_truth(pulls_mm=(40.0, -20.0, -20.0), split: str = "identify", load: float = 0.0) -> Truth:
    """At rest for 1.5 s with tendons held, bent as far as tendon 1 says."""
    rest = 1e-3 * np.tile(pulls_mm, (int(1.5 * RATE), 1))
    name = "pull_" + "_".join(f"{pull:.0f}" for pull in pulls_mm)
    truth = bent_truth(name, "static_pull", None, split, 0.0, rest[:, 0] / 0.03, rest)
    return replace(truth, load=load)


def motion_truth(split: str = "identify", tilt_deg: float = 0.0) -> Truth:
    """Sines of 0.7 and 1.3 Hz from `CURL_BEGIN` on, of a mount that is tilted."""
    time = np.arange(int(4.0 * RATE)) / RATE
    since = 2 * np.pi * np.clip(time - CURL_BEGIN, 0, None)
    pull = 0.015 * (np.sin(0.7 * since) + np.sin(1.3 * since))
    pulls = np.stack([pull, -pull / 2, -pull / 2], axis=1)
    return bent_truth(f"motion_{split}", "motion", None, split, tilt_deg, pull / 0.03, pulls)


def all_truths() -> list[Truth]:
    """Two tilts, a release and a curl."""
    return [static_truth(0.0), static_truth(60.0, "validate"), release_truth(), curl_truth()]


def record(
    folder: Path, truths: list[Truth], settings: InstrumentSettings, seed: int = 0
) -> list[Measurement]:
    """Measure and log `truths` into `folder`, which becomes a session."""
    folder.mkdir(parents=True, exist_ok=True)
    seeds = np.random.SeedSequence(seed).spawn(len(truths))
    measurements = [
        measure(truth, settings, np.random.default_rng(child), index * settings.pause_s)
        for index, (truth, child) in enumerate(zip(truths, seeds, strict=True))
    ]
    for measurement in measurements:
        write_log(folder / f"{measurement.name}.mcap", measurement)
    write_session(folder, measurements, settings)
    return measurements
