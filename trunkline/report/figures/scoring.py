"""Errors beside what they stand beside: of every trial, and along the arm."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.report.figures.style import DOUBTFUL, IDENTIFIED, INITIAL, MEASURED, VALIDATE

# by label: colour, line, dot, width; the first are drawn first and widest: where models coincide, all are seen
MODELS = {
    LABELS["null"]: (DOUBTFUL, "--", "o", 1.5),
    LABELS["null_straight"]: (DOUBTFUL, ":", "|", 1.5),
    LABELS["null_held"]: (DOUBTFUL, "-.", "_", 1.5),
    LABELS["cad"]: (INITIAL, "-", "o", 4.5),
    LABELS["initial"]: (VALIDATE, "-", "o", 2.7),
    LABELS["coarse"]: (VALIDATE, "--", "s", 3.5),
    LABELS["identified"]: (IDENTIFIED, "-", "o", 1.5),
    LABELS["model"]: (IDENTIFIED, "-", "o", 1.5),
    LABELS["noise_floor"]: (MEASURED, ":", "x", 1.5),
}
ERRORS = {"e_position_mm": "mean position error (mm)", "e_tip_mm": "tip error (mm)"}
ACROSS = 4  # panels
LEAST_WIDTH = 6.6  # inches that the legend takes


def trial_figure(tables: dict[str, pd.DataFrame]) -> Figure:
    """Position and tip error of every trial, a dot a model; a column of panels for each of the `tables`, by title."""
    widths = [max(4.2, 1.2 + 0.22 * table.trial.nunique()) if len(table) else 4.2 for table in tables.values()]
    figure, axes = plt.subplots(
        2, len(tables), figsize=(max(sum(widths), LEAST_WIDTH), 7), squeeze=False, sharex="col", width_ratios=widths
    )
    for column, (title, table) in zip(axes.T, tables.items(), strict=True):
        column[0].set_title(title)
        if not len(table):
            column[0].text(0.5, 0.5, "no trial with split test", ha="center", transform=column[0].transAxes)
            continue
        names = list(dict.fromkeys(table.trial))
        for axis, error in zip(column, ERRORS, strict=True):
            for model, (color, _, dot, width) in _styles(table).items():
                rows = table[table.model == model].set_index("trial").reindex(names)
                size = _dot_size(dot, width)
                axis.semilogy(np.arange(len(names)), rows[error], dot, ms=size, color=color, label=model)
        column[1].set_xlim(-0.7, len(names) - 0.3)
        column[1].set_xticks(np.arange(len(names)), names, rotation=60, ha="right", fontsize=8)
    for axis, label in zip(axes[:, 0], ERRORS.values(), strict=True):
        axis.set_ylabel(label)
    figure.suptitle("Error of each trial, model by model")
    _legend(figure, axes)
    return figure


def marker_figure(tables: dict[str, pd.DataFrame]) -> Figure:
    """The position error from the base to the tip, a line a model: a panel for each kind in each of the `tables`."""
    panels = [(title, kind, rows) for title, table in tables.items() if len(table)
              for kind, rows in table.groupby("experiment", sort=False)]  # fmt: skip
    down = max(1, -(-len(panels) // ACROSS))
    across = max(1, -(-len(panels) // down))
    size = max(4.2 * across, LEAST_WIDTH), 4.0 * down + 0.7
    figure, axes = plt.subplots(down, across, figsize=size, squeeze=False, sharey=True)
    for axis, (title, kind, rows) in zip(axes.flat, panels, strict=False):
        for model, (color, line, dot, width) in _styles(rows).items():
            curve, dots = rows[rows.model == model], {"marker": dot, "ms": 0.7 * _dot_size(dot, width)}
            axis.semilogy(curve.from_base_mm, curve.e_position_mm, line, lw=width, color=color, label=model, **dots)
        axis.set(title=f"{kind}\n{title}", xlabel="distance from the base, straight arm (mm)")
        axis.set_xlim(0, 1.04 * rows.from_base_mm.max())
    if not panels:
        axes[0, 0].text(0.5, 0.5, "no trial", ha="center", transform=axes[0, 0].transAxes)
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(not panels)
    for axis in axes[:, 0]:
        axis.set_ylabel("mean position error (mm)")
    figure.suptitle("Position error along the arm")
    _legend(figure, axes)
    return figure


def _dot_size(dot: str, width: float) -> float:
    """In points; bars stand out of the dots that they may lie on."""
    return 12.0 if dot in "|_" else 4.0 + 1.4 * width


def _styles(table: pd.DataFrame) -> dict[str, tuple[str, str, str, float]]:
    present = set(table.model)
    return {model: style for model, style in MODELS.items() if model in present}


def _legend(figure: Figure, axes: np.ndarray) -> None:
    entries = {label: line for axis in axes.flat for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    if entries:
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=4, fontsize=8)
