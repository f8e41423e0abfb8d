"""What is said about the data set: how even, how exact, what was dropped."""

import numpy as np
import pandas as pd

from trunkline.kinematics.dataset.gather import GatheredSamples
from trunkline.kinematics.dataset.table import Density


def unevenness_table(densities: list[Density]) -> pd.DataFrame:
    """Per gravity and stage of thinning, the spread of the tip density."""
    rows = []
    for density in sorted(densities, key=lambda density: density.angle):
        for name, value in zip(("before", "after"), density.unevenness(), strict=True):
            rows.append({"angle_deg": np.degrees(density.angle).round(6), "unevenness": value, "thinning": name})
    return pd.DataFrame(rows)


def summary(gathered: GatheredSamples) -> dict:
    """The data set in a few numbers, for metrics.json."""
    table, densities, deviation = gathered.table, gathered.densities, gathered.deviation
    before, after = np.mean([density.unevenness() for density in densities], axis=0)
    return {
        "samples": len(table),
        "angles": len(densities),
        "candidates": sum(len(d.before) + d.failed + d.snapped for d in densities),
        "failed": sum(d.failed for d in densities),
        "snapped": sum(d.snapped for d in densities),
        "residual_max": table["residual"].max(),
        "iterations_median": table["iterations"].median(),
        "density_unevenness": {"before": before, "after": after},
        "mujoco_deviation_mm": spread(deviation["deviation_mm"], skipna=False),
        "mujoco_checked": len(deviation),
        "mujoco_rested": int(deviation["rested"].sum()),
        "friction_band_mm": spread(deviation["friction_band_mm"]),
        "friction_band_found": int(deviation["friction_band_mm"].notna().sum()),
    }


def spread(values: pd.Series, skipna: bool = True) -> dict:
    """Median, 95th percentile and largest; without `skipna`, all are NaN if one is."""
    if not skipna and values.isna().any():
        return {"median": np.nan, "p95": np.nan, "max": np.nan}
    return {"median": values.median(), "p95": values.quantile(0.95), "max": values.max()}
