"""Demonstrations in a recording: from when the robot was let move until it was done, at even times."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from trunkline.ar.dataset.recording import RecordedStep, SessionRecording
from trunkline.ar.session.preview_validation import Execution, executions
from trunkline.ar.teleop.messages import Targets, Vector, WorldObject
from trunkline.errors import InputError

LEADING = ("aim", "plan", "preview", "ready", "delay")  # modes in which a user leads up to an execution
XYZ = ("x", "y", "z")
GOAL = (
    *(f"rigid.{axis}" for axis in XYZ), *(f"tip.{axis}" for axis in XYZ), *(f"pointing.{axis}" for axis in XYZ),
    "heading", "thing.known", *(f"thing.{axis}" for axis in XYZ),
)  # fmt: skip
RAYS = tuple(f"{hand}.{what}" for hand in ("left", "right") for what in ("known", *XYZ))
STATE, ACTION, ENVIRONMENT, OPERATOR = (
    "observation.state",
    "action",
    "observation.environment_state",
    "observation.rays",
)
DONE, SUCCESS = "next.done", "next.success"
FEWEST = 2  # frames
NEAR = 1.0  # s between a step that executes and when the robot was told to


@dataclass(frozen=True)
class Episode:
    """`task` in words; `succeeded`, and how it ended; T frames, each feature's values of shape (T, C), or (T,) of
    booleans; names of a feature's values."""

    task: str
    succeeded: bool
    end: str
    frames: dict[str, np.ndarray]
    names: dict[str, tuple[str, ...]]


def episodes(recording: SessionRecording, fps: int, aiming: bool = False) -> Iterator[Episode]:
    """In their order.

    A frame has what was last told by its time. Its action is what was last sent by the next frame's time.

    Args:
        aiming: whether an execution's episode begins where the user began to aim, instead of where the robot began.
    """
    judged, steps = list(executions(recording.logbook)), recording.steps
    for motion, run in groupby(range(len(steps)), lambda n: steps[n].intent.motion):
        rows = list(run)
        if motion == "hold":
            continue
        first = rows[0]
        if motion == "execute":
            end, succeeded = _judged(recording, judged, steps[first])
            goals = _planned(recording, first)
            while aiming and first > 0 and steps[first - 1].intent.mode in LEADING and steps[first - 1].intent.targets:
                first -= 1
        else:
            after = steps[rows[-1] + 1].intent.mode if rows[-1] + 1 < len(steps) else "stopped"
            end, succeeded, goals = ("stopped" if after == "stopped" else "done"), after != "stopped", None
        until = steps[min(rows[-1] + 1, len(steps) - 1)].time
        count = int((until - steps[first].time) * fps // 1_000_000_000) + 1
        if count < FEWEST:
            continue
        times = steps[first].time + np.arange(count) * 1_000_000_000 // fps
        yield _episode(recording, rows[-1], times, fps, goals, end, succeeded)


def _episode(
    recording: SessionRecording,
    last: int,
    times: np.ndarray,
    fps: int,
    planned: Targets | None,
    end: str,
    succeeded: bool,
) -> Episode:
    """At `times`; `last` is the number of the last step in which the robot was let move."""
    began = np.array([step.time for step in recording.steps[: last + 1]])
    steps = [recording.steps[n] for n in np.searchsorted(began, times, side="right") - 1]
    wanted = [_wanted(step, planned) for step in steps]
    state = np.concatenate([recording.measured.at(times), recording.tip.at(times)], axis=1)
    frames = {
        STATE: state,
        ENVIRONMENT: np.array([_goal(targets, step) for targets, step in zip(wanted, steps, strict=True)]),
        OPERATOR: np.array([_rays(step.intent.rays) for step in steps]),
        ACTION: recording.sent.at(times + 1_000_000_000 // fps),
        DONE: np.arange(len(times)) == len(times) - 1,
        SUCCESS: (np.arange(len(times)) == len(times) - 1) & succeeded,
    }
    names = {STATE: (*recording.measured.names, *recording.tip.names), ENVIRONMENT: GOAL, OPERATOR: RAYS,
             ACTION: recording.sent.names}  # fmt: skip
    for feature, values in names.items():
        if not np.isfinite(frames[feature]).all():
            column = values[int(np.argmin(np.isfinite(frames[feature]).all(axis=0)))]
            raise InputError(
                f"{recording.path}: {feature}: {column}: found nothing told of it by the first frame, or no number, "
                "expected a number for each frame"
            )
    return Episode(_task(wanted[-1], steps[-1], followed=planned is None), succeeded, end, frames, names)


def _judged(recording: SessionRecording, judged: list[Execution], step: RecordedStep) -> tuple[str, bool]:
    """How the execution that begins at a step ended, and whether what was wanted came about."""
    logbook = recording.logbook
    since = 1e-9 * (step.time - logbook.zero) - logbook.begin["time"]
    same = [
        execution
        for execution in judged
        if execution.digest == step.intent.execute and abs(execution.time - since) < NEAR
    ]
    if not same:
        return "refused by the robot", False
    execution = min(same, key=lambda execution: abs(execution.time - since))
    if execution.success is False:
        return "not held", False
    return execution.end, execution.end == "done"


def _planned(recording: SessionRecording, first: int) -> Targets | None:
    """Those for which the plan was asked for that is executed from step number `first` on."""
    step = recording.steps[first]
    reports = {
        e["report"]["digest"]: e["report"]["serial"] for e in recording.logbook.events if e["event"] == "planned"
    }
    serial = reports.get(step.intent.execute)
    for other in reversed(recording.steps[:first]):
        request = other.intent.request
        if request is not None and request.serial == serial:
            return request.targets
    return step.intent.targets


def _wanted(step: RecordedStep, planned: Targets | None) -> Targets:
    targets = planned if step.intent.motion == "execute" else step.intent.follow or step.intent.targets
    if targets is None:
        raise InputError(f"/core/intent: found no targets in mode {step.intent.mode!r}, expected those of what moves")
    return targets


def _goal(targets: Targets, step: RecordedStep) -> list[float]:
    object = _object(targets, step)
    object_pose = [0.0, 0.0, 0.0, 0.0] if object is None else [1.0, *object.position]
    return [*targets.rigid.position, *targets.tip.position, *targets.pointing, targets.heading, *object_pose]


def _object(targets: Targets, step: RecordedStep) -> WorldObject | None:
    """What is to be grasped or brought, where it is believed to be."""
    return next((object for object in step.message.world.objects if object.name == targets.object), None)


def _rays(rays: tuple[Vector | None, Vector | None]) -> list[float]:
    return [x for ray in rays for x in ([0.0, 0.0, 0.0, 0.0] if ray is None else [1.0, *ray])]


def _task(targets: Targets, step: RecordedStep, followed: bool) -> str:
    object = _object(targets, step)
    if followed:
        return f"carry the {object.shape} along with the hands" if object else "follow the hands with mount and tip"
    if object is None:
        return "bring the mount and the soft arm's tip to their targets"
    return f"bring the {object.shape} to the target" if object.support == "held" else f"grasp the {object.shape}"
