"""The control chart of an arm: a panel a parameter, trials in the order in which they came."""

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from trunkline.report.figures.style import DOUBTFUL, IDENTIFIED, INITIAL, LEAST_WIDTH

NAMED = 40  # trials whose names have room below the chart
FURTHEST = 2.5  # limits, beyond which a dot is drawn at the edge


def monitor_figure(table: pd.DataFrame, title: str) -> Figure:
    """From a row a trial and parameter: number, trial, parameter, z, chart, limit, beyond."""
    parameters = list(dict.fromkeys(table.parameter)) or ["no trial yet"]
    trials = table.drop_duplicates("number")
    width = max(LEAST_WIDTH + 1, min(14.0, 2.5 + 0.18 * len(trials)))
    figure, axes = plt.subplots(
        len(parameters), 1, figsize=(width, 1.5 + 1.15 * len(parameters)), squeeze=False, sharex=True
    )
    for axis, parameter in zip(axes[:, 0], parameters, strict=True):
        rows = table[table.parameter == parameter]
        if not len(rows):
            axis.text(0.5, 0.5, parameter, ha="center", transform=axis.transAxes)
            continue
        limit = rows.limit.iloc[0]
        edge = FURTHEST * limit
        axis.axhspan(-limit, limit, color=IDENTIFIED, alpha=0.08, lw=0)
        for side in (-limit, limit):
            axis.axhline(side, color=IDENTIFIED, lw=0.8)
        axis.plot(rows.number, rows.z.clip(-edge, edge), ".", color=DOUBTFUL, ms=4)
        axis.plot(rows.number, rows.chart.clip(-edge, edge), "-o", color=IDENTIFIED, ms=3, lw=1.2)
        beyond = rows[rows.beyond]
        axis.plot(beyond.number, beyond.chart.clip(-edge, edge), "o", color=INITIAL, ms=5)
        axis.set_ylim(-1.05 * edge, 1.05 * edge)
        axis.set_ylabel(parameter.replace("_", "\n", 1), rotation=0, ha="right", va="center", fontsize=8)
    axes[0, 0].set_title(title)
    last = axes[-1, 0]
    if 0 < len(trials) <= NAMED:
        last.set_xticks(trials.number, trials.trial, rotation=70, ha="right", fontsize=7)
    else:
        last.set_xlabel("trial")
    handles = [
        Line2D([], [], color=IDENTIFIED, marker="o", ms=3, label="chart (EWMA)"),
        Line2D([], [], color=DOUBTFUL, marker=".", ls="", label="one trial, z"),
        Line2D([], [], color=INITIAL, marker="o", ls="", label="beyond the limit"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8)
    return figure
