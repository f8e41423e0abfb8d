"""The table and the picture of all runs."""

from pathlib import Path

import numpy as np

from rehearsal.experiments.result import Result, causes, rate
from trunkline.hybrid.shares import LEVEL


def table(results: list[Result]) -> str:
    """A row an experiment, in Markdown. Distances: of reach the least of a run, of follow its median, from where it was
    the set delay before; of these, median and 95th percentile over runs."""
    lines = [
        f"| experiment | runs | success | {100 * LEVEL:.0f} % interval | tip from the object's centre | failures |",
        "|---|---:|---:|---:|---:|---|",
    ]
    for name in dict.fromkeys(result.experiment for result in results):
        rows = [result for result in results if result.experiment == name]
        share, low, high = rate(rows)
        key = "tip_mm" if name == "follow" else "nearest_mm"
        values = np.array([getattr(row, key) for row in rows])
        known = values[np.isfinite(values)]
        told = " / ".join(f"{q:.0f}" for q in np.quantile(known, (0.5, 0.95))) + " mm" if len(known) else ""
        failed = ", ".join(f"{kind} {count}" for kind, count in causes(rows).items()) or "none"
        interval = f"{100 * low:.0f} to {100 * high:.0f} %"
        lines.append(f"| {name} | {len(rows)} | {100 * share:.0f} % | {interval} | {told} | {failed} |")
    return "\n".join(lines)


def draw(results: list[Result], file: Path) -> None:
    """Rates with their intervals, causes of failures, and distances of the tip."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(result.experiment for result in results))
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    for index, name in enumerate(names):
        rows = [result for result in results if result.experiment == name]
        share, low, high = (100 * value for value in rate(rows))
        left.errorbar(index, share, [[share - low], [high - share]], fmt="o", capsize=4, color="tab:blue")
        left.annotate(f"{len(rows)} runs", (index, 3), ha="center")
        bottom = 0
        for kind, count in causes(rows).items():
            middle.bar(index, count, bottom=bottom, color="tab:orange", edgecolor="white")
            middle.annotate(f"{kind} {count}", (index, bottom + count / 2), ha="center", va="center", fontsize=8)
            bottom += count
        key = "tip_mm" if name == "follow" else "nearest_mm"
        values = np.sort([value for row in rows if np.isfinite(value := getattr(row, key))])
        label = "follow: median of a run" if name == "follow" else f"{name}: least of a run"
        right.step(values, (np.arange(len(values)) + 1) / len(values), where="post", label=label)
    for plot in (left, middle):
        plot.set_xticks(range(len(names)), names)
        plot.set_xlim(-0.6, len(names) - 0.4)
    left.set(ylim=(0, 104), ylabel="success [%]", title="success, with its Wilson interval")
    middle.set(ylabel="runs", title="failures by cause")
    right.set(xlabel="tip from the object's centre [mm]", ylabel="share of runs", title="distance of the robot's tip")
    right.set_xlim(left=0)
    right.legend()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)
