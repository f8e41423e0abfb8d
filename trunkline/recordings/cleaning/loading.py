"""From the logs of a session to checked raw trials: what is usable, what was repaired, what had to be refused."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.cleaning.bag_time import logged_offset
from trunkline.recordings.cleaning.checks import Findings, TrialLimits
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.dropped_frames import longest_unbroken, repair_dropped_frames
from trunkline.recordings.cleaning.invalid_samples import valid_samples
from trunkline.recordings.cleaning.label_swaps import repair_label_swaps
from trunkline.recordings.cleaning.motors import check_motors, read_motors
from trunkline.recordings.cleaning.reference import Reference, reference_of
from trunkline.recordings.cleaning.stale_poses import drop_stale_poses
from trunkline.recordings.cleaning.trial_window import Stretch, check_seen, columns_of, read_stretch, split_base
from trunkline.recordings.session.session import FixedBase, Session, TrialEntry
from trunkline.recordings.session.source import LogSource, open_log
from trunkline.recordings.signals.clock import OffsetFit, estimate_offset
from trunkline.recordings.tables.source import TableReader
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_stepwise
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.recording import FORCE


def load_raw_trials(
    folder: Path, session: Session, limits: TrialLimits, arm: Places | None = None
) -> Iterator[tuple[TrialEntry, RawTrial | InputError, Findings]]:
    """Read trial by trial. A trial that cannot be used comes as the error that says why.

    Every raw trial has the same markers: those that session.yaml maps, or all that any log shows.

    Args:
        arm: the described one, by whose size the unit is checked; None where nobody describes it.
    """
    logs: dict[str, LogSource | InputError] = {}
    read: list[tuple[LogSource, Stretch] | InputError] = []
    findings = [Findings(warnings=list(session.shared.get(trial.name, []))) for trial in session.trials]
    tables = TableReader(folder, session)
    for trial, record in zip(session.trials, findings, strict=True):
        try:
            rows = trial.model_dump_json(include={"file", "label", "table", "rows"})
            if rows not in logs:
                logs[rows] = _opened(folder / trial.file, session, trial, tables)
            source = logs[rows]
            if isinstance(source, InputError):
                raise source
            record.where = f"{source.log.path}: trial {trial.name}"
            record.log, record.frame_names = source.log, source.frames
            record.repairs += [f"log: {damage}" for damage in source.log.damage]
            read.append((source, read_stretch(source, trial, session, limits, record)))
        except InputError as error:
            read.append(error)
    usable = [(trial, *some) for trial, some in zip(session.trials, read, strict=True) if isinstance(some, tuple)]
    reference = reference_of(session, usable, arm)
    for trial, some, record in zip(session.trials, read, findings, strict=True):
        if isinstance(some, InputError):
            yield trial, some, record
            continue
        try:
            yield trial, _raw_trial(*some, trial, session, reference, limits, record), record
        except InputError as error:
            yield trial, error, record


def _opened(path: Path, session: Session, trial: TrialEntry, tables: TableReader) -> LogSource | InputError:
    """A log, decoded, or a trial's rows of a table; or why it cannot be, for all of its trials."""
    try:
        source = tables.open(trial) if trial.of_table else open_log(path, session)
        if isinstance(session.base, FixedBase) and session.base.body is not None:
            _put_in_origin(source, session.base.body)
        return source
    except InputError as error:
        return error


def _put_in_origin(source: LogSource, body: str) -> None:
    """Count all positions from where a body usually is, in place.

    Raises:
        InputError: there is no such body, or it is never seen.
    """
    poses, where = source.poses, f"{source.log.path}: base.body"
    if body not in poses.names:
        raise InputError(f"{where}: found {body!r}, expected one of {', '.join(poses.names)}")
    unseen = (poses.positions == 0).all(axis=2)  # as drivers put it
    place = np.where(unseen[..., None], np.nan, poses.positions)[:, poses.names.index(body)]
    if not np.isfinite(place).any():
        raise InputError(f"{where}: {body!r} is never seen, expected where the mount is")
    moved = poses.positions - np.nanmedian(place, axis=0)
    poses.positions = np.where(unseen[..., None], 0.0, moved)  # for `valid_samples` to count


def _raw_trial(
    source: LogSource,
    stretch: Stretch,
    trial: TrialEntry,
    session: Session,
    reference: Reference,
    limits: TrialLimits,
    findings: Findings,
) -> RawTrial:
    """Check and repair one trial.

    Raises:
        InputError: naming the file, and what is missing in it.
    """
    where = findings.where
    findings.repairs += reference.repairs
    findings.warnings += reference.warnings
    bodies = reference.bodies
    columns = columns_of(source, bodies, where)
    positions, quaternions = valid_samples(source.poses, stretch.rows, columns, reference, findings)
    drop_stale_poses(positions, quaternions, bodies, findings)
    check_seen(positions, bodies, limits.coverage, where, findings)
    base_positions, base_quaternions, positions, quaternions = split_base(
        session, positions, quaternions, f"{where}: {source.pose_topic}"
    )
    repair_label_swaps((base_positions, base_quaternions), positions, quaternions, stretch.time, reference, findings)
    if not is_stepwise(trial.experiment):  # there the arm jumps from frame to frame
        stretch.time = repair_dropped_frames(stretch.time, positions, bool(source.joint_topics), findings)
        if not source.joint_topics:
            part = longest_unbroken(stretch.time, positions, findings)
            positions, base_positions, base_quaternions = positions[part], base_positions[part], base_quaternions[part]
            quaternions = None if quaternions is None else quaternions[part]
            stretch = stretch.part(part)
    motors = read_motors(source, session, stretch, trial.experiment, limits, where, findings)
    if EXPERIMENTS[trial.experiment].needs_motors:
        check_motors(source, session, reference.joint_topics, motors, stretch, trial.experiment, limits, where)
    raw = RawTrial(
        name=trial.name,
        experiment=trial.experiment,
        split=trial.split,
        level=trial.level,
        load=trial.load,
        up=session.frame.up_direction() if session.frame.gravity == "standard" else np.zeros(3),
        time=stretch.time,
        markers=tuple(reference.markers.values()),
        positions=positions,
        quaternions=quaternions,
        base_positions=base_positions,
        base_quaternions=base_quaternions,
        **vars(motors),
    )
    findings.by_log_times, findings.by_motion = logged_offset(source, session, stretch), _by_motion(raw, limits)
    return raw


def _by_motion(raw: RawTrial, limits: TrialLimits) -> OffsetFit | None:
    """By how much the motors' clock is off, by what was wound, or else by what was commanded, while the arm moves. None
    of tensions: by what they hold, an arm lags for as long as it swings."""
    if EXPERIMENTS[raw.experiment].static or raw.command_unit == FORCE:
        return None
    wound = (raw.tendon_time, raw.tendon_positions)
    motion = wound if len(raw.tendon_time) else (raw.command_time, raw.commands)
    return estimate_offset(raw.time, raw.positions, *motion, limits.clock_offset)
