"""From the logs of a session to checked takes: what is usable, what was repaired, what had to be refused."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.frames import wxyz_from_rotation
from trunkline.logs.streams import PoseStream
from trunkline.logs.transforms import is_rotation
from trunkline.sessions.session import FixedBase, Session, TrialEntry
from trunkline.sessions.source import Source, open_log
from trunkline.signals.clock import (
    FrameFit,
    OffsetFit,
    agree_on_offset,
    estimate_offset,
    first_motion_offset,
    fit_frames,
)
from trunkline.signals.smoothing import noise_level
from trunkline.signals.units import extent, likely_unit
from trunkline.takes.checks import Findings, Limits, in_order
from trunkline.takes.frozen import frozen
from trunkline.takes.lost import find_lost, put_back
from trunkline.takes.motors import check_motors, read_motors
from trunkline.takes.swaps import find_swaps, usual_distances
from trunkline.takes.vertical import check_vertical
from trunkline.trials.experiments import EXPERIMENTS
from trunkline.trials.take import Take

UNIT = {"m": 1.0, "mm": 1e-3}


@dataclass
class Arm:
    """What all logs together say. scale: m per unit of their positions. distances: between the base and the segments,
    see `usual_distances`; None where there is too little to compare. marked_base: whether a body marks the mount.
    note: on the unit, where it is not the declared.
    """

    scale: float
    distances: np.ndarray | None
    marked_base: bool
    note: str | None


def take_in(folder: Path, session: Session, limits: Limits) -> Iterator[tuple[TrialEntry, Take | InputError, Findings]]:
    """Read trial by trial. A trial that cannot be used comes as the error that says why.

    Every take has the same segments: those that session.yaml maps, or all that any log shows.
    """
    logs: dict[str, Source | InputError] = {}
    for trial in session.trials:
        if trial.file not in logs:
            try:
                logs[trial.file] = open_log(folder / trial.file, session)
            except InputError as error:
                logs[trial.file] = error
    sources = [source for source in logs.values() if isinstance(source, Source)]
    segments = _segments(session, sources)
    arm = _arm(session, sources, segments)
    joint_topics = tuple(sorted({name for source in sources for name in source.joint_topics}))
    for trial in session.trials:
        source, findings = logs[trial.file], Findings()
        if isinstance(source, InputError):
            yield trial, source, findings
            continue
        try:
            yield trial, _take(source, trial, session, segments, arm, joint_topics, limits, findings), findings
        except InputError as error:
            yield trial, error, findings


def align_clocks(takes: list[Take], fits: list[OffsetFit | None]) -> tuple[float, float]:
    """Give every take the offset that the session's takes agree on; the offset and its spread, s.

    Only the takes for identification have a say, so that the others stay unseen until they validate; all have,
    where those for identification tell nothing.
    """
    told = [(take.split, fit) for take, fit in zip(takes, fits, strict=True) if fit is not None]
    offset, spread = agree_on_offset([fit for split, fit in told if split == "identify"])
    if not np.isfinite(spread):
        offset, spread = agree_on_offset([fit for _, fit in told])
    for take in takes:
        take.clock_offset = offset
    return offset, spread


def settle_vertical(takes: list[Take], findings: list[Findings], session: Session) -> None:
    """Give every take the vertical that its session's tilts prove, and say so; or say what looks wrong."""
    up, said = check_vertical(takes, measured_base=not isinstance(session.base, FixedBase))
    for take, found in zip(takes, findings, strict=True):
        if up is not None:
            take.up = up
        if said is not None:
            (found.warnings if up is None else found.repairs).append(said)


def _segments(session: Session, sources: list[Source]) -> dict[str, str]:
    """Name in the log to name in the model of every segment, in the order of the map, or by name."""
    if session.segments is not None:
        return session.segments
    names = {name for source in sources for name in source.poses.names if name != session.base}
    return {name: name for name in sorted(names)}


def _arm(session: Session, sources: list[Source], segments: dict[str, str]) -> Arm:
    """The unit of the positions, and the usual distances."""
    fixed = isinstance(session.base, FixedBase)
    needed = list(segments) if fixed else [session.base, *segments]
    logs = [
        source.poses.positions[:, [source.poses.names.index(name) for name in needed]]
        for source in sources
        if set(needed) <= set(source.poses.names)
    ]
    scale, note = UNIT[session.frame.unit], None
    found = likely_unit(logs)
    if found is not None and found != session.frame.unit:
        scale = UNIT[found]
        apart = np.median([extent(positions) for positions in logs])
        note = f"unit: bodies {apart:.4g} apart are no arm in {session.frame.unit}, as declared; taken as {found}"
    if not logs or len(needed) < 3:
        return Arm(scale, None, not fixed, note)
    logs = [scale * positions for positions in logs]
    if fixed:
        mount = np.array(session.base.position)
        logs = [np.insert(positions, 0, mount, axis=1) for positions in logs]
    return Arm(scale, usual_distances(logs), not fixed, note)


def _take(
    source: Source,
    trial: TrialEntry,
    session: Session,
    segments: dict[str, str],
    arm: Arm,
    joint_topics: tuple[str, ...],
    limits: Limits,
    findings: Findings,
) -> Take:
    """Check one trial; `joint_topics` are those of all logs.

    Raises:
        InputError: naming the file, and what is missing in it.
    """
    where = f"{source.log.path}: trial {trial.name}"
    findings.repairs += [f"log: {damage}" for damage in source.log.damage]
    findings.repairs += [] if arm.note is None else [arm.note]
    poses = source.poses
    if poses.undecodable:
        findings.repairs.append(f"{poses.undecodable} messages that do not fit their schema dropped")
    findings.logged = _log_fit(poses)
    stamps, findings.frames = _stamps(poses, session.clock, where, source.pose_topic)
    rows = in_order(stamps, limits.disorder, f"{where}: {source.pose_topic}", findings)
    epoch = stamps[rows[0]]
    time = (stamps[rows] - epoch) * 1e-9
    if trial.window is not None:
        inside = (time >= trial.window[0]) & (time <= trial.window[1])
        rows, time = rows[inside], time[inside]
        if not len(time):
            raise InputError(f"{where}: window {list(trial.window)} s holds no pose, the log has {_seconds(stamps)} s")
        epoch, time = epoch + round(time[0] * 1e9), time - time[0]
    if time[-1] < limits.duration:
        lost = f" (damaged: {'; '.join(source.log.damage)})" if source.log.damage else ""
        expected = f"expected at least {limits.duration:g} s"
        raise InputError(f"{where}: found {time[-1]:.2f} s of poses in {len(time)} frames{lost}, {expected}")

    needed = list(segments) if isinstance(session.base, FixedBase) else [session.base, *segments]
    for name in needed:
        if name not in poses.names:
            raise InputError(f"{where}: {name!r} never appears in {source.pose_topic}, found {', '.join(poses.names)}")
    columns = [poses.names.index(name) for name in needed]
    positions, quaternions = _good_samples(poses, rows, columns, arm.scale, needed, findings)
    still = frozen(positions)
    _count(still, "that only repeat the one before, to the last bit,", needed, findings)
    positions[still] = np.nan
    if quaternions is not None:
        quaternions[still] = np.nan
    seen = np.isfinite(positions[..., 0]).mean(axis=0)
    for name, share in zip(needed, seen, strict=True):
        if share < limits.coverage:
            expected = f"expected at least {100 * limits.coverage:g} %"
            raise InputError(f"{where}: {name!r} is seen in {100 * share:.1f} % of {len(time)} frames, {expected}")

    base_positions, base_quaternions, positions, quaternions = _split_base(
        session, positions, quaternions, f"{where}: {source.pose_topic}"
    )
    if arm.distances is not None:
        names = [needed[0] if arm.marked_base else "base", *segments]
        _untangle((base_positions, base_quaternions), positions, quaternions, arm, names, findings)
    time = _with_lost_time(time, positions, bool(source.joint_topics), findings)
    logged = poses.log_times[rows[0]]
    tendons, motors = read_motors(source, session, epoch, logged, time, limits, where, findings)
    if EXPERIMENTS[trial.experiment].needs_motors:
        check_motors(source, session, joint_topics, motors, epoch, logged, time, limits, where)
    command_time, commands, tendon_time, tendon_positions = motors
    take = Take(
        name=trial.name,
        experiment=trial.experiment,
        split=trial.split,
        level=trial.level,
        up=session.frame.up_direction(),
        time=time,
        segments=tuple(segments.values()),
        positions=positions,
        quaternions=quaternions,
        base_positions=base_positions,
        base_quaternions=base_quaternions,
        tendons=tendons,
        command_time=command_time,
        commands=commands,
        tendon_time=tendon_time,
        tendon_positions=tendon_positions,
    )
    wound = (take.tendon_time, take.tendon_positions)
    motion = wound if len(take.tendon_time) else (take.command_time, take.commands)
    findings.offset = estimate_offset(time, positions, *motion, limits.clock_offset)
    if findings.offset is not None:
        findings.offset.onset = first_motion_offset(time, positions, *motion, findings.offset.offset)
    return take


def _stamps(poses: PoseStream, clock: str, where: str, topic: str) -> tuple[np.ndarray, FrameFit | None]:
    """When each frame was taken, ns, by the clock that the session names."""
    stamps = poses.log_times if clock == "log" else poses.stamps
    if not stamps.any():
        raise InputError(f"{where}: {topic}: all stamps are zero, expected `clock: log` in session.yaml for such logs")
    if poses.frames is None or len(stamps) < 10 or np.any(np.diff(poses.frames) <= 0):
        if clock == "frame":
            raise InputError(f"{where}: {topic}: frame numbers do not increase, expected `clock: stamp` or `log`")
        return stamps, None
    fit = fit_frames(stamps, poses.frames)
    if clock == "frame":
        frames = poses.frames - poses.frames[0]
        return stamps[0] + np.round((fit.start + frames / fit.rate) * 1e9).astype(np.int64), fit
    return stamps, fit


def _log_fit(poses: PoseStream) -> FrameFit | None:
    """Stamps over log times: how the cameras' clock drifts against the recorder's, and how late messages come."""
    if len(poses.stamps) < 10 or not poses.stamps.any() or not np.ptp(poses.log_times):
        return None
    return fit_frames(poses.stamps, (poses.log_times - poses.log_times[0]) * 1e-9)


def _untangle(
    base: tuple[np.ndarray, np.ndarray],
    positions: np.ndarray,
    quaternions: np.ndarray | None,
    arm: Arm,
    names: list[str],
    findings: Findings,
) -> None:
    """Give labels that changed places back, in the poses of the base (where a body marks it) and of the segments."""
    bodies = np.insert(positions, 0, base[0], axis=1)
    turns = None if quaternions is None else np.insert(quaternions, 0, base[1], axis=1)
    for swap in find_swaps(bodies, arm.distances, arm.marked_base):
        wrong, right = list(swap.bodies), [*swap.bodies[1:], swap.bodies[0]]
        for values in (bodies, turns):
            if values is not None:
                values[np.ix_(swap.frames, right)] = values[np.ix_(swap.frames, wrong)]
        count, who = int(swap.frames.sum()), " and ".join(repr(names[body]) for body in swap.bodies)
        findings.repairs.append(f"{who} were taken for each other in {count} frames, put right")
    base[0][:], positions[:] = bodies[:, 0], bodies[:, 1:]
    if turns is not None:
        base[1][:], quaternions[:] = turns[:, 0], turns[:, 1:]


def _with_lost_time(time: np.ndarray, positions: np.ndarray, motors: bool, findings: Findings) -> np.ndarray:
    """Time (T,) with what even stamps hide put back, unless motors are dated by a clock that would not move along."""
    noise = float(np.median(noise_level(positions.reshape(len(time), -1))))
    lost = find_lost(time, positions, noise)
    if not lost:
        return time
    count, at = sum(place.frames for place in lost), ", ".join(f"{time[place.after]:.2f}" for place in lost)
    frames = "frame" if count == 1 else "frames"
    told = f"{count} {frames} lost at {at} s, though the stamps go on evenly: all bodies jump ahead on their ways"
    if motors:
        findings.warnings.append(f"{told}; left so, as the motors have a clock of their own")
        return time
    findings.repairs.append(f"{told}; their time put back")
    return put_back(time, lost)


def _good_samples(
    poses: PoseStream,
    rows: np.ndarray,
    columns: list[int],
    scale: float,
    names: list[str],
    findings: Findings,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Positions in metres and unit quaternions of the bodies in `columns`, NaN where either is no good."""
    positions = scale * poses.positions[np.ix_(rows, columns)]
    present = poses.present[np.ix_(rows, columns)]
    good = np.isfinite(positions).all(axis=-1)
    quaternions = None
    if poses.quaternions is not None:
        quaternions = poses.quaternions[np.ix_(rows, columns)]
        rotation = is_rotation(quaternions)
        _count(present & good & ~rotation, "with a NaN, zero or unnormalised quaternion", names, findings)
        quaternions[rotation] /= np.linalg.norm(quaternions[rotation], axis=-1, keepdims=True)
        good, bad = good & rotation, present & ~good
        quaternions[~good] = np.nan
    else:
        bad = present & ~good
    _count(bad, "with a position that is not finite", names, findings)
    positions[~good] = np.nan
    return positions, quaternions


def _count(bad: np.ndarray, what: str, names: list[str], findings: Findings) -> None:
    if bad.any():
        where = ", ".join(name for name, hit in zip(names, bad.any(axis=0), strict=True) if hit)
        findings.repairs.append(f"{int(bad.sum())} samples {what} dropped ({where})")


def _split_base(session: Session, positions: np.ndarray, quaternions: np.ndarray | None, where: str):
    """(base positions (T, 3), base quaternions (T, 4), segments' positions, segments' quaternions)."""
    if isinstance(session.base, FixedBase):
        quaternion = session.base.quaternion or _upright(session.frame.up_direction())
        ones = np.ones((len(positions), 1))
        return ones * np.array(session.base.position), ones * np.array(quaternion), positions, quaternions
    if quaternions is None:
        raise InputError(f"{where}: no orientations, expected `base` in session.yaml as a fixed pose for such logs")
    return positions[:, 0], quaternions[:, 0], positions[:, 1:], quaternions[:, 1:]


def _upright(up: np.ndarray) -> np.ndarray:
    """A quaternion that turns z to `up`, with x along the frame's axis that is nearest to level."""
    x = np.eye(3)[np.argmin(np.abs(up))]
    x -= x @ up * up
    x /= np.linalg.norm(x)
    return wxyz_from_rotation(Rotation.from_matrix(np.stack([x, np.cross(up, x), up], axis=1)))


def _seconds(stamps: np.ndarray) -> str:
    return f"{(stamps.max() - stamps.min()) * 1e-9:.2f}"
