"""A batch of arms at a glance: errors of every arm, and a panel a parameter with the intervals of all of them."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.report.figures.style import DOUBTFUL, IDENTIFIED, INITIAL, MEASURED

ACROSS = 4  # panels
MODELS = {  # colour, dot
    "identified": (IDENTIFIED, "o"), "cad": (INITIAL, "o"), "null": (DOUBTFUL, "s"), "noise_floor": (MEASURED, "x"),
}  # fmt: skip


def batch_figure(table: pd.DataFrame) -> Figure:
    """From a row an arm and number: arm, kind (parameter or error), name, value, low, high, unit, drift,
    drift_half_width. Parameters that drifted beyond their intervals are marked."""
    arms = list(dict.fromkeys(table.arm))
    parameters = table[table.kind == "parameter"]
    counts = parameters.groupby("name", sort=False).arm.nunique()
    drawn = list(counts.index[counts >= min(2, len(arms))])
    rows = 1 + -(-len(drawn) // ACROSS)
    width, height = max(9.0, 1.2 + 0.55 * len(arms) * ACROSS), 3.4 + (rows - 1) * (1.6 + 0.09 * _longest(arms))
    figure = plt.figure(figsize=(min(width, 22.0), height))
    grid = figure.add_gridspec(rows, ACROSS, height_ratios=[1.6] + [1] * (rows - 1))
    _errors(figure.add_subplot(grid[0, :]), table[table.kind == "error"], arms)
    for number, name in enumerate(drawn):
        axis = figure.add_subplot(grid[1 + number // ACROSS, number % ACROSS])
        _parameter(axis, parameters[parameters.name == name], arms, name)
    return figure


def _errors(axis, errors: pd.DataFrame, arms: list[str]) -> None:
    places = {arm: i for i, arm in enumerate(arms)}
    for offset, (model, (color, dot)) in zip(np.linspace(-0.2, 0.2, len(MODELS)), MODELS.items(), strict=True):
        for error, filled in (("position", False), ("tip", True)):
            rows = errors[errors.name.str.startswith(f"{model}_{error}_")]
            x = rows.arm.map(places) + offset
            face = color if filled or dot == "x" else "none"
            size = 6 if filled else 5
            label = LABELS[model] if filled else None
            axis.semilogy(x, rows.value, dot, color=color, mfc=face, ms=size, label=label)
    axis.set_xticks(range(len(arms)), arms, rotation=20 if len(arms) > 6 else 0)
    axis.set_xlim(-0.6, len(arms) - 0.4)
    axis.set_ylabel("error (mm)")
    axis.set_title("Errors: tip (filled) and mean position (open)")
    if len(errors):
        axis.legend(ncols=len(MODELS), loc="upper center", bbox_to_anchor=(0.5, -0.12 if len(arms) <= 6 else -0.3))


def _parameter(axis, rows: pd.DataFrame, arms: list[str], name: str) -> None:
    places = rows.arm.map({arm: i for i, arm in enumerate(arms)}).to_numpy()
    values, low, high = (rows[key].to_numpy(float) for key in ("value", "low", "high"))
    beyond = (rows.drift.abs() > rows.drift_half_width).to_numpy()
    for chosen, color in ((~beyond, IDENTIFIED), (beyond, INITIAL)):
        ends = np.abs(np.stack([values - low, high - values]))[:, chosen]
        axis.errorbar(places[chosen], values[chosen], ends, fmt="o", color=color, ms=4, capsize=2, lw=1.2)
    if not parameter_named(name).signed and high.max() / low.min() > 3:
        axis.set_yscale("log")
    unit = rows.unit.iloc[0]
    axis.set_title(name + (f" ({unit})" if unit else ""), fontsize=9)
    axis.set_xticks(range(len(arms)), arms, rotation=60, ha="right", fontsize=7)
    axis.set_xlim(-0.6, len(arms) - 0.4)
    axis.tick_params(axis="y", which="both", labelsize=7)


def _longest(arms: list[str]) -> int:
    return max(len(arm) for arm in arms)
