"""Figure of the last step: errors on the trials of the split test."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.figures.style import DOUBTFUL, IDENTIFIED, INITIAL, MEASURED, VALIDATE

MODELS = {"null": DOUBTFUL, "cad": INITIAL, "initial": VALIDATE, "identified": IDENTIFIED}


def score_figure(tables: dict[str, pd.DataFrame], metrics: dict[str, dict]) -> Figure:
    """By stage the position error of every trial, a dot a model; the noise floor as a line."""
    figure, axes = plt.subplots(1, len(tables), figsize=(4.2 * len(tables), 3.8), squeeze=False)
    for axis, (stage, table) in zip(axes[0], tables.items(), strict=True):
        axis.set_title(stage)
        if not len(table):
            axis.text(0.5, 0.5, "no trial with split test", ha="center", transform=axis.transAxes)
            continue
        names = list(dict.fromkeys(table.trial))
        for model, color in MODELS.items():
            rows = table[table.model == model].set_index("trial").loc[names]
            axis.semilogy(np.arange(len(names)), rows.e_position_mm, "o", color=color, label=model)
        axis.axhline(metrics[stage]["noise_floor_mm"], color=MEASURED, linestyle=":", label="noise floor")
        axis.set_xticks(np.arange(len(names)), names, rotation=60, ha="right", fontsize=8)
    axes[0, 0].set_ylabel("mean position error (mm)")
    if any(map(len, tables.values())):
        next(axis for axis in axes[0] if axis.lines).legend(fontsize=8)
    return figure
