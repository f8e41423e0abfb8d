"""The kinds of experiment: what each is, in one table that every room reads.

A new kind is one entry here, and a detector in `start` if none there tells when it begins. Then sessions may name
it, `ingest` and `filter` know what to do with it, an identification stage can list it in its configuration, and the
reference of sessions and the tables of results have its words.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from trunkline.recordings.trials.start import Smooth, Start, cycle_time, free_time, release_time
from trunkline.recordings.trials.trial import Trial


@dataclass(frozen=True)
class Level:
    """What a number of a trial says. unit: "deg", "mm" or "kg". low, high: what session.yaml may name."""

    says: str
    unit: str
    low: float
    high: float


TILT = Level("degrees of tilt", "deg", 0.0, 180.0)
PULL = Level("mm of pull", "mm", 1.0, 10_000.0)  # below, metres were meant
LOAD = Level("kg at the tip", "kg", 0.0, 5.0)  # above, grams were meant; of a trial of any kind


@dataclass(frozen=True)
class ExperimentKind:
    """level: of a trial, None where it has none.

    what: is done in a trial, in a few words. plural: what several trials are called.
    static: the arm rests throughout; a trial is averaged over time to one frame, and its model settles to rest.
    needs_motors: refused without commands or tendon positions.
    words: in the name of a log that is proposed to be one.
    start: when a moving trial begins, by its filtered positions and commands, and the low-pass of the former; see
        the module `start`.
    free: when the last hand is off, s, where that may be later than `start` says.
    stepwise: the arm rests in every frame of a static trial, moved in between: each is a shape of its own.
    hangs: at its end, the arm hangs at rest with nothing that pulls it.
    without: what to set for a session without it, where a stage identifies from it; "" where nothing helps.
    """

    what: str
    plural: str
    level: Level | None
    static: bool
    needs_motors: bool
    words: tuple[str, ...]
    start: Callable[[Trial, Smooth], Start] | None = None
    free: Callable[[Trial, float], float] | None = None
    stepwise: bool = False
    hangs: bool = False
    without: str = ""


EXPERIMENTS: dict[str, ExperimentKind] = {
    "static_tilt": ExperimentKind(
        what="at rest, the mount tilted",
        plural="static tilts",
        level=TILT,
        static=True,
        needs_motors=False,
        words=("static", "tilt"),
        without="`source: releases` under identify_stiffness, with `stiffness` and `damping` alone to identify",
    ),
    "release": ExperimentKind(
        what="held bent, then let go, no pull",
        plural="releases",
        level=None,
        static=False,
        needs_motors=False,
        words=("release",),
        start=lambda trial, smooth: release_time(trial.time, trial.positions, trial.measured, smooth),
        free=lambda trial, begin: free_time(trial.time, trial.positions, trial.measured, begin),
        hangs=True,
    ),
    "curl": ExperimentKind(
        what="tendons drawn in and paid out",
        plural="curls",
        level=PULL,
        static=False,
        needs_motors=True,
        words=("curl",),
        start=lambda trial, smooth: cycle_time(trial.time, trial.commands),
    ),
    "static_pull": ExperimentKind(
        what="at rest, tendons held at their commands",
        plural="static pulls",
        level=None,
        static=True,
        needs_motors=True,
        words=("pull",),
        without="`source: tilts` under identify_stiffness, and no `kp` or `capstan_friction` there",
    ),
    "static_path": ExperimentKind(
        what="at rest in every frame, tendons moved a step in between",
        plural="static paths",
        level=None,
        static=True,
        needs_motors=True,
        words=("path", "steps"),
        stepwise=True,
    ),
    "motion": ExperimentKind(
        what="anything else that is commanded",
        plural="motions",
        level=None,
        static=False,
        needs_motors=True,
        words=("motion",),
        start=lambda trial, smooth: cycle_time(trial.time, trial.commands),
        without="`experiments: [curl]` under identify_control",
    ),
}

if TYPE_CHECKING:
    ExperimentName = str
else:
    ExperimentName = Literal[tuple(EXPERIMENTS)]  # so that whoever names another is told which there are


def is_stepwise(experiment: str) -> bool:
    """Whether every frame of a trial of this kind is a shape at rest of its own."""
    return EXPERIMENTS[experiment].stepwise


def is_static(experiment: str) -> bool:
    """Whether the arm rests throughout a trial of this kind."""
    return EXPERIMENTS[experiment].static


def is_held(experiment: str) -> bool:
    """Whether motors hold the arm in one shape at rest throughout a trial of this kind."""
    kind = EXPERIMENTS[experiment]
    return kind.static and kind.needs_motors and not kind.stepwise
