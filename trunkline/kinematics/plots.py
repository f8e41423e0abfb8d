"""Figures of the kinematics stages."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.kinematics.dataset import Density
from trunkline.plots import IDENTIFIED, INITIAL, MEASURED, VALIDATE, plt

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
    left.text(0.02, 0.12, "goal for the median: 0.1 mm", color=VALIDATE, fontsize=8, transform=left.get_yaxis_transform())
    left.set_ylabel("tip deviation (mm)")
    figure.suptitle(
        f"Statics against MuJoCo settled to rest, friction off: {len(deviation)} samples, "
        f"median {deviation['deviation_mm'].median():.2g} mm, max {deviation['deviation_mm'].max():.2g} mm"
    )
    return figure


def learning_figure(curve: pd.DataFrame) -> Figure:
    """Linearised tip error on both splits over the epochs."""
    figure, ax = plt.subplots(figsize=(6.4, 3.8))
    for name, color in (("train", IDENTIFIED), ("validate", VALIDATE)):
        ax.plot(curve["epoch"], curve[f"{name}_mm"], color=color, label=name)
    ax.set(yscale="log", xlabel="epoch", ylabel="mean tip error, to first order (mm)", title="Learning curve of the IK")
    ax.legend()
    return figure


def tip_error_figure(errors: dict[str, np.ndarray], length: float) -> Figure:
    """Distribution of tip errors after FK of the predicted lengths.

    Args:
        errors: name of a set of targets to tip errors, m.
        length: of the arm, m.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
    bins = np.geomspace(1e-2, 1e2, 70)
    for (name, values), color in zip(errors.items(), (IDENTIFIED, VALIDATE, INITIAL, MEASURED), strict=False):
        millimetres = np.sort(values) * 1e3
        left.hist(np.clip(millimetres, bins[0], bins[-1]), bins=bins, histtype="step", density=False, color=color,
                  weights=np.full(len(millimetres), 100 / len(millimetres)), linewidth=1.5)
        right.plot(millimetres, np.linspace(0, 100, len(millimetres)), color=color,
                   label=f"{name}: median {np.median(millimetres):.2f} mm")
    left.set(xscale="log", xlabel="tip position error after FK (mm)", ylabel="targets (% a bin)")
    right.set(xscale="log", xlim=(1e-2, 1e2), xlabel="tip position error after FK (mm)", ylabel="targets below (%)")
    right.axvline(0.01 * length * 1e3, color=MEASURED, linestyle="--", linewidth=1)
    right.text(0.0105 * length * 1e3, 5, "1 % of length", fontsize=8)
    right.legend(loc="upper left")
    figure.suptitle("Tip error of the network: its lengths fed back through the statics")
    return figure


def error_map_figure(targets: pd.DataFrame) -> Figure:
    """Where the errors are: targets near the plane of tilt, coloured by tip error (columns theta_g, x, y, z, error_mm)."""
    angles = np.unique(targets["theta_g"])
    shown = angles[np.unique(np.linspace(0, len(angles) - 1, 4).round().astype(int))]
    figure, axes = plt.subplots(1, len(shown), figsize=(3.2 * len(shown), 3.9), squeeze=False, sharey=True)
    for ax, angle in zip(axes[0], shown, strict=True):
        rows = targets[(targets["theta_g"] == angle) & (targets["y"].abs() < 2 * SLICE)]
        rows = rows.sort_values("error_mm")
        dots = ax.scatter(rows["x"] * 1e3, rows["z"] * 1e3, c=np.log10(rows["error_mm"] + 1e-3), s=6, linewidths=0,
                          vmin=-1.5, vmax=1)
        ax.plot(0, 0, "k^", markersize=5)
        ax.set(aspect="equal", xlabel="x (mm)", title=f"θ_G = {np.degrees(angle):.0f}°")
    axes[0, 0].set_ylabel("z (mm)")
    bar = figure.colorbar(dots, ax=axes[0], shrink=0.8, ticks=[-1, 0, 1])
    bar.ax.set_yticklabels(["0.1", "1", "10"])
    bar.set_label("tip error (mm)")
    figure.suptitle("Where the network errs: held-out targets near the plane of tilt")
    return figure
