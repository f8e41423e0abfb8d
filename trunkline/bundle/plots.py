"""Pictures of the package."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from trunkline.plots import IDENTIFIED, MEASURED


def roundtrip_figure(
    time: np.ndarray, calibrated: np.ndarray, bundled: np.ndarray, gap_mm: np.ndarray
) -> Figure:
    """The tip in the calibrated and in the packed model, and the largest distance of any body between them.

    Args:
        time: s, shape (steps,). calibrated, bundled: tip positions, m, shape (steps, 3).
        gap_mm: shape (steps,).
    """
    figure, (above, below) = plt.subplots(2, 1, figsize=(7, 4.5), sharex=True, height_ratios=(3, 1))
    for axis, name in ((0, "x"), (2, "z")):
        above.plot(
            time, 1e3 * calibrated[:, axis], color=MEASURED, lw=3, alpha=0.35, label=f"calibrated, {name}"
        )
        above.plot(
            time, 1e3 * bundled[:, axis], color=IDENTIFIED, lw=1.2, ls="--", label=f"from the package, {name}"
        )
    above.set(title="The packed model moves as the calibrated one does", ylabel="tip unit (mm)")
    above.legend(ncols=2)
    below.plot(time, gap_mm, color=IDENTIFIED)
    below.set(xlabel="time (s)", ylabel="largest gap (mm)")
    return figure
