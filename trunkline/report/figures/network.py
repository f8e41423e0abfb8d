"""Figures of the inverse kinematics network."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trunkline.frames import in_plane_of_tilt
from trunkline.report.figures.style import BASE, IDENTIFIED, INITIAL, LEAST_WIDTH, MEASURED, VALIDATE, plt

SLICE = 0.016  # m, half thickness of the slices shown
BAND = np.radians(4.0)  # of gravity angles shown together, to each side


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
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.0))
    bins = np.geomspace(1e-2, 1e2, 70)
    for (name, values), color in zip(errors.items(), (IDENTIFIED, VALIDATE, INITIAL, MEASURED), strict=False):
        millimetres = np.sort(values) * 1e3
        left.hist(
            np.clip(millimetres, bins[0], bins[-1]),
            bins=bins,
            histtype="step",
            density=False,
            color=color,
            weights=np.full(len(millimetres), 100 / len(millimetres)),
            linewidth=1.5,
        )
        right.plot(
            millimetres,
            np.linspace(0, 100, len(millimetres)),
            color=color,
            label=f"{name}: median {np.median(millimetres):.2f} mm",
        )
    left.set(xscale="log", xlabel="tip position error after FK (mm)", ylabel="targets (% a bin)")
    right.set(xscale="log", xlim=(1e-2, 1e2), xlabel="tip position error after FK (mm)", ylabel="targets below (%)")
    right.axvline(0.01 * length * 1e3, color=MEASURED, linestyle="--", linewidth=1)
    right.text(0.0105 * length * 1e3, 5, "1 % of length", fontsize=8)
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.suptitle("Tip error of the network: its lengths fed back through the statics")
    return figure


def error_map_figure(targets: pd.DataFrame) -> Figure:
    """Where the errors are: targets near the plane of tilt, coloured by tip error.

    Args:
        targets: columns theta_g (rad), gx, gy, x, y, z (m), error_mm.
    """
    x, y = in_plane_of_tilt(targets[["x", "y"]].to_numpy(), targets[["gx", "gy"]].to_numpy())
    targets = targets.assign(x=x, y=y)
    angles = np.unique(targets["theta_g"])
    drawn = angles[np.unique(np.linspace(0, len(angles) - 1, 4).round().astype(int))]
    several = len(drawn) > 1
    size = max(3.1 * len(drawn), LEAST_WIDTH), 3.6
    figure, axes = plt.subplots(1, len(drawn), figsize=size, squeeze=False, sharey=True)
    extent = targets[["x", "z"]].agg(["min", "max"]) * 1e3 + np.array([[-20], [20]])
    for ax, angle in zip(axes[0], drawn, strict=True):
        near = (targets["theta_g"] - angle).abs() < BAND
        rows = targets[near & (targets["y"].abs() < SLICE)]
        rows = rows.sort_values("error_mm")
        dots = ax.scatter(
            rows["x"] * 1e3, rows["z"] * 1e3, c=np.log10(rows["error_mm"] + 1e-3), s=6, linewidths=0, vmin=-1.5, vmax=1
        )
        ax.plot(0, 0, "^", color=BASE, markersize=5)
        ax.set(aspect="equal", xlim=extent["x"], ylim=extent["z"])
        ax.set_xlabel("towards gravity (mm)" if several else "x (mm)")
        ax.set_title(f"θ_G = {np.degrees(angle):.0f}°" if several else "no gravity")
    axes[0, 0].set_ylabel("z (mm), base at the triangle")
    bar = figure.colorbar(dots, ax=axes[0], shrink=0.8, ticks=[-1, 0, 1])
    bar.ax.set_yticklabels(["0.1", "1", "10"])
    bar.set_label("tip error (mm)")
    plane = "plane of tilt" if several else "plane of x and z"
    figure.suptitle(f"Where the network errs: held-out targets near the {plane}")
    return figure
