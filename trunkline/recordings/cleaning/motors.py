"""The tendons of a trial: commands and measured positions around its frames."""

from dataclasses import dataclass

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import Findings, TrialLimits, in_order
from trunkline.recordings.cleaning.clocks import CERTAIN
from trunkline.recordings.cleaning.trial_window import Stretch
from trunkline.recordings.logs.joint_stream import JointStream
from trunkline.recordings.logs.messages import JOINTS
from trunkline.recordings.session.session import MotorEntry, Session
from trunkline.recordings.session.source import LogSource
from trunkline.recordings.signals.clock import fit_frames
from trunkline.recordings.signals.held import OFTEN, to_and_fro, with_corners
from trunkline.recordings.signals.steps import find_step
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_held
from trunkline.recordings.trials.recording import FORCE, LENGTH, PULLED

Series = tuple[np.ndarray, np.ndarray]  # times (T,) s and numbers (T, K)
ROLES = ("command", "tendon position")
NEAR_TURN = 0.2  # turns, by which an encoder that is whole turns off its command may differ from that
NO_WORD = 1.0  # s before an arm at rest, from which on it is said that the last command holds
RATE = 0.002  # by which the clocks of motors and poses may differ in rate; quartzes do by 100 times less
FEWEST = 10  # messages that tell a rate
HISTORY = 60.0  # s before an arm at rest under its motors in which its last motion is looked for


@dataclass
class MotorSignals:
    """What moves the tendons around a trial, each stream on its own times: as in a raw trial."""

    tendons: tuple[str, ...]
    command_time: np.ndarray
    commands: np.ndarray
    tendon_time: np.ndarray
    tendon_positions: np.ndarray
    command_unit: str = LENGTH


def read_motors(
    source: LogSource, session: Session, stretch: Stretch, experiment: str, limits: TrialLimits, where: str,
    findings: Findings,
) -> MotorSignals:  # fmt: skip
    """The messages near enough to the stretch, dated from its first frame; of commands that hold an arm at rest also
    those that brought it there.

    Raises:
        InputError: the tendons of a topic are not those of session.yaml, or of the other topic; or commands are those
            of two publishers, or by a clock of another rate than that of the poses.
    """
    streams = [source.commands, source.tendon_positions]
    tendons = _tendons([stream.names for stream in streams if stream is not None])
    mapped, coupling = session.tendons, None
    if session.tendons is not None:
        tendons = tuple(session.tendons.values())
    if session.motors is not None:
        mapped = {name: name for name in session.motors}
        tendons, coupling = session.coupling()
    recorder = by_recorder(source, session)
    arrays, counts = [], None
    for stream, role in zip(streams, ROLES, strict=True):
        if stream is None or not len(stream.stamps):
            arrays += [np.empty(0), np.empty((0, len(tendons)))]
            continue
        columns = _columns(stream, mapped, tendons, f"{where}: {role} topic")
        findings.repairs += stream.notes
        stamps = dated(stream, recorder, stretch)
        if not recorder:
            stepped = _check_step(stream, role, findings)
            if not stepped and EXPERIMENTS[experiment].needs_motors and not EXPERIMENTS[experiment].static:
                _check_rate(stream, role, where, findings)
        elif session.clock != "log":
            findings.repairs.append(f"{role} messages dated by the recorder's clock, as not all have stamps")
        rows = in_order(stamps, limits.disorder, f"{where}: {role} topic", findings, at_once=True)
        series = _together((stamps[rows] - stretch.epoch) * 1e-9, stream, rows, columns, role, findings)
        earlier = HISTORY if role == "command" and is_held(experiment) else 0.0
        begin, end = -limits.clock_offset - earlier, stretch.time[-1] + limits.clock_offset
        whole = [_near(some, begin, end, role == "command") for some in series]
        if role == "command":
            scales = np.ones(len(columns)) if coupling is None else np.abs(coupling).max(axis=0)
            scales = [scales] if len(series) == 1 else scales[:, None]
            if EXPERIMENTS[experiment].needs_motors:
                for (seconds, numbers), scale in zip(whole, scales, strict=True):
                    topic = f"{where}: {stream.topic}"
                    _one_publisher(seconds, numbers * scale, session.command_unit, topic, findings)
                last = max((some[0][-1] for some in whole if len(some[0])), default=0.0)
                if is_held(experiment) and last < -NO_WORD:
                    findings.repairs.append(f"commands end {-last:.1f} s before the poses: the last holds")
            whole = [with_corners(*some, session.commands) for some in whole]
        seconds, pulls = _side_by_side(whole)
        if session.motors is not None:
            if role == "command":
                counts = seconds, pulls
            else:
                pulls = _unwrapped(seconds, pulls, session.motors, counts, findings)
        if coupling is not None:
            pulls = pulls @ coupling.T
        arrays += [seconds, pulls]
    return MotorSignals(tuple(tendons), *arrays, command_unit=session.command_unit)


def check_motors(
    source: LogSource,
    session: Session,
    joint_topics: tuple[str, ...],
    motors: MotorSignals,
    stretch: Stretch,
    experiment: str,
    limits: TrialLimits,
    where: str,
) -> None:
    """Where nothing pulls within reach of the poses, or a topic's messages are all out of it: raises InputError with
    what there is instead.

    Args: joint_topics: of all logs of the session.
    """
    kind = ", ".join(JOINTS)
    others = f"{', '.join(joint_topics) or 'none'} ({kind})"
    for key in ("commands", "tendon_positions"):
        name = next((name for name in session.topics.of(key) if name not in joint_topics), None)
        if name is not None:
            raise InputError(f"{where}: topics.{key}: found {name!r}, which no log has, expected one of: {others}")
    streams = (source.commands, source.tendon_positions)
    within = [bool(np.any(t > -limits.clock_offset)) for t in (motors.command_time, motors.tendon_time)]
    if is_held(experiment) and len(motors.command_time):  # what was sent before the poses holds
        within[0] = True
    lost = [stream for stream, some in zip(streams, within, strict=True) if stream and len(stream.stamps) and not some]
    if any(within) and not lost:
        return
    recorder = by_recorder(source, session)
    streams_found = [
        f"no {role} topic"
        if stream is None
        else f"{len(stream.stamps)} messages on {stream.topic}{'' if some else _distance(stream, recorder, stretch)}"
        for stream, role, some in zip(streams, ROLES, within, strict=True)
    ]
    both = "and" if any(within) else "or"
    expected = f"expected commands {both} tendon positions within {limits.clock_offset:g} s of the poses"
    topics = f" among: {', '.join(source.joint_topics) or 'none'} ({kind})" if not any(streams) else ""
    if lost and not recorder and all(_logged_within(stream, stretch, limits.clock_offset) for stream in lost):
        expected += ", as they are by log times: `clock: log` in session.yaml dates both by these"
    raise InputError(f"{where}: found {' and '.join(streams_found)}{topics}, {expected}")


def by_recorder(source: LogSource, session: Session) -> bool:
    """Whether the recorder's clock dates commands and positions: where that is meant, or one of them has no other."""
    streams = [stream for stream in (source.commands, source.tendon_positions) if stream is not None]
    return session.clock == "log" or any(not s.timed or not s.stamps.any() for s in streams if len(s.stamps))


def dated(stream: JointStream, recorder: bool, stretch: Stretch) -> np.ndarray:
    """When each message was sent, ns: by its header, or by the recorder, moved to the clock of the poses."""
    return stream.log_times + (stretch.epoch - stretch.logged) if recorder else stream.stamps


def _near(series: Series, begin: float, end: float, holds: bool) -> Series:
    """What lies between two times, s, and, of what holds, the last before."""
    seconds, numbers = series
    near = (seconds > begin) & (seconds < end)
    if holds and (before := np.flatnonzero(seconds <= begin)).size:
        near[before[-1]] = True
    return seconds[near], numbers[near]


def _tendons(names: list[tuple[str, ...]]) -> tuple[str, ...]:
    """Those of a topic, of two of the one without further joints."""
    first = next(iter(names), ())
    return names[-1] if len(names) > 1 and set(names[-1]) < set(first) else first


def _together(
    seconds: np.ndarray, stream: JointStream, rows: np.ndarray, columns: list[int], role: str, findings: Findings
) -> list[Series]:
    """Times (T,) s and numbers (T, K) of all `columns`; where messages hold some of them, of each by itself, (T, 1)."""
    values, sent = stream.positions[rows][:, columns], stream.sent[rows][:, columns]
    some = sent.any(axis=1)  # others are of further joints
    seconds, values, sent = seconds[some], values[some], sent[some]
    if sent.all():
        _, first = np.unique(seconds, return_index=True)
        if len(first) < len(seconds):
            dropped = f"{len(seconds) - len(first)} {role} messages with a stamp that was there already dropped"
            findings.repairs.append(dropped)
        return [(seconds[first], values[first])]
    findings.repairs.append(f"{role} messages that hold some of {len(columns)} motors each put together")
    series = []
    for column in range(len(columns)):
        at = np.flatnonzero(sent[:, column])
        _, first = np.unique(seconds[at], return_index=True)
        series.append((seconds[at[first]], values[at[first]][:, [column]]))
    return series


def _side_by_side(series: list[Series]) -> Series:
    """Times and columns of all, on straight lines between their samples, from when each has one."""
    if len(series) == 1:
        return series[0]
    if not all(len(time) for time, _ in series):
        return np.empty(0), np.empty((0, len(series)))
    instants = np.unique(np.concatenate([time for time, _ in series]))
    instants = instants[instants >= max(time[0] for time, _ in series)]
    return instants, np.stack([np.interp(instants, time, column[:, 0]) for time, column in series], axis=1)


def _unwrapped(
    seconds: np.ndarray,
    counts: np.ndarray,
    motors: dict[str, MotorEntry],
    commanded: tuple[np.ndarray, np.ndarray] | None,
    findings: Findings,
) -> np.ndarray:
    """Measured angles (T, K) at times (T,) s of encoders that count one turn, without its jumps and whole turns off the
    commands (times (Tc,) s, angles (Tc, K))."""
    counts = counts.copy()
    for column, (name, motor) in enumerate(motors.items()):
        turn, angles = motor.full_turn, counts[:, column]
        good = np.isfinite(angles)
        if turn is None or not good.any() or np.ptp(angles[good]) > turn:
            continue
        jumps = int(np.sum(np.abs(np.diff(angles[good])) > turn / 2))
        angles = np.unwrap(angles[good], period=turn)
        off = 0.0
        if commanded is not None and len(commanded[0]):
            sent = np.interp(seconds[good], commanded[0], commanded[1][:, column])
            off = float(np.median(angles - sent)) / turn
        turns = round(off)
        if not jumps and (not turns or abs(off - turns) > NEAR_TURN):
            continue
        counts[good, column] = angles - turns * turn
        what = f"{jumps} jumps by a turn" if jumps else f"{turns} turns"
        findings.repairs.append(f"{name!r}: {what} of an encoder that counts one turn taken out of what is measured")
    return counts


def _check_step(stream: JointStream, role: str, findings: Findings) -> bool:
    """Warn where the clock of a stream's messages jumps against the recorder's; returned: whether it does."""
    stamps, logged = (1e-9 * (some - some[0]) for some in (stream.stamps, stream.log_times))
    step = find_step(logged, stamps) if np.ptp(logged) and np.ptp(stamps) else None
    if step is not None:
        place = f"at message {step.at}, after {stamps[step.at - 1]:.2f} s, against log times"
        remedy = "expected a clock that runs evenly, such as `clock: log` in session.yaml"
        findings.warnings.append(f"{role} stamps jump by {-step.size:+.3f} s {place}: {remedy}")
    return step is not None


def _check_rate(stream: JointStream, role: str, where: str, findings: Findings) -> None:
    """Refuse stamps of a clock that is faster or slower than that of the poses, by what one recorder had of both: then
    no offset dates the motors."""
    poses, logged = findings.logged, 1e-9 * (stream.log_times - stream.log_times[0])
    if poses is None or len(logged) < FEWEST or not np.ptp(logged) or not np.ptp(stream.stamps):
        return
    fit = fit_frames(stream.stamps, logged)
    off = poses.rate / fit.rate - 1
    if abs(off) <= max(RATE, CERTAIN * max(fit.jitter, poses.jitter) / np.ptp(logged)):
        return
    rates = f"{100 * abs(off):.3g} % {'faster' if off > 0 else 'slower'} than the stamps of the poses, by log times"
    remedy = "expected clocks of one rate: `clock: log` in session.yaml dates both by log times"
    raise InputError(f"{where}: {stream.topic}: {role} stamps run {rates}, {remedy}")


def _one_publisher(seconds: np.ndarray, pulls: np.ndarray, unit: str, where: str, findings: Findings) -> None:
    """Refuse commands (T, K) in `unit` at times (T,) s of two publishers, which no motor could follow; warn of a few
    jumps."""
    places = to_and_fro(seconds, pulls, PULLED[unit])
    if not places:
        return
    begin = seconds[places[0][0] + 1]
    most = max(size for *_, size in places)
    far = f"{most:.3g} N" if unit == FORCE else f"{1e3 * most:.3g} mm"
    times = "once" if len(places) == 1 else f"{len(places)} times"
    problem = (
        f"commands jump to and fro {times}, by up to {far}, first at {begin:.2f} s, and "
        "are back with the next message or two: do two publishers write to the topic? expected one"
    )
    if len(places) >= OFTEN:
        raise InputError(f"{where}: {problem}")
    findings.warnings.append(problem)


def _columns(stream: JointStream, mapped: dict[str, str] | None, tendons: tuple[str, ...], where: str) -> list[int]:
    """Where each of `tendons` is in the stream. With a map, a topic may carry either name, and further joints."""
    names = list(stream.names)
    if mapped is None:
        if not set(tendons) <= set(names):
            expected = f"expected {', '.join(tendons)} as in the other topic"
            raise InputError(f"{where}: found {', '.join(names)}, {expected}")
        return [names.index(name) for name in tendons]
    columns = []
    for logged, tendon in mapped.items():
        if logged not in names and tendon not in names:
            raise InputError(f"{where}: found {', '.join(names)}, expected {logged!r} as in session.yaml")
        columns.append(names.index(logged if logged in names else tendon))
    return columns


def _logged_within(stream: JointStream, stretch: Stretch, limit: float) -> bool:
    """Whether the recorder had messages of the stream within `limit` s of the stretch."""
    seconds = 1e-9 * (stream.log_times - stretch.logged)
    return bool(np.any((seconds > -limit) & (seconds < stretch.time[-1] + limit)))


def _distance(stream: JointStream, recorder: bool, stretch: Stretch) -> str:
    """How far the stream's nearest message is from the trial, in words; nothing where it has none."""
    if not len(stream.stamps):
        return ""
    seconds = (dated(stream, recorder, stretch) - stretch.epoch) * 1e-9
    apart = np.maximum(np.maximum(-seconds, seconds - stretch.time[-1]), 0)
    nearest = int(apart.argmin())
    if apart[nearest] == 0:
        return ", none finite"
    return f", {apart[nearest]:.3f} s {'before' if seconds[nearest] < 0 else 'after'} the poses"
