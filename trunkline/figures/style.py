"""One look for every figure, and figures that are the same bytes for the same data."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

MEASURED = "#222222"
INITIAL = "#c8553d"
IDENTIFIED = "#2a6f97"
IDENTIFY = "#2a6f97"
VALIDATE = "#e09f3e"
SEQUENTIAL = "viridis"

plt.rcParams.update(
    {
        "figure.dpi": 100,
        "figure.constrained_layout.use": True,
        "font.size": 10,
        "axes.titlesize": 11,
        "axes.titleweight": "bold",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#e4e4e4",
        "grid.linewidth": 0.7,
        "lines.linewidth": 1.5,
        "legend.frameon": False,
        "legend.fontsize": 9,
        "image.cmap": SEQUENTIAL,
        "svg.hashsalt": "trunkline",
    }
)


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> None:
    """Write ``figure`` as PNG without dates or versions in it, and close it."""
    figure.savefig(path, dpi=dpi, metadata={"Software": None})
    plt.close(figure)
