"""Errors beside what they stand beside: of every trial, and along the arm."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.figures.style import DOUBTFUL, IDENTIFIED, INITIAL, MEASURED, VALIDATE
from trunkline.identification.error_tables import LABELS

# by label: colour, line, dot
MODELS = {
    LABELS["null"]: (DOUBTFUL, "--", "o"),
    LABELS["null_straight"]: (DOUBTFUL, ":", "|"),
    LABELS["null_held"]: (DOUBTFUL, "-.", "_"),
    LABELS["cad"]: (INITIAL, "-", "o"),
    LABELS["initial"]: (VALIDATE, "-", "o"),
    LABELS["coarse"]: (VALIDATE, "--", "o"),
    LABELS["identified"]: (IDENTIFIED, "-", "o"),
    LABELS["model"]: (IDENTIFIED, "-", "o"),
    LABELS["noise_floor"]: (MEASURED, ":", "x"),
}
ERRORS = {"e_position_mm": "mean position error (mm)", "e_tip_mm": "tip error (mm)"}
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
            for model, (color, _, dot) in _shown(table).items():
                rows = table[table.model == model].set_index("trial").reindex(names)
                axis.semilogy(np.arange(len(names)), rows[error], dot, color=color, label=model)
        column[1].set_xticks(np.arange(len(names)), names, rotation=60, ha="right", fontsize=8)
    for axis, label in zip(axes[:, 0], ERRORS.values(), strict=True):
        axis.set_ylabel(label)
    _legend(figure, axes)
    return figure


def segment_figure(tables: dict[str, pd.DataFrame]) -> Figure:
    """The position error from the base to the tip, a line a model: a panel for each kind in each of the `tables`."""
    panels = [(title, kind, rows) for title, table in tables.items() if len(table)
              for kind, rows in table.groupby("experiment", sort=False)]  # fmt: skip
    count = max(len(panels), 1)
    figure, axes = plt.subplots(1, count, figsize=(max(4.2 * count, LEAST_WIDTH), 4.4), squeeze=False, sharey=True)
    for axis, (title, kind, rows) in zip(axes[0], panels, strict=False):
        for model, (color, line, _) in _shown(rows).items():
            own = rows[rows.model == model]
            axis.semilogy(own.from_base_mm, own.e_position_mm, line, color=color, label=model)
        axis.set(title=f"{kind}, {title}", xlabel="distance from the base, straight arm (mm)")
    if not panels:
        axes[0, 0].text(0.5, 0.5, "no trial", ha="center", transform=axes[0, 0].transAxes)
    axes[0, 0].set_ylabel("mean position error (mm)")
    _legend(figure, axes)
    return figure


def _shown(table: pd.DataFrame) -> dict[str, tuple[str, str, str]]:
    found = set(table.model)
    return {model: style for model, style in MODELS.items() if model in found}


def _legend(figure: Figure, axes: np.ndarray) -> None:
    entries = {label: line for axis in axes.flat for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    if entries:
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=4, fontsize=8)
