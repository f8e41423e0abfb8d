"""The payload chart as a picture."""

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from trunkline.report.figures.style import DOUBTFUL, HYBRID, IDENTIFIED, INITIAL, MEASURED

COLOURS = {"cylinder": IDENTIFIED, "box": INITIAL, "sphere": HYBRID, "toy": MEASURED, "basket": DOUBTFUL}
MARKS = ("o-", "s--", "^:", "v-.")


def payload_figure(table: pd.DataFrame) -> Figure:
    """Heaviest mass held over diameter: a panel a support and friction, a colour a shape, a line style a pull.

    Args:
        table: columns support, shape, diameter (m), friction, pull, shortening (m) and mass (kg).
    """
    panels = list(table.groupby(["support", "friction"], sort=True))
    figure, axes = plt.subplots(1, len(panels), figsize=(4.6 * len(panels), 4), sharey=True, squeeze=False)
    ways = sorted({*zip(table["pull"], table["shortening"], strict=True)})
    for axis, ((support, friction), rows) in zip(axes[0], panels, strict=True):
        for (shape, pull, shortening), line in rows.groupby(["shape", "pull", "shortening"], sort=True):
            label = f"{shape}, {pull} {1e3 * shortening:.0f} mm"
            style = MARKS[ways.index((pull, shortening)) % len(MARKS)]
            line = line.sort_values("diameter")
            axis.plot(1e3 * line["diameter"], 1e3 * line["mass"], style, color=COLOURS[shape], label=label, alpha=0.85)
        axis.set(title=f"{support}, friction {friction:g}", xlabel="diameter (mm)")
        axis.legend()
    axes[0, 0].set(ylabel="heaviest mass held (g)", ylim=(0, 1050 * max(table["mass"].max(), 0.1)))  # of all panels
    return figure
