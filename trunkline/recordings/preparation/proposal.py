"""A session.yaml proposed from what logs show. Every guess is one that the experimenter can see and correct."""

import os
import re
from pathlib import Path

import numpy as np

from trunkline.recordings.logs.bag2 import recording_name
from trunkline.recordings.logs.joint_stream import JointStream
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.preparation.survey import LogSurvey
from trunkline.recordings.preparation.vertical import (
    ALONG,
    Axis,
    at_rest,
    nearest_axis,
    pulled,
    up_by_hanging,
    up_by_sags,
)
from trunkline.recordings.signals.clock import MIN_TRAVEL
from trunkline.recordings.signals.units import METRES_PER, likely_unit, other_units
from trunkline.recordings.trials.experiments import EXPERIMENTS, PULL, TILT
from trunkline.recordings.trials.splits import IDENTIFY, VALIDATE

BASE_NAMES = ("base", "mount", "root", "origin")
GUESSED = "  # up as if the arm hangs: no log tells it of a mount that is turned"
UNUSUAL = "  # not {}: the arm hangs along another axis"
RESTING = 5e-3  # m; a trial whose every body stays within this, but for its worst hundredth, is at rest


def propose(surveys: list[LogSurvey], ups: tuple[Axis, ...] = (), folder: Path | None = None) -> str:
    """The text of a session.yaml for logs of one folder; empty where none of them holds poses.

    Args:
        ups: axes that may be up, where the logs' maker says so, the usual one first.
        folder: of the session; by default the innermost that holds all the logs.
    """
    usable = [(survey, survey.poses) for survey in surveys if survey.poses is not None and len(survey.poses.stamps)]
    if not usable:
        return ""
    best, poses = max(usable, key=lambda pair: len(pair[1].names))
    streams = [stream for _, stream in usable]
    unit = best.unit or likely_unit([stream.positions for stream in streams]) or "m"
    scale = METRES_PER[unit]
    base = next((name for word in BASE_NAMES for name in poses.names if word in name.lower()), None)
    by_sags = up_by_sags([survey for survey, _ in usable], base)
    up, comment = _up(by_sags, best, [survey for survey, _ in usable], base, ups)
    frame = f"up: {list(up)}, unit: {unit}"
    if len(poses.parents) > 1:
        frame += f", name: {poses.parents[0]}"
    lines = [
        "# Proposed from the logs. Check `up` (against gravity), each trial's experiment, level and split.",
        f"frame: {{{frame}}}{comment}",
    ]
    if best.unit is None and (doubtful := other_units([stream.positions for stream in streams], unit)):
        lines.append(f"# The unit is a guess by the bodies' distances: {doubtful}.")
    elif best.tables and best.unit is None:
        lines.append("# The unit is a guess: no name of a column tells it.")
    if base is not None and poses.quaternions is not None:
        lines.append(f"base: {_quoted(base)}")
    elif base is not None:
        place = [round(float(x), 4) for x in np.nanmedian(poses.positions[:, poses.names.index(base)], axis=0) * scale]
        lines.append(f"base: {{position: {place}}}  # of {base!r}, and upright, as no log tells how it is turned")
        others = ", ".join(f"{_quoted(name)}: {_quoted(name)}" for name in poses.names if name != base)
        lines.append(f"markers: {{{others}}}")
    else:
        place = [round(float(x), 4) for x in np.nanmean(poses.positions[:, 0], axis=0) * scale]
        lines.append(f"base: {{position: {place}}}  # no body marks the mount: measure it")
    lines += [f"clock: {_clock(streams)}", *(best.tables or _topics(best))]
    if poses.unnamed is not None:
        lines.append(f"bodies: {_list(poses.names)}  # names of the poses, in order; one is the base")
    joints = [stream for stream in (best.commands, best.tendon_positions) if stream is not None]
    if any(stream.unnamed is not None for stream in joints):
        names = next(stream.names for stream in joints if stream.unnamed is not None)
        lines.append(f"tendons: {_list(f'tendon_{name}' for name in names)}")
    elif joints and not best.tables and not any(name.startswith("tendon_") for name in joints[0].names):
        lines.append(f"# The logs have {_list(joints[0].names)}: `tendons` or `motors` is to say what each winds in.")
    lines.append("trials:")
    root = folder or Path(os.path.commonpath([survey.log.path.parent for survey, _ in usable]))
    files = [survey.log.path.relative_to(root) for survey, _ in usable]
    plain = [recording_name(file.name) for file in files]
    pairs = zip(files, plain, strict=True)
    named = [f"{file.parent.name}_{name}" if plain.count(name) > 1 else "" for file, name in pairs]
    # a level that is computed with a guess of the vertical could not contradict it
    trials = [_experiment(survey, stream, base, by_sags, scale) for survey, stream in usable]
    for index, (file, name, (experiment, level)) in enumerate(zip(files, named, trials, strict=True)):
        later = [other for other, _ in trials[index + 1 :]]
        earlier = [other for other, _ in trials[:index]]
        split = VALIDATE if experiment in earlier and experiment not in later else IDENTIFY
        level_text = "" if level is None else f", level: {level}"
        name_text = f", name: {_quoted(name)}" if name else ""
        if (label := usable[index][0].label) is not None:
            name_text = f", label: {_quoted(label)}"
        lines.append(
            f"  - {{file: {_quoted(file.as_posix())}{name_text}, experiment: {experiment}{level_text}, split: {split}}}"
        )
    if any(level is None and EXPERIMENTS[experiment].level is TILT for experiment, level in trials):
        lacks = "`up`" if by_sags is None else "a base whose z axis is back along the arm"
        why = f"no log tells it without {lacks}"
        lines.append(f"# Add the `level` that you set of each static_tilt, in degrees: {why}.")
    if any(level is None and EXPERIMENTS[experiment].level is PULL for experiment, level in trials):
        why = "what its log holds is no pull of this arm in m"
        lines.append(f"# Add the `level` of each curl that has none, in mm: {why}; `motors` says what motors count.")
    return "\n".join(lines) + "\n"


def _up(
    by_sags: Axis | None, best: LogSurvey, surveys: list[LogSurvey], base: str | None, ups: tuple[Axis, ...]
) -> tuple[Axis, str]:
    """(up, the comment behind it)."""
    if by_sags is not None and (not ups or by_sags in ups):
        return by_sags, UNUSUAL.format(list(ups[0])) if ups and by_sags != ups[0] else ""
    if ups:
        hangs = up_by_hanging(surveys, base)
        other = hangs is not None and hangs[1] and hangs[0] in ups[1:]
        return (hangs[0], UNUSUAL.format(list(ups[0])) + ", or lies") if hangs is not None and other else (ups[0], "")
    resting = [survey for survey in surveys if at_rest(survey, base) is not None]
    hangs = up_by_hanging(resting or [best], base)
    return (hangs[0] if hangs is not None else _up_at_end(best.poses, base)), GUESSED


def _up_at_end(poses: PoseStream | None, base: str | None) -> Axis:
    """The axis along which the first body, or the base, is above the last at the end: an arm hangs."""
    assert poses is not None, "of a log with poses"
    names = poses.names
    markers = [i for i, name in enumerate(names) if name != base]
    first = names.index(base) if base is not None else markers[0]
    ends = poses.positions[-max(1, len(poses.positions) // 5) :]
    if first == markers[-1]:
        return 0, 0, 1
    hang = np.nanmean(ends[:, first], axis=0) - np.nanmean(ends[:, markers[-1]], axis=0)
    if not np.isfinite(hang).all():
        return 0, 0, 1
    return nearest_axis(hang)


def _clock(streams: list[PoseStream]) -> str:
    if any(not stream.stamps.any() for stream in streams):
        return "log"
    numbered = all(s.frames is not None and np.all(np.diff(s.frames) > 0) for s in streams)
    return "frame" if numbered else "stamp"


def _topics(survey: LogSurvey) -> list[str]:
    by_body = {body: topic.name for body, topic in survey.pose_topics.items() if body is not None}
    if by_body:
        poses = "{" + ", ".join(f"{_quoted(body)}: {name}" for body, name in by_body.items()) + "}"
    else:
        poses = next(iter(survey.pose_topics.values())).name
    named = {"poses": poses, "commands": survey.command_topic, "tendon_positions": survey.position_topic}
    return ["topics: {" + ", ".join(f"{key}: {_topic(name)}" for key, name in named.items() if name) + "}"]


def _experiment(
    survey: LogSurvey, poses: PoseStream, base: str | None, up: Axis | None, scale: float
) -> tuple[str, str | None]:
    """(experiment, level) by the file's name, or its folder's, or else by what moves. up: None where nobody knows."""
    names = {word: name for name, kind in EXPERIMENTS.items() for word in kind.words}
    path = survey.log.path
    words = (re.match(rf"(?:.*_)?({'|'.join(names)})", name.lower()) for name in (path.stem, path.parent.name))
    word = next(words) or (next(words) if not re.search("[A-Za-z]{3}", path.stem) else None)
    wound = survey.tendon_positions or survey.commands
    travels = _largest_travel(wound.positions) if wound is not None and wound.positions.size else 0.0
    positions = poses.positions
    travel = np.nanpercentile(np.abs(positions - np.nanmedian(positions, axis=0)), 99) * scale
    if word:
        experiment = names[word[1]]
    else:
        rests = travels <= MIN_TRAVEL and travel < RESTING
        signs = (travels > MIN_TRAVEL or (rests and pulled(survey)), rests)
        experiment = next(name for name, kind in EXPERIMENTS.items() if (kind.needs_motors, kind.static) == signs)
    level = EXPERIMENTS[experiment].level
    if level is PULL:
        drawn = round(1e3 * _drawn_in(survey.commands, survey.tendon_positions))
        return experiment, f"{drawn:g}" if 0 < drawn <= 1e3 * _longest(poses, scale) else None
    if level is not TILT:
        return experiment, None
    arm = at_rest(survey, base)
    askew = arm is not None and arm.base is not None and -arm.first @ arm.base[:, 2] < ALONG
    return experiment, None if up is None or askew else f"{_tilt(poses, base, np.array(up)):g}"


def _drawn_in(commands: JointStream | None, measured: JointStream | None) -> float:
    """The largest pull in, m, by commands where there are: from the straight arm or, if less, from the log's begin."""
    stream = commands if commands is not None and commands.positions.size else measured
    if stream is None or not stream.positions.size:
        return 0.0
    pulls, first = stream.positions, stream.positions[:1]
    highest = float(np.nanmax(pulls - first))
    if stream is commands:
        highest = min(highest, float(np.nanmax(pulls)))
    return highest if highest > 0 else _largest_travel(pulls)


def _longest(poses: PoseStream, scale: float) -> float:
    """The largest usual distance between two bodies, m, by which no tendon is drawn in; of one body no limit."""
    places = np.nanmedian(poses.positions, axis=0)
    apart = np.nanmax(np.linalg.norm(places[:, None] - places, axis=-1)) * scale
    return float(apart) if apart > 0 else np.inf


def _largest_travel(positions: np.ndarray) -> float:
    """Between the ends of the way of the motor that goes farthest, of positions (T, K) with gaps."""
    return float(np.nanmax(np.nanmax(positions, axis=0) - np.nanmin(positions, axis=0)))


def _tilt(poses: PoseStream, base: str | None, up: np.ndarray) -> float:
    """Degrees between the base's z axis and up; 0 where no base tells."""
    if base is None or poses.quaternions is None or base not in poses.names:
        return 0.0
    w, x, y, z = np.nanmedian(poses.quaternions[:, poses.names.index(base)], axis=0)
    axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return float(np.round(np.degrees(np.arccos(np.clip(axis @ up / np.linalg.norm(axis), -1, 1)))))


def _topic(names: str) -> str:
    """As YAML has a topic, or several."""
    return f"[{names}]" if ", " in names and not names.startswith("{") else names


def _quoted(name: str) -> str:
    """A name as YAML keeps it: one that looks like a number, or holds signs, in quotes."""
    return name if re.fullmatch(r"[A-Za-z_][\w./-]*", name) else f'"{name}"'


def _list(names) -> str:
    return "[" + ", ".join(_quoted(name) for name in names) + "]"
