"""The rehearsal's metrics as a Markdown table: what `make rehearse` prints, and what the docs show."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from upkeep.limits import Limit, lookup
from upkeep.provenance import stale

# in the paper's order, and the column of the tip's distance from the object by which an experiment is told
DISTANCES = {"reach": "nearest_mm", "follow": "tip_mm", "grasp": "", "handle": ""}


def rehearsal_table(metrics: Mapping[str, Any], goals: Mapping[str, Limit], package: str, variants: bool) -> str:
    """A row an experiment, and with `variants` one for each kind of its objects and each of its variants below it.

    Args:
        metrics: as `rehearsal.experiments.result.summary` makes them.
        goals: the gate's rows of the rehearsal.
        package: of what the runs are, in words: `source_words`.
    """
    lines = [
        f"| experiment, {package} | runs | success | 95 % interval | goal "
        "| tip's distance: median / 95th percentile of runs, mm | failures |",
        "|---|---:|---:|---:|---:|---:|---|",
    ]
    experiments = [name for name, row in metrics.items() if isinstance(row, Mapping)]  # the others: of which package
    for name in sorted(experiments, key=[*DISTANCES, *experiments].index):
        result = metrics[name]
        goal = goals.get(f"{name}.rate")
        if "runs" in result:
            lines.append(_row(name, name, result, _goal(goal, result["rate"])))
        if clean := result.get("clean"):
            words = "… tip within 20 mm, and no other part touched anything"
            lines.append(f"| {words} | {clean['runs']} | {_percent(clean['rate'])} | {_interval(clean)} | | | |")
        if variants:
            lines += [_row(name, f"… {kind}", row, "") for kind, row in result.get("objects", {}).items()]
            lines += [_row(name, f"… {variant}", row, "") for variant, row in result.get("variants", {}).items()]
    return "\n".join(lines)


def source_words(root: Path, metrics: Mapping[str, Any]) -> str:
    """For the table's head: of which code and package the committed runs are, or that they are stale, and why."""
    for line in stale(root):
        return f"**STALE**: {line.removeprefix('README: rehearsal: ')}"
    return f"with this code, `{metrics['code']}`, and this package, `{metrics['package']}`"


def _goal(limit: Limit | None, rate: float) -> str:
    """The goal of a rate, with a word where it is missed."""
    if limit is None or limit.target is None:
        return ""
    return f"≥ {_percent(limit.target)}{' (missed)' if limit.misses(rate, limit.target) else ''}"


def _row(experiment: str, words: str, result: Mapping[str, Any], goal: str) -> str:
    distances = lookup(result, DISTANCES.get(experiment, ""))
    error = " / ".join(f"{distances[key]:.0f}" for key in ("median", "p95")) if distances else ""
    causes = sorted(result["causes"].items(), key=lambda cause: -cause[1])
    failed = ", ".join(f"{kind} {count}" for kind, count in causes) or "none"
    share, interval = _percent(result["rate"]), _interval(result)
    return f"| {words} | {result['runs']} | {share} | {interval} | {goal} | {error} | {failed} |"


def _interval(result: Mapping[str, Any]) -> str:
    return f"{100 * result['low']:.1f} to {_percent(result['high'])}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %".replace(".0 %", " %")
