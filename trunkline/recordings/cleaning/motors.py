"""The tendons of a trial: commands and measured positions around its frames."""

from dataclasses import dataclass

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import Findings, TrialLimits, in_order
from trunkline.recordings.cleaning.trial_window import Stretch
from trunkline.recordings.logs.joint_stream import JointStream
from trunkline.recordings.logs.messages import JOINTS
from trunkline.recordings.session.session import Session
from trunkline.recordings.session.source import LogSource
from trunkline.recordings.trials.experiments import is_held

ROLES = ("command", "tendon position")
HISTORY = 60.0  # s before an arm at rest under its motors in which its last motion is looked for


@dataclass
class MotorSignals:
    """What moves the tendons around a trial, each stream on its own times: as in a raw trial."""

    tendons: tuple[str, ...]
    command_time: np.ndarray
    commands: np.ndarray
    tendon_time: np.ndarray
    tendon_positions: np.ndarray


def read_motors(
    source: LogSource, session: Session, stretch: Stretch, experiment: str, limits: TrialLimits, where: str,
    findings: Findings,
) -> MotorSignals:  # fmt: skip
    """The messages near enough to the stretch, dated from its first frame; of commands that hold an arm at rest also
    those that brought it there.

    Raises:
        InputError: the tendons of a topic are not those of session.yaml, or of the other topic.
    """
    streams = [source.commands, source.tendon_positions]
    tendons = next((stream.names for stream in streams if stream is not None), ())
    mapped, coupling = session.tendons, None
    if session.tendons is not None:
        tendons = tuple(session.tendons.values())
    if session.motors is not None:
        mapped = {name: name for name in session.motors}
        tendons, coupling = session.coupling()
    recorder = by_recorder(source, session)
    arrays = []
    for stream, role in zip(streams, ROLES, strict=True):
        if stream is None or not len(stream.stamps):
            arrays += [np.empty(0), np.empty((0, len(tendons)))]
            continue
        columns = _columns(stream, mapped, tendons, f"{where}: {role} topic")
        stamps = dated(stream, recorder, stretch)
        if recorder and session.clock != "log":
            findings.repairs.append(f"{role} messages dated by the recorder's clock, as not all have stamps")
        rows = in_order(stamps, limits.disorder, f"{where}: {role} topic", findings)
        seconds = (stamps[rows] - stretch.epoch) * 1e-9
        pulls = stream.positions[rows][:, columns]
        if coupling is not None:
            pulls = pulls @ coupling.T
        earlier = HISTORY if role == "command" and is_held(experiment) else 0.0
        near = (seconds > -limits.clock_offset - earlier) & (seconds < stretch.time[-1] + limits.clock_offset)
        finite = np.isfinite(pulls).all(axis=1)
        if not finite.all():
            findings.repairs.append(f"{int(np.sum(~finite))} {role} messages that are not finite dropped")
        arrays += [seconds[near & finite], pulls[near & finite]]
    return MotorSignals(tuple(tendons), *arrays)


def check_motors(
    source: LogSource,
    session: Session,
    joint_topics: tuple[str, ...],
    motors: MotorSignals,
    stretch: Stretch,
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
        name = getattr(session.topics, key)
        if name is not None and name not in joint_topics:
            raise InputError(f"{where}: topics.{key}: found {name!r}, which no log has, expected one of: {others}")
    streams = (source.commands, source.tendon_positions)
    within = [bool(np.any(t > -limits.clock_offset)) for t in (motors.command_time, motors.tendon_time)]
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
    raise InputError(f"{where}: found {' and '.join(streams_found)}{topics}, {expected}")


def by_recorder(source: LogSource, session: Session) -> bool:
    """Whether the recorder's clock dates commands and positions: where that is meant, or one of them has no other."""
    streams = [stream for stream in (source.commands, source.tendon_positions) if stream is not None]
    return session.clock == "log" or any(not s.timed or not s.stamps.any() for s in streams if len(s.stamps))


def dated(stream: JointStream, recorder: bool, stretch: Stretch) -> np.ndarray:
    """When each message was sent, ns: by its header, or by the recorder, moved to the clock of the poses."""
    return stream.log_times + (stretch.epoch - stretch.logged) if recorder else stream.stamps


def _columns(stream: JointStream, mapped: dict[str, str] | None, tendons: tuple[str, ...], where: str) -> list[int]:
    """Where each of `tendons` is in the stream. With a map, a topic may carry either name, and further joints."""
    names = list(stream.names)
    if mapped is None:
        if set(names) != set(tendons):
            expected = f"expected {', '.join(tendons)} as in the other topic"
            raise InputError(f"{where}: found {', '.join(names)}, {expected}")
        return [names.index(name) for name in tendons]
    columns = []
    for logged, tendon in mapped.items():
        if logged not in names and tendon not in names:
            raise InputError(f"{where}: found {', '.join(names)}, expected {logged!r} as in session.yaml")
        columns.append(names.index(logged if logged in names else tendon))
    return columns


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
