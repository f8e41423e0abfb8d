"""What a trial must have, and what is said about one that had to be repaired."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Annotated, TypeVar

import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.recordings.logs.mcap_log import Log
from trunkline.recordings.signals.clock import FrameFit, LoggedOffset, OffsetFit
from trunkline.recordings.trials.splits import IDENTIFY

Item = TypeVar("Item")


@dataclass
class TrialLimits:
    """What a trial must have. duration: s. coverage: share of frames in which a body is seen.

    disorder: s by which a stamp may be behind one before it and still be sorted in.
    clock_offset: s, the largest looked for between motors and cameras.
    """

    duration: Annotated[float, Field(gt=0, le=3600)]
    coverage: Annotated[float, Field(gt=0, le=1)]
    disorder: Annotated[float, Field(gt=0, le=60)]
    clock_offset: Annotated[float, Field(gt=0, le=60)]


@dataclass
class Findings:
    """What came out about a raw trial. repairs, warnings: one sentence each; what a warning names is left as it is.

    faults: what cannot be true of the arm and the experiment, a sentence each; see `plausible`.
    where: the file and the trial, for messages.
    frames: stamps over frame numbers. logged: stamps over log times in s.
    by_log_times, by_motion: the offset of the motors' clock. log: that the trial is from, without its messages.
    frame_names: of the frames that its poses are in, as messages name them.
    """

    repairs: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    where: str = ""
    frames: FrameFit | None = None
    logged: FrameFit | None = None
    by_log_times: LoggedOffset | None = None
    by_motion: OffsetFit | None = None
    log: Log | None = None
    frame_names: tuple[str, ...] = ()

    def dropped(self, bad: np.ndarray, what: str, names: list[str]) -> None:
        """Note the samples `bad` (T, B) of the bodies `names` as dropped, if there are any."""
        if bad.any():
            where = ", ".join(name for name, hit in zip(names, np.any(bad, axis=0), strict=True) if hit)
            self.repairs.append(f"{int(bad.sum())} samples {what} dropped ({where})")


def deciding(items: Iterable[Item], split: Callable[[Item], str]) -> tuple[list[Item], bool]:
    """(those of the split `identify`, whether there are none of it and all decide instead).

    What a session's trials agree on changes all of them, so those that are to be unseen until they score have no say.
    """
    items = list(items)
    chosen = [item for item in items if split(item) == IDENTIFY]
    return (chosen, False) if chosen else (items, bool(items))


def in_order(
    stamps: np.ndarray, disorder: float, where: str, findings: Findings, at_once: bool = False
) -> np.ndarray:
    """Rows in the order of time; refused if time runs back by more than `disorder` s. Each instant once, unless several
    may come `at_once`."""
    back = np.maximum.accumulate(stamps) - stamps
    if back.max(initial=0) > disorder * 1e9:
        worst = int(np.argmax(back > disorder * 1e9))
        problem = f"time runs backwards by {back[worst] * 1e-9:.3f} s at message {worst}"
        raise InputError(f"{where}: {problem}, expected no step back beyond {disorder:g} s")
    rows = np.argsort(stamps, kind="stable")
    if np.any(back > 0):
        findings.repairs.append(f"{int(np.sum(back > 0))} frames out of order sorted by their stamps")
    return rows if at_once else instants(stamps, rows, findings)


def instants(stamps: np.ndarray, rows: np.ndarray, findings: Findings) -> np.ndarray:
    """Rows in the order of time, each instant once."""
    fresh = np.diff(stamps[rows], prepend=stamps[rows[0]] - 1) > 0
    if not fresh.all():
        findings.repairs.append(f"{int(np.sum(~fresh))} frames with a stamp that was there already dropped")
    return rows[fresh]
