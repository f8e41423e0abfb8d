"""The trials of a session for one look at them: from its logs, or as the stage `filter` wrote them."""

import sys
from functools import partial
from pathlib import Path
from typing import Any

from trunkline.compute.progress import progress
from trunkline.errors import InputError
from trunkline.pipeline.config import settings_of
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.quality import by_sentence, judge
from trunkline.recordings.cleaning.same_arm import check_each_session
from trunkline.recordings.cleaning.session_checks import CheckedSession, check_session, together
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.session.session import Session, session_folders
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import Trial, read_trials


def trials_of(folder: Path, root: Path, caller: str, arm: Places | None = None) -> list[Trial]:
    """Every trial of a session, of all splits, filtered; what is refused, repaired or doubtful is said on stderr.

    Args and errors as of `read_trials_of`.
    """
    return read_trials_of(folder, root, caller, arm)[0]


def read_trials_of(
    folder: Path, root: Path, caller: str, arm: Places | None = None
) -> tuple[list[Trial], list[RawTrial]]:
    """`trials_of`, and the raw trials that they were filtered from, in the same order; none where they came filtered.

    Args:
        folder: logs and session.yaml, several such folders of one arm, or what the stage `filter` writes.
        root: holds the params.yaml that says how to take logs in and to filter them.
        caller: the command, which begins what is said.
        arm: the described one, by which logs are checked; None where nobody describes it.

    Raises:
        InputError: it is no such folder, or no trial of it can be used.
    """
    if not (folder / "trials.parquet").is_file():
        return _from_logs(folder, root, caller, arm)
    try:
        trials = read_trials(folder, SPLITS)
    except KeyError as error:
        raise InputError(f"{folder}: found trials without {error}, expected filtered ones, or a session") from error
    if not trials:
        raise InputError(f"{folder}: found no trial, expected at least one")
    markers = trials[0].markers
    other = next((trial for trial in trials if trial.markers != markers), None)
    if other is not None:
        mismatch = f"found {len(other.markers)} markers, expected the {len(markers)} of {trials[0].name}"
        raise InputError(f"{folder}: trial {other.name}: {mismatch}")
    return trials, []


def _from_logs(folder: Path, root: Path, caller: str, arm: Places | None) -> tuple[list[Trial], list[RawTrial]]:
    ingest, settings = settings_of("ingest", root), settings_of("filter", root)
    raw = partial(_gathered, ingest=ingest, caller=caller, arm=arm)
    quality = check_each_session(session_folders(folder), raw, ingest.plausible.distance)
    gathered = together(list(quality.values()))
    for name, reason in gathered.refused.items():
        print(f"{caller}: left out {name}: {reason}", file=sys.stderr)
    qualities = [judge(raw, findings) for raw, findings in zip(gathered.raw_trials, gathered.findings, strict=True)]
    for line in by_sentence(qualities, lambda quality: quality.repairs):
        print(f"{caller}: repaired: {line}", file=sys.stderr)
    for line in by_sentence(qualities, lambda quality: quality.warnings):
        print(f"{caller}: warning: {line}", file=sys.stderr)
    trials = []
    for raw, quality in zip(gathered.raw_trials, gathered.findings, strict=True):
        raw.repairs = len(quality.repairs)
        trials.append(filter_raw_trial(raw, settings)[0])
    return trials, gathered.raw_trials


def _gathered(folder: Path, session: Session, ingest: Any, caller: str, arm: Places | None) -> CheckedSession:
    """ingest: settings of the stage."""
    taken = []
    with progress(len(session.trials), caller, "trials") as bar:
        for entry in load_raw_trials(folder, session, ingest.limits, arm):
            taken.append(entry)
            bar.update(1, trial=entry[0].name)
    return check_session(taken, session, ingest.plausible, "leave_out", f"{folder}", arm)
