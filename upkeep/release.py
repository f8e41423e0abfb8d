"""`python -m upkeep.release`: what the split `test` comes to, goal by goal, when a version is released.

It holds the metrics of `score`, the project's and the examples', and the errors of arms that nobody designs for
(docs/results/families.csv) against tests/release.yaml. Nothing is chosen by it:
it is run once when a version is ready, not on the way to it, and CI does not run it. A goal that is missed is told; one
that the version before met and this one misses, or no longer has, ends with exit code 1. `--keep` then writes
tests/release.json, by which the next version is judged.
"""

import sys
from argparse import ArgumentParser
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
from pydantic import Field, TypeAdapter

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.stage import write_json
from trunkline.settings import settings
from trunkline.version import __version__
from upkeep.limits import SCORING, Below, checked, is_finite, lookup, of_test, read_metrics, read_rows
from upkeep.results import KeptResult

GOALS, RELEASED = Path("tests/release.yaml"), Path("tests/release.json")
FAMILIES = Path("docs/results/families.json")  # in place of a folder: the table of its arms, `families.csv`, is read


@settings
class ReleaseGoal:
    """What a metric is asked for: exactly one of `max`, `min` and `below`."""

    max: float | None = None
    min: float | None = None
    below: Below | None = None

    def __post_init__(self):
        bounds = [name for name in ("max", "min", "below") if getattr(self, name) is not None]
        if len(bounds) != 1:
            raise ValueError(f"found {' and '.join(bounds) or 'no goal'}, expected one of max, min, below")

    def met(self, metrics: Any, key: str) -> bool:
        """Whether the metric at `key` meets it; one that is missing, null or no number does not."""
        value = lookup(metrics, key)
        if not is_finite(value):
            return False
        if self.below is not None:
            other = lookup(metrics, self.below.key)
            return is_finite(other) and value * self.below.factor <= other
        return value <= self.max if self.max is not None else value >= self.min

    def words(self, metrics: Any) -> str:
        if self.below is not None:
            other = lookup(metrics, self.below.key)
            return f"{self.below.factor:g} times below {f'{other:.3g}' if is_finite(other) else '–'}"
        return f"≤ {self.max:g}" if self.max is not None else f"≥ {self.min:g}"


@settings
class Released:
    """A version's results: met: folder: dotted key: whether its goal was met."""

    version: str
    met: dict[str, dict[str, bool]]


# folder, or FAMILIES: dotted key of its artifacts/score/metrics.json, or of `family_metrics`: goal
Goals = Annotated[dict[str, Annotated[dict[str, ReleaseGoal], Field(min_length=1)]], Field(min_length=1)]


@dataclass
class GoalResult:
    """Of one goal. value: None where there is none. before: whether the version before met it, None if it was not
    asked."""

    folder: str
    key: str
    value: float | None
    goal: str
    met: bool
    before: bool | None


def read_goals(path: Path) -> Goals:
    """The goals in the file at `path`; InputError where it is malformed or names another split."""
    goals = read_rows(path, TypeAdapter(Goals))
    for folder, rows in goals.items():
        for key in rows:
            if not of_test("", key):
                raise InputError(f"{path}: {folder}: {key}: found no metric of `test`, expected one")
    return goals


def read_released(path: Path) -> Released | None:
    """What the version before came to; None before the first."""
    if not path.is_file():
        return None
    return checked(path, path.read_text(encoding="utf-8"), TypeAdapter(Released))


def results(root: Path, goals: Goals, before: Released | None) -> list[GoalResult]:
    """What each goal comes to.

    Raises:
        InputError: a folder has no metrics of `score`, or such as are not finite.
    """
    rows = []
    for folder, folder_goals in goals.items():
        metrics = family_metrics(root) if folder == str(FAMILIES) else read_metrics(root / folder, SCORING)
        for key, goal in folder_goals.items():
            value, then = lookup(metrics, key), None if before is None else before.met.get(folder, {}).get(key)
            number = value if is_finite(value) else None
            rows.append(GoalResult(folder, key, number, goal.words(metrics), goal.met(metrics, key), then))
    return rows


def family_metrics(root: Path) -> dict:
    """Of the simulated arms of the last `make families`, as `arm_metrics`.

    Raises:
        InputError: it was not run, or of other code.
    """
    if not (root / FAMILIES).is_file():
        raise InputError(f"{FAMILIES}: found none, expected that of `make families`")
    result = KeptResult.read(root / FAMILIES)
    if result.state(root) != "of this code":
        raise InputError(f"{FAMILIES}: found it of commit {result.origin.commit}, expected it of this code")
    return arm_metrics(pd.read_csv(root / FAMILIES.with_suffix(".csv"), dtype={"code": str}), result.origin.digest)


def arm_metrics(table: pd.DataFrame, code: str) -> dict:
    """Of the rows of this code, first attempts: `test.mean` and `test.worst` over arms of every column of errors (% of
    the arm's length), `test.sealed_arms`, `test.refused_arms`, and `test.intervals_held`, the share of intervals that
    hold the truth."""
    arms = table[table["code"] == code].drop_duplicates("arm")  # `attempt` also counts those of other code
    errors = arms.filter(regex=r"_(position|tip)$")  # none of a session that was refused
    return {
        "test": {
            "mean": errors.mean().to_dict(),
            "worst": errors.max().to_dict(),
            "sealed_arms": int((arms["sealed"] == "yes").sum()),
            "refused_arms": int((arms["refused"] != "no").sum()),
            "intervals_held": float(arms["held"].sum() / arms["intervals"].sum()),
        }
    }


def lost(rows: list[GoalResult], before: Released | None) -> list[str]:
    """Goals that the version before met and this one misses, or no longer has; a line each."""
    now = {(row.folder, row.key): row.met for row in rows}
    then: Mapping[str, Mapping[str, bool]] = {} if before is None else before.met
    return [
        f"{folder}: {key}: {'missed' if (folder, key) in now else 'asked no longer'}, was met"
        for folder, results in then.items()
        for key, met in results.items()
        if met and not now.get((folder, key), False)
    ]


def table(rows: list[GoalResult], before: Released | None) -> str:
    """Goal, result and whether it is missed, as Markdown."""
    lines = [f"| of `test` | result | goal | | {'no version before' if before is None else before.version} |"]
    lines.append("|---|---:|---:|---|---|")
    words = {True: "met", False: "missed", None: "–"}
    for row in rows:
        where = "" if row.folder == "." else f"{row.folder}: "
        value = "–" if row.value is None else f"{row.value:.3g}"
        lines.append(f"| {where}`{row.key}` | {value} | {row.goal} | {words[row.met]} | {words[row.before]} |")
    return "\n".join(lines)


def summary(rows: list[GoalResult], version: str) -> Released:
    """What the next version is judged by."""
    met: dict[str, dict[str, bool]] = {}
    for row in rows:
        met.setdefault(row.folder, {})[row.key] = row.met
    return Released(version=version, met=met)


@in_one_line
def main(root: Path = Path("."), words: list[str] | None = None) -> int:
    parser = ArgumentParser(prog="upkeep.release", description="Hold the split test against its goals.")
    parser.add_argument("--keep", action="store_true", help="write what the next version is judged by")
    keep = parser.parse_args(words).keep
    require_checkout(root)
    before = read_released(root / RELEASED)
    rows = results(root, read_goals(root / GOALS), before)
    print(table(rows, before))
    gone = lost(rows, before)
    for line in gone:
        print(f"release: FAIL {line}")
    print(f"release: {len(rows)} goals, {sum(not row.met for row in rows)} missed, {len(gone)} lost")
    if keep:
        write_json(root / RELEASED, TypeAdapter(Released).dump_python(summary(rows, __version__)))
        print(f"release: wrote {RELEASED}")
    return 1 if gone else 0


if __name__ == "__main__":
    sys.exit(main())
