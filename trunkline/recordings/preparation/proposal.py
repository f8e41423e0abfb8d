"""A session.yaml proposed from what logs show. Every guess is one that the experimenter can see and correct."""

import re

import numpy as np

from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.preparation.survey import LogSurvey
from trunkline.recordings.signals.clock import MIN_TRAVEL
from trunkline.recordings.signals.units import likely_unit
from trunkline.recordings.trials.experiments import EXPERIMENTS, PULL, TILT
from trunkline.recordings.trials.splits import IDENTIFY, VALIDATE

BASE_NAMES = ("base", "mount", "root", "origin")
GUESSED = "  # up as if the arm hangs: no log tells it of a mount that is turned"
RESTING = 5e-3  # m; a trial whose every body stays within this, but for its worst hundredth, is at rest


def propose(surveys: list[LogSurvey], up: tuple[int, int, int] | None = None) -> str:
    """The text of a session.yaml for logs of one folder; empty where none of them holds poses.

    up: the axis against gravity, where the logs' maker says it.
    """
    usable = [(survey, survey.poses) for survey in surveys if survey.poses is not None and len(survey.poses.stamps)]
    if not usable:
        return ""
    best, poses = max(usable, key=lambda pair: len(pair[1].names))
    streams = [stream for _, stream in usable]
    unit = likely_unit([stream.positions for stream in streams]) or "m"
    scale = 1e-3 if unit == "mm" else 1.0
    base = next((name for word in BASE_NAMES for name in poses.names if word in name.lower()), None)
    guessed, up = up is None, up or _up(poses, base)
    frame = f"up: {list(up)}, unit: {unit}"
    if len(poses.parents) > 1:
        frame += f", name: {poses.parents[0]}"
    lines = [
        "# Proposed from the logs. Check `up` (against gravity), each trial's experiment, level and split.",
        f"frame: {{{frame}}}{GUESSED if guessed else ''}",
    ]
    if base is not None:
        lines.append(f"base: {_quoted(base)}")
    else:
        place = [round(float(x), 4) for x in np.nanmean(poses.positions[:, 0], axis=0) * scale]
        lines.append(f"base: {{position: {place}}}  # no body marks the mount: measure it")
    lines += [f"clock: {_clock(streams)}", *_topics(best)]
    if poses.unnamed is not None:
        lines.append(f"bodies: {_list(poses.names)}  # names of the poses, in order; one is the base")
    joints = [stream for stream in (best.commands, best.tendon_positions) if stream is not None]
    if any(stream.unnamed is not None for stream in joints):
        names = next(stream.names for stream in joints if stream.unnamed is not None)
        lines.append(f"tendons: {_list(f'tendon_{name}' for name in names)}")
    elif joints and not any(name.startswith("tendon_") for name in joints[0].names):
        lines.append(f"# The logs have {_list(joints[0].names)}: `tendons` or `motors` is to say what each winds in.")
    lines.append("trials:")
    trials = [
        (survey.log.path, *_experiment(survey, stream, base, np.array(up), scale)) for survey, stream in usable
    ]
    for index, (path, experiment, level) in enumerate(trials):
        later = [other for _, other, _ in trials[index + 1 :]]
        earlier = [other for _, other, _ in trials[:index]]
        split = VALIDATE if experiment in earlier and experiment not in later else IDENTIFY
        level_text = "" if level is None else f", level: {level:g}"
        lines.append(f"  - {{file: {_quoted(path.name)}, experiment: {experiment}{level_text}, split: {split}}}")
    return "\n".join(lines) + "\n"


def _up(poses: PoseStream, base: str | None) -> tuple[int, int, int]:
    """The axis along which the first body, or the base, is above the last at the end: an arm hangs."""
    names = poses.names
    markers = [i for i, name in enumerate(names) if name != base]
    first = names.index(base) if base is not None else markers[0]
    ends = poses.positions[-max(1, len(poses.positions) // 5) :]
    if first == markers[-1]:
        return 0, 0, 1
    hang = np.nanmean(ends[:, first], axis=0) - np.nanmean(ends[:, markers[-1]], axis=0)
    if not np.isfinite(hang).all():
        return 0, 0, 1
    axis = int(np.argmax(np.abs(hang)))
    x, y, z = (int(np.sign(hang[axis])) if i == axis else 0 for i in range(3))
    return x, y, z


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
    return ["topics: {" + ", ".join(f"{key}: {name}" for key, name in named.items() if name) + "}"]


def _experiment(
    survey: LogSurvey, poses: PoseStream, base: str | None, up: np.ndarray, scale: float
) -> tuple[str, float | None]:
    """(experiment, level) by the file's name, or else by what moves."""
    names = {word: name for name, kind in EXPERIMENTS.items() for word in kind.words}
    word = re.match(rf"(?:.*_)?({'|'.join(names)})", survey.log.path.stem.lower())
    wound = survey.tendon_positions or survey.commands
    pull = 0.0 if wound is None or not wound.positions.size else float(np.nanmax(np.ptp(wound.positions, axis=0)))
    positions = poses.positions
    travel = np.nanpercentile(np.abs(positions - np.nanmedian(positions, axis=0)), 99) * scale
    if word:
        experiment = names[word[1]]
    else:
        rests = pull <= MIN_TRAVEL and travel < RESTING
        motors = survey.commands or survey.tendon_positions  # encoders may start anywhere
        pulled = motors is not None and np.nan_to_num(motors.positions).max(initial=0.0) > MIN_TRAVEL
        signs = (pull > MIN_TRAVEL or (rests and pulled), rests)
        experiment = next(name for name, kind in EXPERIMENTS.items() if (kind.needs_motors, kind.static) == signs)
    level = EXPERIMENTS[experiment].level
    if level is PULL:
        return experiment, round(1e3 * pull)
    return experiment, _tilt(poses, base, up) if level is TILT else None


def _tilt(poses: PoseStream, base: str | None, up: np.ndarray) -> float:
    """Degrees between the base's z axis and up; 0 where no base tells."""
    if base is None or poses.quaternions is None or base not in poses.names:
        return 0.0
    w, x, y, z = np.nanmedian(poses.quaternions[:, poses.names.index(base)], axis=0)
    axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return float(np.round(np.degrees(np.arccos(np.clip(axis @ up / np.linalg.norm(axis), -1, 1)))))


def _quoted(name: str) -> str:
    """A name as YAML keeps it: one that looks like a number, or holds signs, in quotes."""
    return name if re.fullmatch(r"[A-Za-z_][\w./-]*", name) else f'"{name}"'


def _list(names) -> str:
    return "[" + ", ".join(_quoted(name) for name in names) + "]"
