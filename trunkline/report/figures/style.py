"""One look for every figure, and figures that are the same bytes for the same data."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

# Every colour of every figure. What is measured, what a model said before and after its fit, what was held out:
MEASURED = "#222222"
INITIAL = "#c8553d"
IDENTIFIED = "#2a6f97"
VALIDATE = "#e09f3e"
# Parts of the arm in a drawing of it, and its base in a slice.
UNIT, UNIT_EDGE, TENDON = "#f3d9bd", "#8a5a2b", "#333333"
BASE = "#000000"
# Sets that are reached: by the rigid arm's mount, by the soft arm's tip, by the tip with both.
RIGID, SOFT, HYBRID = IDENTIFIED, INITIAL, VALIDATE
# What the cameras saw of a marker in a stretch of time.
UNSEEN, PARTLY, SEEN = INITIAL, VALIDATE, "#d7e3ea"
# Said without certainty, or beside the point.
DOUBTFUL = "#999999"
GRID, BACKGROUND = "#e4e4e4", "#ffffff"
SEQUENTIAL = "viridis"
LEAST_WIDTH = 6.0  # inches, which a title takes

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
        "grid.color": GRID,
        "grid.linewidth": 0.7,
        "lines.linewidth": 1.5,
        "legend.frameon": False,
        "legend.fontsize": 9,
        "image.cmap": SEQUENTIAL,
        "svg.hashsalt": "trunkline",
    }
)


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> None:
    """Write `figure` as PNG without dates or versions in it, and close it."""
    figure.savefig(path, dpi=dpi, metadata={"Software": None})
    plt.close(figure)
