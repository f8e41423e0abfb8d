"""A take becomes a trial: outliers out, gaps bridged, one uniform clock, filtered, in the base frame."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_dilation

from trunkline.errors import InputError
from trunkline.frames import make_continuous, tilt_of_gravity
from trunkline.signals.base_frame import average_base, gravity_from_up, to_base_frame
from trunkline.signals.smoothing import bridged, fill_gaps, low_pass, outliers, resample
from trunkline.trials.experiments import EXPERIMENTS
from trunkline.trials.take import Take
from trunkline.trials.trial import Trial


@dataclass
class Filter:
    """rate: Hz of the uniform clock. cutoff: Hz, order: of the Butterworth low-pass.

    longest_bridge: s, longer gaps are filled and marked as not measured.
    deviations: see `smoothing.outliers`.
    release: where a release starts: at its "onset", or once the arm is "free" and moves already, see `start`.
    """

    rate: float
    cutoff: float
    order: int
    longest_bridge: float
    deviations: float
    release: str = "onset"


@dataclass
class Findings:
    """samples: of all segments on the uniform clock. gap_share, filled_share: not trusted, filled in.
    outliers: samples dropped.

    position_noise (m), angle_noise (rad): root mean square of what the filter took away, per axis.
    tilt: rad, measured. motion: m, how far the segments still move in a static tilt (standard deviation).
    base_shift (m), base_turn (rad): of the mount within the trial.
    """

    samples: int
    gap_share: float
    filled_share: float
    outliers: int
    position_noise: float
    angle_noise: float | None
    tilt: float
    motion: float | None
    base_shift: float
    base_turn: float


def filter_take(take: Take, settings: Filter) -> tuple[Trial, Findings]:
    """Filter one take.

    Quaternions are filtered by component and normalised again: they are continuous in sign, and within the
    bandwidth of the filter the arm turns by little, so that this differs from the sphere in second order.

    Raises:
        InputError: if a segment has too few good samples.
    """
    base = average_base(take.base_positions, take.base_quaternions)
    positions, quaternions = to_base_frame(base, take.positions, take.quaternions)
    grid = np.arange(int(take.time[-1] * settings.rate) + 1) / settings.rate
    frames, count = len(grid), len(take.segments)
    width = 3 if quaternions is None else 7
    columns, measured = np.empty((frames, count, width)), np.empty((frames, count), bool)
    filled, dropped = 0, 0
    removed = []
    for index, name in enumerate(take.segments):
        samples = (
            positions[:, index]
            if quaternions is None
            else np.hstack([positions[:, index], quaternions[:, index]])
        )
        good = np.isfinite(samples).all(axis=1)
        time, samples = take.time[good], samples[good]
        if width == 7:
            samples[:, 3:] = make_continuous(samples[:, 3:])
        inliers = ~outliers(time, samples[:, :3], settings.deviations)
        if width == 7:
            inliers &= ~outliers(time, samples[:, 3:], settings.deviations)
        dropped += int(np.sum(~inliers))
        time, samples = time[inliers], samples[inliers]
        if len(time) < 2 * settings.order:
            raise InputError(
                f"trial {take.name}: {name!r}: found {len(time)} good samples, expected more"
            )
        smooth = low_pass(resample(time, samples, grid), settings.rate, settings.cutoff, settings.order)
        columns[:, index] = smooth
        # the low-pass carries what fills a gap some frames beyond its edges
        filled_in = ~bridged(time, grid, settings.longest_bridge)
        measured[:, index] = ~binary_dilation(
            filled_in, iterations=round(settings.rate / settings.cutoff / 2)
        )
        filled += int(np.sum(~bridged(time, grid, 1.5 / settings.rate)))
        removed.append(np.mean(np.square(samples - resample(grid, smooth, time)), axis=0))
    noise = np.sqrt(np.mean(removed, axis=0))
    if width == 7:
        columns[..., 3:] /= np.linalg.norm(columns[..., 3:], axis=-1, keepdims=True)

    commands, wound = _on_pose_clock(take, grid)
    gravity = gravity_from_up(base, take.up)
    trial = Trial(
        name=take.name,
        experiment=take.experiment,
        split=take.split,
        level=take.level,
        gravity=gravity,
        time=grid,
        segments=take.segments,
        positions=columns[..., :3],
        quaternions=None if quaternions is None else columns[..., 3:],
        measured=measured,
        tendons=take.tendons,
        commands=commands,
        tendon_positions=wound,
    )
    kind, motion = EXPERIMENTS[take.experiment], None
    if kind.static:
        motion = float(np.sqrt(np.mean(np.var(trial.positions, axis=0))))
        trial = average_static(trial)
    if kind.start is not None:
        trial.start = kind.start(trial)
        if kind.free is not None and settings.release == "free":
            trial.start, trial.in_motion = kind.free(trial, trial.start), True
    findings = Findings(
        frames * count,
        1 - float(measured.mean()),
        filled / (frames * count),
        dropped,
        float(np.sqrt(np.mean(noise[:3] ** 2))),
        # half an angle is in the vector part; of its square mean, four components see what three axes bring
        None if width == 3 else float(2 * np.sqrt(np.sum(noise[3:] ** 2) / 3)),
        tilt_of_gravity(gravity),
        motion,
        base.shift,
        base.turn,
    )
    return trial, findings


def summary(trials: list[Trial], findings: list[Findings]) -> dict:
    """The filtered session in a few numbers, for metrics.json. Shares are of all samples."""
    static, moving = {}, {}
    for trial, found in zip(trials, findings, strict=True):
        kind = EXPERIMENTS[trial.experiment]
        if kind.static:
            level = {} if kind.level is None else {f"level_{kind.level.unit}": trial.level}
            static[trial.name] = level | {
                "tilt_deg": float(np.degrees(found.tilt)),
                "motion_mm": 1e3 * found.motion,
            }
        else:
            moving[trial.name] = {"start_s": trial.start, "duration_s": float(trial.time[-1])}
    angles = [found.angle_noise for found in findings if found.angle_noise is not None]
    weights = [found.samples for found in findings]
    return {
        "trials": len(trials),
        "outliers": sum(found.outliers for found in findings),
        "gap_share": float(np.average([found.gap_share for found in findings], weights=weights)),
        "filled_share": float(np.average([found.filled_share for found in findings], weights=weights)),
        "removed_position_mm": 1e3 * float(np.median([found.position_noise for found in findings])),
        "removed_orientation_deg": float(np.degrees(np.median(angles))) if angles else None,
        "base_shift_mm": 1e3 * max(found.base_shift for found in findings),
        "base_turn_deg": float(np.degrees(max(found.base_turn for found in findings))),
        "static": static,
        "moving": moving,
    }


def average_static(trial: Trial) -> Trial:
    """A trial of one frame: the mean over the frames in which each segment was measured."""
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
        measured=trial.measured.any(axis=0)[None],
        commands=trial.commands.mean(axis=0, keepdims=True),
        tendon_positions=trial.tendon_positions.mean(axis=0, keepdims=True),
    )


def _on_pose_clock(take: Take, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commands and tendon positions (G, K) m at the frames' times; a lacking one is the other, or 0."""
    streams = []
    for time, pulls in ((take.command_time, take.commands), (take.tendon_time, take.tendon_positions)):
        moved = fill_gaps(time + take.clock_offset, pulls) if len(time) else pulls
        streams.append(
            np.stack([np.interp(grid, time + take.clock_offset, column) for column in moved.T], axis=1)
            if moved.size
            else None
        )
    commands, wound = streams
    nothing = np.zeros((len(grid), len(take.tendons)))
    commands = commands if commands is not None else wound if wound is not None else nothing
    return commands, wound if wound is not None else commands
