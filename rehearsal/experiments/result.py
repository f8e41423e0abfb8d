"""What a run comes to, its rows in a table that is resumed, and rates with their intervals."""

import csv
from collections.abc import Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path

import numpy as np

from trunkline.ar.hybrid.rates import wilson
from trunkline.errors import InputError
from trunkline.files import written_whole

LATER = {"at_end": 0.0, "after_2s": 2.0, "after_10s": 10.0}  # s after an execution's end that its tip is looked at


@dataclass
class Result:
    """One run. success: as the paper defines it. cause: of a failure, its first word the kind: out of reach, aim, plan
    refused, collision, missed, interrupted, stopped, error. plans: that were asked for.

    aimed_mm: from the tip target to the object's centre. previewed_mm: from the preview's tip to it. nearest_mm: the
    least distance of the robot's tip from it. tip_mm: median distance of the tip from the moving object as it was the
    set delay before; worst_mm: its 95th percentile. robot_mm: median distance of the tip from where the operator's rays
    wanted it then: what is left when the operator's own lag and aim are taken out. probability: that the preview gave
    to the plan that was confirmed. agreed: 1 if it was at least a half for a success, or less for a failure, else 0.
    path_pct: median distance between the robot's tip and the nominal preview's, % of length. plan_end_mm: from
    the preview's tip at its end to the tip target. radius_mm: within which the preview had stated that the tip ends;
    at_end_mm, after_2s_mm, after_10s_mm: of the robot's tip from where that has it then, when the execution had ended
    and so long after it, with nothing in the way; touching_mm: likewise when it had ended, beside the object.
    off_target_mm: of the tip from its target after_10s; corrected_mm: likewise once the plan has corrected itself by
    cameras, and `correction` what that came to. seconds: of the whole run. object: what was grasped, in words.

    variant: of an ablation, "" for none. package, code: digests of what the run was made of: `rehearsal.runs.Source`.
    """

    experiment: str
    seed: int
    success: bool
    cause: str = ""
    plans: int = 0
    aimed_mm: float = float("nan")
    previewed_mm: float = float("nan")
    nearest_mm: float = float("nan")
    clean: float = float("nan")
    tip_mm: float = float("nan")
    worst_mm: float = float("nan")
    robot_mm: float = float("nan")
    probability: float = float("nan")
    agreed: float = float("nan")
    path_pct: float = float("nan")
    plan_end_mm: float = float("nan")
    radius_mm: float = float("nan")
    at_end_mm: float = float("nan")
    after_2s_mm: float = float("nan")
    after_10s_mm: float = float("nan")
    touching_mm: float = float("nan")
    off_target_mm: float = float("nan")
    corrected_mm: float = float("nan")
    correction: str = ""
    seconds: float = 0.0
    object: str = ""
    variant: str = ""
    package: str = ""
    code: str = ""


COLUMNS = [field.name for field in fields(Result)]
REQUIRED = [field.name for field in fields(Result) if field.default is MISSING]
_READ = {"str": str, "int": int, "float": float, "bool": "True".__eq__}


def read_results(path: Path) -> list[Result]:
    """The runs that a table has, none where there is no table. A column that an older table lacks has its default.

    Raises:
        InputError: it has other columns, or lacks one that has no default.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        columns = list(reader.fieldnames or [])
        if not set(REQUIRED) <= set(columns) <= set(COLUMNS):
            raise InputError(f"{path}: found columns {columns}, expected {COLUMNS}: delete it to begin anew")
        kinds = {field.name: _READ[str(getattr(field.type, "__name__", field.type))] for field in fields(Result)}
        return [Result(**{name: kinds[name](text) for name, text in row.items()}) for row in reader]


def append_result(path: Path, result: Result) -> None:
    """One more row, on the disk when this returns; a table of fewer columns is written anew before."""
    new = not path.exists()
    if not new and _header(path) != COLUMNS:
        rewrite_results(path, read_results(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(as_row(result))


def _header(path: Path) -> list[str]:
    with path.open(newline="", encoding="utf-8") as file:
        return next(csv.reader(file), [])


def as_row(result: Result) -> dict[str, str]:
    """As a table has it: floats to four digits."""
    return {name: f"{value:.4g}" if isinstance(value, float) else str(value) for name, value in asdict(result).items()}


def rewrite_results(path: Path, results: list[Result]) -> None:
    """The table anew, whole or not at all, its rows in the order of experiments as they first come, variant, seed."""
    order = list(dict.fromkeys(result.experiment for result in results))
    with written_whole(path) as part:
        for result in sorted(results, key=lambda row: (order.index(row.experiment), row.variant, row.seed)):
            append_result(part, result)


def grouped(results: list[Result]) -> dict[tuple[str, str], list[Result]]:
    """By experiment and variant, as they first come; those without a variant before all others."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for result in sorted(results, key=lambda row: bool(row.variant)):
        groups.setdefault((result.experiment, result.variant), []).append(result)
    return groups


def share_of(outcomes: Sequence[float] | np.ndarray) -> tuple[int, float, float, float]:
    """Of outcomes, 1 or 0, how many were 1, their share, and its Wilson interval."""
    successes = int(sum(outcomes))
    return successes, successes / len(outcomes), *wilson(successes, len(outcomes))


def rate(results: list[Result]) -> tuple[float, float, float]:
    """Share of successes, and its Wilson interval."""
    return share_of([result.success for result in results])[1:]


def causes(results: list[Result]) -> dict[str, int]:
    """How often each kind of failure was, the most frequent first."""
    counts: dict[str, int] = {}
    for result in results:
        if not result.success:
            kind = result.cause.partition(":")[0]
            counts[kind] = counts.get(kind, 0) + 1
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def summary(results: list[Result]) -> dict:
    """metrics.json: by experiment, and in it by variant, runs, successes, rate, its interval from `low` to `high`,
    causes, and of every distance that was measured median and 95th percentile over runs; `clean`: of how many reaches,
    their share and its interval; of experiments with several kinds of objects the same of each kind, in `objects`."""
    table: dict = {}
    for (experiment, variant), rows in grouped(results).items():
        entry, kinds = _summary_of(rows), sorted({row.object for row in rows})
        if len(kinds) > 1:
            entry["objects"] = {kind: _summary_of([row for row in rows if row.object == kind]) for kind in kinds}
        if variant:
            table.setdefault(experiment, {}).setdefault("variants", {})[variant] = entry
        else:
            table[experiment] = entry
    return table


def _summary_of(rows: list[Result]) -> dict:
    keys = ("successes", "rate", "low", "high")
    entry = {"runs": len(rows), **dict(zip(keys, share_of([row.success for row in rows]), strict=True))}
    entry["causes"] = causes(rows)
    judged = [row.clean for row in rows if np.isfinite(row.clean)]
    if judged:
        entry["clean"] = {"runs": len(judged), **dict(zip(keys, share_of(judged), strict=True))}
    for name in COLUMNS:
        values = np.array([getattr(row, name) for row in rows]) if name.endswith("_mm") else np.zeros(0)
        if len(finite := values[np.isfinite(values)]):
            entry[name] = dict(zip(("median", "p95"), np.quantile(finite, (0.5, 0.95)), strict=True))
    return entry
