"""What is said about the network: its errors in a few numbers, and how they spread."""

import numpy as np
import pandas as pd

from trunkline.kinematics.ik.learn import Learned
from trunkline.kinematics.ik.onnx import OPSET
from trunkline.kinematics.ik.score import TipErrors


def summary(learned: Learned, length: float) -> dict:
    """The network in a few numbers, for metrics.json. `length`: of the arm, m."""
    return learned.errors["held out"].metrics(length) | {
        "unseen_angles": learned.errors["unseen angles"].metrics(length),
        "as_lengths": learned.as_lengths.metrics(length),
        "as_controls": learned.as_controls,
        **({"on_plant": learned.on_plant} if learned.on_plant else {}),
        "polished": learned.refined.metrics(length),
        "outside": {"targets": learned.outside, "beyond_range_m": learned.beyond_range},
        "onnx_max_abs_diff_m": learned.difference,
        "opset": OPSET,
        "parameters": sum(p.numel() for p in learned.network.parameters()),
    }


def histogram(errors: dict[str, TipErrors]) -> pd.DataFrame:
    """Share of the targets in bins of tip error, per set of targets."""
    edges = np.geomspace(1e-2, 1e2, 41)
    rows = []
    for name, error in errors.items():
        position = np.nan_to_num(error.position * 1e3, nan=edges[-1])
        counts, _ = np.histogram(np.clip(position, edges[0], edges[-1]), edges)
        rows += [
            {"error_mm": middle, "targets_pct": 100 * n / len(position), "targets": name}
            for middle, n in zip(np.sqrt(edges[1:] * edges[:-1]), counts, strict=True)
        ]
    return pd.DataFrame(rows)
