"""The picture of all runs."""

from pathlib import Path

import numpy as np

from rehearsal.experiments.result import Result, causes, grouped, rate
from upkeep.rehearsal_table import DISTANCES


def draw(results: list[Result], file: Path) -> None:
    """Rates with their intervals, causes of failures, and distances of the tip."""
    from matplotlib.figure import Figure

    groups = grouped(results)
    figure = Figure(figsize=(12, 2.6 + 0.35 * len(groups)), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.2, 1.2, 1])
    kinds = list(dict.fromkeys(kind for rows in groups.values() for kind in causes(rows)))
    colours = {kind: f"C{index + 1}" for index, kind in enumerate(kinds)}
    for place, rows in enumerate(groups.values()):
        share, low, high = (100 * value for value in rate(rows))
        left.errorbar(share, place, xerr=[[share - low], [high - share]], fmt="o", capsize=4, color="C0")
        bottom = 0
        for kind, count in causes(rows).items():
            middle.barh(place, count, left=bottom, color=colours[kind], edgecolor="white")
            middle.annotate(str(count), (bottom + count / 2, place), ha="center", va="center", fontsize=8)
            bottom += count
        if not bottom:
            middle.annotate("none", (0, place), (4, 0), textcoords="offset points", va="center", color="0.4")
    for name, column in DISTANCES.items():
        rows = groups.get((name, ""), []) if column else []
        values = np.sort([value for row in rows if np.isfinite(value := getattr(row, column))])
        if len(values):
            right.step(values, (np.arange(len(values)) + 1) / len(values), where="post", label=name)
    words = [", ".join(filter(None, key)) + f" ({len(rows)} runs)" for key, rows in groups.items()]
    left.set_yticks(range(len(groups)), words)
    middle.set_yticks(range(len(groups)), [""] * len(groups))
    for plot in (left, middle):
        plot.set_ylim(len(groups) - 0.4, -0.6)
    left.set(xlim=(0, 102), xlabel="success [%], with its Wilson interval")
    most = max([sum(not row.success for row in rows) for rows in groups.values()], default=0)
    middle.set(xlim=(0, max(2, 1.05 * most)), xlabel="failures, by cause")
    middle.xaxis.get_major_locator().set_params(integer=True)
    _legend(middle, [_patch(colours[kind]) for kind in kinds], kinds)
    right.set(xlabel="tip from the object's centre [mm]", ylabel="share of runs", ylim=(0, 1.02))
    right.set_xlim(left=0)
    _legend(right, *right.get_legend_handles_labels())
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _legend(plot, handles: list, labels: list[str]) -> None:
    """Above the plot, where it covers nothing."""
    if handles:
        plot.legend(handles, labels, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False, fontsize=8)


def _patch(colour: str):
    from matplotlib.patches import Patch

    return Patch(color=colour)
