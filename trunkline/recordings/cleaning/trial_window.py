"""Which frames of a log are a trial, and when each was taken."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.frames import wxyz_from_rotation
from trunkline.recordings.cleaning.checks import Findings, TrialLimits, in_order, instants
from trunkline.recordings.cleaning.clocks import check_clocks
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.session.session import FixedBase, Session, TrialEntry
from trunkline.recordings.session.source import LogSource
from trunkline.recordings.signals.clock import FrameFit, fit_frames
from trunkline.recordings.signals.even_times import even_times, is_uneven
from trunkline.recordings.trials.experiments import is_stepwise

COARSE = 0.1  # share of frames that have the stamp of another pose, from which on stamps do not tell when poses were
WHOLE = 0.9  # share of bodies that are in a frame, below which frames are of different bodies, at times of their own


@dataclass
class Stretch:
    """The part of a log that is a trial.

    rows: (T,) of the log's frames, in the order of time. time: (T,) s from the first of them.
    epoch, logged: ns, the stamp of that one, and when the recorder had it.
    """

    rows: np.ndarray
    time: np.ndarray
    epoch: int
    logged: int

    def part(self, frames: slice) -> "Stretch":
        """Some of its frames, one after the other."""
        begin = float(self.time[frames.start])
        passed = round(begin * 1e9)
        return Stretch(self.rows[frames], self.time[frames] - begin, self.epoch + passed, self.logged + passed)


def read_stretch(
    source: LogSource, trial: TrialEntry, session: Session, limits: TrialLimits, findings: Findings
) -> Stretch:
    """Date a log's frames by the clock that the session names, and cut out the trial.

    Raises:
        InputError: time runs back, or too little is left.
    """
    poses, where = source.poses, findings.where
    if poses.undecodable:
        findings.repairs.append(f"{poses.undecodable} messages that do not fit their schema dropped")
    findings.repairs += poses.notes
    findings.logged = _log_fit(poses)
    stamps, findings.frames = _stamps(poses, session.clock, where, source.pose_topic)
    at_once = session.clock == "log"  # a recorder that stalled may log several in one instant
    rows = in_order(stamps, limits.disorder, f"{where}: {source.pose_topic}", findings, at_once)
    if session.clock == "stamp":
        _require_fine(poses, f"{where}: {source.pose_topic}")
    check_clocks(poses, session.clock, limits, f"{where}: {source.pose_topic}", findings)
    if session.even_times and not is_stepwise(trial.experiment):
        stamps = _evened(stamps, rows, poses, session.clock, findings)
    rows = instants(stamps, rows, findings)
    epoch = int(stamps[rows[0]])
    time = (stamps[rows] - epoch) * 1e-9
    if trial.window is not None:
        inside = (time >= trial.window[0]) & (time <= trial.window[1])
        rows, time = rows[inside], time[inside]
        if not len(time):
            whole = f"{(stamps.max() - stamps.min()) * 1e-9:.2f}"
            raise InputError(f"{where}: window {list(trial.window)} s holds no pose, the log has {whole} s")
        epoch, time = epoch + round(time[0] * 1e9), time - time[0]
    if time[-1] < limits.duration:
        lost = f" (damaged: {'; '.join(source.log.damage)})" if source.log.damage else ""
        expected = f"expected at least {limits.duration:g} s"
        passed = 1e-9 * float(np.ptp(poses.log_times))
        if session.clock != "log" and trial.window is None and passed >= limits.duration:
            expected += f": {passed:.2f} s pass by log times: are stamps in another unit? `clock: log` does without"
        raise InputError(f"{where}: found {time[-1]:.2f} s of poses in {len(time)} frames{lost}, {expected}")
    return Stretch(rows, time, epoch, int(poses.log_times[rows[0]]))


def _require_fine(poses: PoseStream, where: str) -> None:
    """Refuse stamps that several poses share, as those of a clock that ticks too seldom."""
    order = np.argsort(poses.stamps, kind="stable")
    positions = poses.positions[order]
    fresh = (positions[1:] != positions[:-1]) & np.isfinite(positions[1:]) & np.isfinite(positions[:-1])
    shared = (np.diff(poses.stamps[order]) == 0) & fresh.any(axis=(1, 2))
    if np.mean(shared) > COARSE:
        problem = f"found {len(np.unique(poses.stamps))} different stamps of {len(order)} different poses"
        raise InputError(f"{where}: {problem}, expected one for each: `clock: log` or `frame` does without stamps")


def _evened(stamps: np.ndarray, rows: np.ndarray, poses: PoseStream, clock: str, findings: Findings) -> np.ndarray:
    """The stamps (T,) ns, those that came late at times that are even; as they are where most came in time."""
    time = 1e-9 * (stamps[rows] - stamps[rows[0]])
    if not is_uneven(time) or poses.present.mean() < WHOLE:
        return stamps
    numbers = None if poses.frames is None else poses.frames[rows]
    numbers = numbers if numbers is not None and np.all(np.diff(numbers) > 0) else None
    what = "log times" if clock == "log" else "stamps"
    even = even_times(time, numbers)
    if even is None:
        shortest = 1e3 * float(np.diff(time).min())
        problem = f"{what} are uneven, the nearest two {shortest:.2g} ms apart, and do not tell which frames"
        remedy = "even ones, frame numbers and `clock: frame`, or `even_times: false` where each is known"
        findings.warnings.append(f"{problem} are missing: expected {remedy}")
        return stamps
    late = even.late - np.quantile(even.late, 0.05)
    by = "their count" if numbers is None else "frame numbers"
    missing = f", {even.missing} of them missing in between" if even.missing else ""
    findings.repairs.append(
        f"{what} are up to {1e3 * late.max():.0f} ms late, though frames come at {even.rate:.3g} Hz{missing}: their "
        f"times evened out by {by}; `even_times: false` leaves them"
    )
    evened = stamps.copy()
    evened[rows] = stamps[rows[0]] + np.round(even.time * 1e9).astype(np.int64)
    return evened


def columns_of(source: LogSource, names: list[str], where: str) -> list[int]:
    """Where each of `names` is among the bodies of the log. Raises InputError where one is not."""
    poses = source.poses
    for name in names:
        if name not in poses.names:
            problem = f"{name!r} never appears in {source.pose_topic}, found {', '.join(poses.names)}"
            raise InputError(f"{where}: {problem}, expected it, or `markers` in session.yaml that leaves it out")
    return [poses.names.index(name) for name in names]


def check_seen(positions: np.ndarray, names: list[str], least: float, where: str, findings: Findings) -> None:
    """Refuse a trial with a body, of (T, B, 3), that is seen in less than the share `least` of the frames.

    Or never in four frames in a row, which is what noise is measured by.
    """
    shares = np.isfinite(positions[..., 0]).mean(axis=0)
    in_a_row = np.isfinite(np.diff(positions[..., 0], n=3, axis=0)).mean(axis=0) > 0
    for name, share, enough in zip(names, shares, in_a_row, strict=True):
        if share < least:
            dropped = [repair for repair in findings.repairs if " samples " in repair and name in repair]
            why = f" ({'; '.join(dropped)})" if dropped else ""
            problem = f"{name!r} is seen in {100 * share:.1f} % of {len(positions)} frames{why}"
            remedy = "or `markers` in session.yaml that leaves it out"
            raise InputError(f"{where}: {problem}, expected at least {100 * least:g} %, {remedy}")
        if not enough:
            problem = f"{name!r} is seen in {100 * share:.1f} % of {len(positions)} frames, but never in four in a row"
            raise InputError(f"{where}: {problem}, expected messages that hold all bodies, one after the other")


def split_base(session: Session, positions: np.ndarray, quaternions: np.ndarray | None, where: str):
    """(base positions (T, 3), base quaternions (T, 4), markers' positions, markers' quaternions)."""
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
