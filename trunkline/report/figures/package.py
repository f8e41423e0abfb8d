"""Pictures of the package."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from trunkline.report.figures.style import IDENTIFIED, INITIAL, MEASURED


def roundtrip_figure(time: np.ndarray, tips: dict[str, np.ndarray], gaps_mm: dict[str, np.ndarray]) -> Figure:
    """The tip in several models, and how far any body is from where the first model has it.

    Args:
        time: s, shape (steps,).
        tips: by model, the calibrated one first: positions in m, shape (steps, 3).
        gaps_mm: by each other model, shape (steps,).
    """
    figure, (above, below) = plt.subplots(2, 1, figsize=(7, 4.8), sharex=True, height_ratios=(3, 2))
    looks = [
        dict(color=MEASURED, lw=4, alpha=0.3),
        dict(color=IDENTIFIED, ls="--"),
        dict(color=INITIAL, ls=":"),
    ]
    for axis, name in ((0, "x"), (2, "z")):
        for (label, tip), look in zip(tips.items(), looks, strict=True):
            above.plot(time, 1e3 * tip[:, axis], label=label if axis == 0 else None, **look)
        start = next(iter(tips.values()))[0, axis]
        above.annotate(name, (0, 1e3 * start), xytext=(-12, -4), textcoords="offset points")
    above.set(title="The packed model moves as the calibrated one does", ylabel="tip (mm)")
    above.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, -0.2))
    for (label, gap), look in zip(gaps_mm.items(), looks[1:], strict=True):
        below.plot(time, 1e3 * gap, label=label, **look)
    below.set(xlabel="time (s)", ylabel="largest gap (µm)")
    return figure
