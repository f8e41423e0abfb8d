"""Trials that share data: one file under two names, or windows of one file that overlap."""

from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

from trunkline.errors import InputError
from trunkline.files import file_digest
from trunkline.recordings.logs.bag2 import data_files

if TYPE_CHECKING:
    from trunkline.recordings.session.session import TrialEntry


def check_shared(folder: Path, trials: list["TrialEntry"]) -> dict[str, list[str]]:
    """Remarks on trials of one split that share data, by trial.

    Raises:
        InputError: trials of different splits share data, so that one split would score what the other fitted.
    """
    content = _contents(folder, sorted({trial.file for trial in trials}))
    remarks: dict[str, list[str]] = {}
    for first, second in combinations(trials, 2):
        if not content[first.file] & content[second.file] or first.label != second.label:
            continue
        if first.chosen is not None and second.chosen is not None and not {*first.chosen} & {*second.chosen}:
            continue
        whole = (float("-inf"), float("inf"))
        interval, other_interval = first.window or whole, second.window or whole
        if max(interval[0], other_interval[0]) >= min(interval[1], other_interval[1]):
            continue
        same_file = first.file == second.file
        files = "one file" if same_file else f"{first.file} and {second.file}, which hold the same bytes"
        windows = f" in {_window(interval)} and {_window(other_interval)}" if first.window or second.window else ""
        overlap = f"trials {first.name} and {second.name} share data: {files}{windows}"
        if first.split != second.split:
            expected = "expected no data in two splits"
            raise InputError(
                f"{folder / 'session.yaml'}: trials.{trials.index(second)}: {overlap}; {first.name} is of the split "
                f"{first.split}, {second.name} of {second.split}, {expected}"
            )
        for trial in (first, second):
            remark = f"{overlap}; what they share counts twice in the split {first.split}"
            remarks.setdefault(trial.name, []).append(remark)
    return remarks


def _window(window: tuple[float, float]) -> str:
    return "the whole log" if window[0] == float("-inf") else f"the window [{window[0]:g}, {window[1]:g}] s"


def _contents(folder: Path, logs: list[str]) -> dict[str, set[str]]:
    """What tells logs apart by what their files hold: names, or a digest where two files are of one size."""
    files = {log: data_files(folder / log) for log in logs}
    sizes = {file: file.stat().st_size for some in files.values() for file in some}
    alike = [size for size in sizes.values() if size]
    content = {file: file_digest(file) if alike.count(size) > 1 else str(file) for file, size in sizes.items()}
    return {log: {content[file] for file in some} for log, some in files.items()}
