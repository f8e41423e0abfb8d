"""A raw trial becomes a trial: outliers out, gaps bridged, one uniform clock, filtered, in the base frame."""

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field
from scipy.ndimage import binary_dilation

from trunkline.errors import InputError
from trunkline.frames import make_continuous, tilt_of_gravity
from trunkline.recordings.filtering.approach import approach_of
from trunkline.recordings.filtering.effect import Effect
from trunkline.recordings.signals.base_frame import BasePose, average_base, gravity_from_up, to_base_frame
from trunkline.recordings.signals.smoothing import bridged, fill_gaps, low_pass, outliers, resample
from trunkline.recordings.trials.experiments import EXPERIMENTS, ExperimentKind, is_held
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.recording import PlannedTrial
from trunkline.recordings.trials.trial import Trial

ASIDE, ASIDE_LEAST = 0.5, 5e-3  # share of how far samples go, and m, by which filtered ones may be beside them


@dataclass
class Filter:
    """rate: Hz of the uniform clock. cutoff: Hz, order: of the Butterworth low-pass.

    longest_bridge: s, longer gaps are filled and marked as not measured.
    outlier_deviations: see `smoothing.outliers`.
    release: where a release starts: at its "onset", or once the arm is "free" and moves already, see `start`.
    """

    rate: Annotated[float, Field(ge=1, le=2000)]
    cutoff: Annotated[float, Field(gt=0, le=1000)]
    order: Annotated[int, Field(ge=1, le=10)]
    longest_bridge: Annotated[float, Field(ge=0, le=2)]
    outlier_deviations: Annotated[float, Field(ge=1, le=1000)]
    release: Literal["onset", "free"]

    def __post_init__(self):
        if self.cutoff >= self.rate / 2:
            raise ValueError(f"cutoff: found {self.cutoff} Hz, expected less than half the rate of {self.rate} Hz")


def filter_raw_trial(raw: RawTrial, settings: Filter) -> tuple[Trial, Effect]:
    """Filter one raw trial.

    Quaternions are filtered by component and normalised again: they are continuous in sign, and within the
    bandwidth of the filter the arm turns by little, so that this differs from the sphere in second order.

    Raises:
        InputError: if a marker has too few good samples.
    """
    base = average_base(raw.base_positions, raw.base_quaternions)
    positions, quaternions = to_base_frame(base, raw.positions, raw.quaternions)
    kind, motion = EXPERIMENTS[raw.experiment], None
    if kind.stepwise:
        return _settled(raw, positions, quaternions, base)
    grid = np.arange(int(raw.time[-1] * settings.rate) + 1) / settings.rate
    frames, count = len(grid), len(raw.markers)
    width = 3 if quaternions is None else 7
    columns, measured = np.empty((frames, count, width)), np.empty((frames, count), bool)
    filled, dropped, removed = 0, 0, []
    for index, name in enumerate(raw.markers):
        samples = positions[:, index]
        if quaternions is not None:
            samples = np.hstack([samples, quaternions[:, index]])
        filtered = _marker(raw.time, samples, grid, settings, f"trial {raw.name}: {name!r}")
        columns[:, index], measured[:, index] = filtered.columns, filtered.measured
        filled, dropped = filled + filtered.filled, dropped + filtered.dropped
        removed.append(filtered.removed)
    noise = np.sqrt(np.mean(removed, axis=0))
    if width == 7:
        columns[..., 3:] /= np.linalg.norm(columns[..., 3:], axis=-1, keepdims=True)

    commands, wound = _on_pose_clock(raw, grid)
    gravity = gravity_from_up(base, raw.up)
    quaternions = None if quaternions is None else columns[..., 3:]
    trial = _trial(raw, gravity, grid, columns[..., :3], quaternions, measured, commands, wound)
    if kind.static:
        motion = float(np.sqrt(np.mean(np.var(trial.positions, axis=0))))
        trial = average_static(trial)
        if is_held(raw.experiment):
            trial.approach = approach_of(raw)
    trial = replace(trial, **start_of(trial, kind, settings))
    effect = Effect(
        samples=frames * count,
        gap_share=1 - float(measured.mean()),
        filled_share=filled / (frames * count),
        outliers=dropped,
        position_noise=float(np.sqrt(np.mean(noise[:3] ** 2))),
        # half an angle is in the vector part; of its square mean, four components see what three axes bring
        angle_noise=None if width == 3 else float(2 * np.sqrt(np.sum(noise[3:] ** 2) / 3)),
        tilt=tilt_of_gravity(gravity),
        motion=motion,
        base_shift=base.shift,
        base_turn=base.turn,
    )
    return trial, effect


def _trial(
    raw: RawTrial, gravity: np.ndarray, time: np.ndarray, positions: np.ndarray, quaternions: np.ndarray | None,
    measured: np.ndarray, commands: np.ndarray, wound: np.ndarray,
) -> Trial:  # fmt: skip
    """What the raw trial was planned as, with these samples, shapes as in `Trial`."""
    return Trial(
        **{field.name: getattr(raw, field.name) for field in fields(PlannedTrial)},
        gravity=gravity,
        time=time,
        markers=raw.markers,
        positions=positions,
        quaternions=quaternions,
        measured=measured,
        tendons=raw.tendons,
        commands=commands,
        tendon_positions=wound,
        command_unit=raw.command_unit,
        repairs=raw.repairs,
    )


def start_of(trial: Trial, kind: ExperimentKind, settings: Filter) -> dict:
    """When a trial that went through the low-pass begins: its start and start_sigma, s, in_motion and swaying."""
    if kind.start is None:
        return {}
    smooth = partial(low_pass, rate=1 / (trial.time[1] - trial.time[0]), cutoff=settings.cutoff, order=settings.order)
    begun = kind.start(trial, smooth)
    fields = {"start": begun.time, "start_sigma": begun.sigma, "in_motion": begun.in_motion, "swaying": begun.swaying}
    if kind.free is not None and settings.release == "free":
        fields |= {"start": kind.free(trial, begun.time), "in_motion": True, "swaying": False}
    return fields


def _settled(
    raw: RawTrial, positions: np.ndarray, quaternions: np.ndarray | None, base: BasePose
) -> tuple[Trial, Effect]:
    """A trial whose every frame is a shape at rest of its own: nothing to filter, and no clock but the frames' own."""
    columns = positions if quaternions is None else np.concatenate([positions, quaternions], axis=2)
    measured = np.isfinite(columns[..., 0]) & np.isfinite(columns[..., -1])
    commands, wound = _on_pose_clock(raw, raw.time)
    trial = _trial(raw, gravity_from_up(base, raw.up), raw.time, positions, quaternions, measured, commands, wound)
    effect = Effect(
        samples=measured.size, gap_share=1 - float(measured.mean()), filled_share=0.0, outliers=0, position_noise=0.0,
        angle_noise=None, tilt=tilt_of_gravity(trial.gravity), motion=0.0, base_shift=base.shift, base_turn=base.turn,
    )  # fmt: skip
    return trial, effect


class _Marker(NamedTuple):
    """columns (G, C), filtered, and measured (G,), where they may be trusted. filled, dropped: samples on the uniform
    clock between others that are further apart, and outliers. removed: mean square of what the filter took. (C,)."""

    columns: np.ndarray
    measured: np.ndarray
    filled: int
    dropped: int
    removed: np.ndarray


def _marker(time: np.ndarray, samples: np.ndarray, grid: np.ndarray, settings: Filter, where: str) -> _Marker:
    """Filter one marker's samples (T, 3) or (T, 7), position and quaternion, NaN where unseen, onto `grid` (G,)."""
    oriented = samples.shape[1] == 7
    good = np.isfinite(samples).all(axis=1)
    time, samples = time[good], samples[good]
    if oriented:
        samples[:, 3:] = make_continuous(samples[:, 3:])
    inliers = ~outliers(time, samples[:, :3], settings.outlier_deviations)
    if oriented:
        inliers &= ~outliers(time, samples[:, 3:], settings.outlier_deviations)
    time, samples = time[inliers], samples[inliers]
    if len(time) < 2 * settings.order:
        raise InputError(f"{where}: found {len(time)} good samples, expected more")
    smooth = low_pass(resample(time, samples, grid), settings.rate, settings.cutoff, settings.order)
    # the low-pass carries what fills a gap some frames beyond its edges
    reach = round(settings.rate / settings.cutoff / 2)
    measured = ~binary_dilation(~bridged(time, grid, settings.longest_bridge), iterations=reach)
    _check_near(grid[measured], smooth[measured, :3], time, samples[:, :3], where)
    return _Marker(
        columns=smooth,
        measured=measured,
        filled=int(np.sum(~bridged(time, grid, 1.5 / settings.rate))),
        dropped=int(np.sum(~inliers)),
        removed=np.mean(np.square(samples - resample(grid, smooth, time)), axis=0),
    )


def _check_near(grid: np.ndarray, filtered: np.ndarray, time: np.ndarray, samples: np.ndarray, where: str) -> None:
    """Refuse positions (G, 3) m at times (G,) s that are far from the line through the samples (T, 3) m at (T,) s."""
    beside = np.linalg.norm(filtered - np.column_stack([np.interp(grid, time, axis) for axis in samples.T]), axis=1)
    allowed = ASIDE * float(np.ptp(samples, axis=0).max()) + ASIDE_LEAST
    if beside.max(initial=0) > allowed:
        far = f"{1e3 * beside.max():.3g} mm from the measured ones at {grid[beside.argmax()]:.2f} s"
        raise InputError(
            f"{where}: filtered positions are {far}, expected at most {1e3 * allowed:.3g} mm: are its times right?"
        )


def average_static(trial: Trial) -> Trial:
    """A trial of one frame: the mean over the frames in which each marker was measured."""
    weight = trial.measured / np.maximum(trial.measured.sum(axis=0), 1)
    positions = np.einsum("ts,tsi->si", weight, trial.positions)[None]
    quaternions = trial.quaternions
    if quaternions is not None:
        quaternions = np.einsum("ts,tsi->si", weight, quaternions)[None]
        quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return replace(
        trial,
        time=trial.time[:1],
        positions=positions,
        quaternions=quaternions,
        measured=np.any(trial.measured, axis=0)[None],
        commands=trial.commands.mean(axis=0, keepdims=True),
        tendon_positions=trial.tendon_positions.mean(axis=0, keepdims=True),
    )


def _on_pose_clock(raw: RawTrial, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commands and tendon positions (G, K) m at the frames' times; a lacking one is the other, or 0."""
    streams = []
    for time, pulls in ((raw.command_time, raw.commands), (raw.tendon_time, raw.tendon_positions)):
        moved = fill_gaps(time + raw.clock_offset, pulls) if len(time) else pulls
        streams.append(
            np.stack([np.interp(grid, time + raw.clock_offset, column) for column in moved.T], axis=1)
            if moved.size
            else None
        )
    commands, wound = streams
    nothing = np.zeros((len(grid), len(raw.tendons)))
    commands = commands if commands is not None else wound if wound is not None else nothing
    return commands, wound if wound is not None else commands
