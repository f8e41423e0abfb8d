"""The pictures of a certificate: where the tip is how uncertain, and measured poses beside simulated ones."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from trunkline.report.figures.style import IDENTIFIED, LEAST_WIDTH, MEASURED, VALIDATE

ACROSS = {"x": 0, "y": 1}
SHAPES = 6  # poses of a still, at most


def uncertainty_figure(tips: np.ndarray, radius: np.ndarray) -> Figure:
    """Tips (N, 3), m, from two sides, coloured by the radius (N,), m, within which they are in 95 of 100 cases."""
    figure, axes = plt.subplots(1, 2, figsize=(8.4, 4.2), sharex=True, sharey=True)
    order = np.argsort(radius)
    for axis, (name, k) in zip(axes, ACROSS.items(), strict=True):
        dots = axis.scatter(tips[order, k] * 1e3, tips[order, 2] * 1e3, c=radius[order] * 1e3, s=22, cmap="cividis_r")
        axis.plot(0, 0, "s", color=MEASURED, markersize=7)
        axis.set(xlabel=f"{name} (mm)", aspect="equal", title=f"seen along {'y' if name == 'x' else 'x'}")
    axes[0].set_ylabel("z (mm)")
    figure.colorbar(dots, ax=axes, label="expanded uncertainty, 95 % (mm)", shrink=0.9)
    return figure


def pose_figure(shapes: list[tuple[str, np.ndarray, np.ndarray]]) -> Figure:
    """Held-out trials at their widest: name, measured and simulated points from the mount on, m, each (S, 3), NaN where
    not seen. Each in the plane in which it bends most."""
    drawn = shapes[:SHAPES]
    size = max(1.8 * len(drawn), LEAST_WIDTH), 3.2
    figure, axes = plt.subplots(1, max(len(drawn), 1), figsize=size, squeeze=False, sharey=True)
    widest = 0.0  # mm, half of every panel: one scale
    for axis, (name, measured, simulated) in zip(axes[0], drawn, strict=False):
        side = np.linalg.svd(simulated[:, :2], full_matrices=False)[2][0]
        for points, style, color, label in (
            (measured, "o", VALIDATE, "measured"), (simulated, "-", IDENTIFIED, "simulated"),
        ):  # fmt: skip
            axis.plot(points[:, :2] @ side * 1e3, points[:, 2] * 1e3, style, color=color, label=label, markersize=4)
        widest = max(widest, np.ptp(axis.get_xlim()) / 2)
        axis.set(aspect="equal", xlabel="mm")
        axis.xaxis.set_major_locator(MaxNLocator(3))
        axis.set_title(name.replace("/", "\n"), fontsize=8, fontweight="normal")
    for axis in axes[0, : len(drawn)]:
        axis.set_xlim(np.mean(axis.get_xlim()) - widest, np.mean(axis.get_xlim()) + widest)
    if drawn:
        axes[0, 0].set_ylabel("z (mm)")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
