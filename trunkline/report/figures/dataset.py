"""Figures of the samples of forward kinematics."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.frames import in_plane_of_tilt
from trunkline.kinematics.dataset.table import Density
from trunkline.report.figures.style import BASE, IDENTIFIED, INITIAL, LEAST_WIDTH, VALIDATE, plt

SLICE = 0.008  # m, half thickness of the slices shown
FEW = 2000  # tips under one gravity, up to which the slices are four times as thick
LEAST_MM = 1e-9  # drawn: less is none
GOAL_MM = 0.02  # median distance of the statics from MuJoCo at rest


def density_figure(densities: list[Density]) -> Figure:
    """Tips in the plane of tilt before and after thinning, and how many share a cell, at up to four gravity angles;
    below, at every gravity angle how uneven they are. Without gravity there is one, in the plane of x and z."""
    several, along = len(densities) > 1, "towards gravity (mm)" if len(densities) > 1 else "x (mm)"
    drawn = [densities[i] for i in np.unique(np.linspace(0, len(densities) - 1, 4).round().astype(int))]
    figure = plt.figure(figsize=(max(3.1 * len(drawn), LEAST_WIDTH), 11.5 if several else 10.0))
    grid = figure.add_gridspec(3 + several, len(drawn))
    axes = np.array([[figure.add_subplot(grid[row, column]) for column in range(len(drawn))] for row in range(3)])
    if several:
        _add_unevenness(figure.add_subplot(grid[3, :]), densities)
    points = np.concatenate([_in_plane(d.before, d.down) for d in drawn])[:, [0, 2]] * 1e3
    thickness = SLICE if len(densities[0].after) > FEW else 4 * SLICE
    low, high = points.min(axis=0) - 15, points.max(axis=0) + 15
    for column, density in zip(axes.T, drawn, strict=True):
        for ax, tips, color, label in (
            (column[0], density.before, INITIAL, "before"),
            (column[1], density.after, IDENTIFIED, "after thinning"),
        ):
            turned = _in_plane(tips, density.down)
            near = turned[np.abs(turned[:, 1]) < thickness] * 1e3
            ax.scatter(near[:, 0], near[:, 2], s=2, color=color, linewidths=0)
            ax.plot(0, 0, "^", color=BASE, markersize=5)
            ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel=along)
            under = f"θ_G = {np.degrees(density.angle):.0f}°" if several else "no gravity"
            ax.set_title(f"{under}, {label}\n{len(tips)} tips", fontsize=9)
        for tips, color, label in ((density.before, INITIAL, "before"), (density.after, IDENTIFIED, "after")):
            counts = np.sort(_per_cell(tips))
            width = 3.0 if label == "before" else 1.2  # where nothing was thinned, both are seen
            column[2].plot(np.linspace(0, 100, len(counts)), counts / counts.mean(), color=color, label=label, lw=width)
        column[2].set(yscale="log", xlabel="cells of 2 cm, emptiest first (%)", ylim=(0.02, 30))
    axes[0, 0].set_ylabel("z (mm), base at the triangle")
    axes[1, 0].set_ylabel("z (mm)")
    axes[2, 0].set_ylabel("tips in the cell over the mean")
    axes[2, 0].legend()
    plane = "plane of tilt" if several else "plane of x and z"
    figure.suptitle(f"Tips within {thickness * 1e3:.0f} mm of the {plane}, and how evenly they lie")
    return figure


def _add_unevenness(axes, densities: list[Density]) -> None:
    densities = sorted(densities, key=lambda density: density.angle)
    angles = [np.degrees(d.angle) for d in densities]
    for values, color, label in zip(
        np.array([d.unevenness() for d in densities]).T, (INITIAL, IDENTIFIED), ("before", "after"), strict=True
    ):
        axes.plot(angles, values, "o-", markersize=4, color=color, label=label)
    axes.set(ylim=(0, None), xlabel="gravity angle θ_G (°)", ylabel="tips a cell: standard\ndeviation over mean")
    axes.legend()


def _in_plane(tips: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Tips (N, 3) turned about the arm's axis, so that gravity is in the plane of x and z."""
    return np.column_stack([*in_plane_of_tilt(tips[:, :2], down[:2]), tips[:, 2]])


def _per_cell(tips: np.ndarray, edge: float = 0.02) -> np.ndarray:
    return np.unique(np.floor(tips / edge).astype(int), axis=0, return_counts=True)[1]


def deviation_figure(deviation: pd.DataFrame) -> Figure:
    """Distance between each sample's tip and MuJoCo's at rest without friction, and the band that friction opens; over
    gravity's angle, where there are several, and over tension."""
    values, band = deviation["deviation_mm"], deviation["friction_band_mm"]
    floor = np.maximum(values, LEAST_MM)
    panels = {"largest tension (N)": deviation["largest_tension"]}
    if deviation["theta_g"].nunique() > 1:
        panels = {"gravity angle θ_G (°)": np.degrees(deviation["theta_g"])} | panels
    size = max(4.5 * len(panels), LEAST_WIDTH + 1), 4.2
    figure, axes = plt.subplots(1, len(panels), figsize=size, sharey=True, squeeze=False)
    for ax, (label, x) in zip(axes[0], panels.items(), strict=True):
        ax.scatter(x, floor, s=9, color=IDENTIFIED, linewidths=0, label="FK to MuJoCo at rest, friction off")
        if band.any():
            ax.scatter(x, band, s=9, color=INITIAL, linewidths=0, label="band of dry friction")
        ax.axhline(GOAL_MM, color=VALIDATE, linestyle="--", label=f"goal for the median, {GOAL_MM:g} mm")
        ax.set(yscale="log", xlabel=label)
    axes[0, 0].set_ylabel("distance of tips (mm)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, markerscale=2)
    rubs = f"friction: median {band.median():.2g} mm, max {band.max():.2g} mm" if band.any() else "no dry friction"
    figure.suptitle(
        f"Statics against MuJoCo, {len(deviation)} samples: median {values.median():.2g} mm, "
        f"max {values.max():.2g} mm\n{rubs}"
    )
    return figure
