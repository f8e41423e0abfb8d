"""Figures of the samples of forward kinematics."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.kinematics.dataset import Density
from trunkline.plots import IDENTIFIED, INITIAL, VALIDATE, plt

SLICE = 0.008  # m, half thickness of the slices shown


def density_figure(densities: list[Density]) -> Figure:
    """Tips in the plane of tilt before and after thinning, and how many share a cell, at up to four gravity angles."""
    shown = [densities[i] for i in np.unique(np.linspace(0, len(densities) - 1, 4).round().astype(int))]
    figure, axes = plt.subplots(3, len(shown), figsize=(3.1 * len(shown), 9), squeeze=False)
    points = np.concatenate([d.before for d in shown])[:, [0, 2]] * 1e3
    low, high = points.min(axis=0) - 15, points.max(axis=0) + 15
    for column, density in zip(axes.T, shown, strict=True):
        for ax, tips, color, label in (
            (column[0], density.before, INITIAL, "before"),
            (column[1], density.after, IDENTIFIED, "after thinning"),
        ):
            near = tips[np.abs(tips[:, 1]) < SLICE] * 1e3
            ax.scatter(near[:, 0], near[:, 2], s=2, color=color, linewidths=0)
            ax.plot(0, 0, "k^", markersize=5)
            ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x (mm)")
            ax.set_title(f"θ_G = {np.degrees(density.tilt):.0f}°, {label}\n{len(tips)} tips", fontsize=9)
        for tips, color, label in ((density.before, INITIAL, "before"), (density.after, IDENTIFIED, "after")):
            counts = np.sort(_per_cell(tips))
            column[2].plot(np.linspace(0, 100, len(counts)), counts / counts.mean(), color=color, label=label)
        column[2].set(yscale="log", xlabel="cells of 2 cm, emptiest first (%)", ylim=(0.02, 30))
    axes[0, 0].set_ylabel("z (mm), base at the triangle")
    axes[1, 0].set_ylabel("z (mm)")
    axes[2, 0].set_ylabel("tips in the cell over the mean")
    axes[2, 0].legend()
    figure.suptitle(f"Tips within {SLICE * 1e3:.0f} mm of the plane of tilt, and how evenly they lie")
    return figure


def _per_cell(tips: np.ndarray, edge: float = 0.02) -> np.ndarray:
    return np.unique(np.floor(tips / edge).astype(int), axis=0, return_counts=True)[1]


def deviation_figure(deviation: pd.DataFrame) -> Figure:
    """Distance between each sample's tip and MuJoCo's at rest."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
    floor = np.maximum(deviation["deviation_mm"], 1e-9)
    left.scatter(np.degrees(deviation["theta_g"]), floor, s=9, color=IDENTIFIED, linewidths=0)
    right.scatter(deviation["largest_tension"], floor, s=9, color=IDENTIFIED, linewidths=0)
    for ax, label in ((left, "gravity angle θ_G (°)"), (right, "largest tension (N)")):
        ax.axhline(0.1, color=VALIDATE, linestyle="--")
        ax.set(yscale="log", xlabel=label)
    place = left.get_yaxis_transform()
    left.text(0.02, 0.12, "goal for the median: 0.1 mm", color=VALIDATE, fontsize=8, transform=place)
    left.set_ylabel("tip deviation (mm)")
    figure.suptitle(
        f"Statics against MuJoCo settled to rest, friction off: {len(deviation)} samples, "
        f"median {deviation['deviation_mm'].median():.2g} mm, max {deviation['deviation_mm'].max():.2g} mm"
    )
    return figure
