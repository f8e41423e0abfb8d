"""What a run comes to, its rows in a table that is resumed, and rates with their intervals."""

import csv
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from trunkline.errors import InputError
from trunkline.hybrid.shares import wilson


@dataclass
class Result:
    """One run. success: as the paper defines it. cause: of a failure, its first word the kind: out of reach, aim, plan
    refused, collision, missed, interrupted, stopped. plans: that were asked for.

    aimed_mm: from the tip target to the object's centre. previewed_mm: from the preview's tip to it. nearest_mm: the
    least distance of the robot's tip from it. tip_mm: median distance of the tip from the moving object as it was the
    set delay before; worst_mm: its 95th percentile. robot_mm: median distance of the tip from where the operator's rays
    wanted it then: what is left when the operator's own lag and aim are taken out. probability: that the preview gave
    to the plan that was confirmed. agreed: 1 if it was at least a half for a success, or less for a failure, else 0.
    path_pct: median distance between the robot's tip and the nominal preview's, % of the arm's length. seconds: of the
    whole run.
    """

    experiment: str
    seed: int
    success: bool
    cause: str = ""
    plans: int = 0
    aimed_mm: float = float("nan")
    previewed_mm: float = float("nan")
    nearest_mm: float = float("nan")
    tip_mm: float = float("nan")
    worst_mm: float = float("nan")
    robot_mm: float = float("nan")
    probability: float = float("nan")
    agreed: float = float("nan")
    path_pct: float = float("nan")
    seconds: float = 0.0
    package: str = ""


COLUMNS = [field.name for field in fields(Result)]


def read_results(path: Path) -> list[Result]:
    """The runs that a table has, none where there is no table.

    Raises:
        InputError: it has other columns.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames != COLUMNS:
            raise InputError(f"{path}: found columns {reader.fieldnames}, expected {COLUMNS}")
        return [_result(row) for row in reader]


def append_result(path: Path, result: Result) -> None:
    """One more row, on the disk when this returns."""
    new = not path.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        row = {name: f"{value:.4g}" if isinstance(value, float) else value for name, value in asdict(result).items()}
        writer.writerow(row)


def rate(results: list[Result]) -> tuple[float, float, float]:
    """Share of successes, and its Wilson interval."""
    found, count = sum(result.success for result in results), len(results)
    return found / count, *wilson(found, count)


def causes(results: list[Result]) -> dict[str, int]:
    """How often each kind of failure was, the most frequent first."""
    found: dict[str, int] = {}
    for result in results:
        if not result.success:
            kind = result.cause.partition(":")[0]
            found[kind] = found.get(kind, 0) + 1
    return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))


def _result(row: dict[str, str]) -> Result:
    numbers = {field.name: float(row[field.name]) for field in fields(Result) if field.type is float}
    return Result(
        row["experiment"], int(row["seed"]), row["success"] == "True", row["cause"], int(row["plans"]), **numbers,
        package=row["package"],
    )  # fmt: skip
