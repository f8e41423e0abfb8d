"""Whether what previews state comes true: probabilities of grasps and hand-overs, and the radius about the tip's end.

A page says "in 90 % of cases the robot's tip ends within r mm of the preview's", or that this is unknown. A run's tip
is inside where it is no further than r from where the preview's is, with nothing in the way; how far it is over r says
by how much a radius is too small where none are inside.
"""

import numpy as np

from rehearsal.experiments.calibration import base_brier, brier, stated
from rehearsal.experiments.result import LATER, Result, share_of
from trunkline.ar.hybrid.rates import wilson

PROBABLE = ("grasp", "handle")  # whose previews state a probability
REACH = "reach"  # whose previews state a radius
NEAR, FARTHER = 10.0, 2.0  # mm from a target that is reached; by which a correction shall never lead away from it


def scores(results: list[Result]) -> dict:
    """`preview` of metrics.json: of runs without a variant; without a key where no run has what it is of.

    previews, agreed: how many had a probability, and of how many it came out so; agreement: their share, from `low` to
    `high`, Wilson's; path_pct_median: %; brier, brier_base. radius_mm: median and 95th percentile. coverage: for each
    of LATER, runs with a radius, those `inside`, their share, from `low` to `high`. tip_error_radii: likewise, median
    of the tip's distance over the radius. A tip that is nowhere is outside, and infinitely far. touching_mm: median
    distance beside the object. cameras: of the runs that could correct themselves by them, those of which the tip then
    is within NEAR of its target, `with` and `without`, as coverage; `farther`: of how many the correction led away.
    """
    plain = [result for result in results if not result.variant]
    probable = [row for row in plain if row.experiment in PROBABLE and np.isfinite(row.probability)]
    reached = [row for row in plain if row.experiment == REACH]
    return {**probabilities(probable), **_radii(reached), **_corrections(reached)}


def probabilities(rows: list[Result]) -> dict:
    """Of runs that all have a probability; nothing of none. What was never judged did not agree."""
    if not rows:
        return {}
    agreed, (probability, outcome) = int(sum(row.agreed == 1 for row in rows)), stated(rows)
    low, high = wilson(agreed, len(rows))
    paths = [row.path_pct for row in rows if np.isfinite(row.path_pct)]
    table = {"previews": len(rows), "agreed": agreed, "agreement": agreed / len(rows), "low": low, "high": high}
    table |= {"brier": brier(probability, outcome), "brier_base": base_brier(outcome)}
    return table | ({"path_pct_median": float(np.median(paths))} if paths else {})


def _radii(rows: list[Result]) -> dict:
    radius = np.array([row.radius_mm for row in rows])
    if not np.isfinite(radius).any():
        return {}
    rows, radius = [row for row in rows if np.isfinite(row.radius_mm)], radius[np.isfinite(radius)]
    coverage, errors = {}, {}
    for name in LATER:
        off = np.array([getattr(row, f"{name}_mm") for row in rows])
        inside, share, low, high = share_of(covered(off, radius))
        coverage[name] = {"runs": len(rows), "inside": inside, "share": share, "low": low, "high": high}
        errors[name] = {"median": float(np.median(np.where(np.isfinite(off), off, np.inf) / radius))}
    median, p95 = (float(value) for value in np.quantile(radius, (0.5, 0.95)))
    table = {"radius_mm": {"median": median, "p95": p95}, "coverage": coverage, "tip_error_radii": errors}
    touching = [row.touching_mm for row in rows if np.isfinite(row.touching_mm)]
    return table | ({"touching_mm": {"median": float(np.median(touching))}} if touching else {})


def _corrections(rows: list[Result]) -> dict:
    rows = [row for row in rows if row.correction]
    if not rows:
        return {}
    off, corrected = (np.array([getattr(row, name) for row in rows]) for name in ("off_target_mm", "corrected_mm"))
    table: dict = {"farther": int((~(corrected <= off + FARTHER)).sum())}
    for name, errors in (("without", off), ("with", corrected)):
        inside, share, low, high = share_of(errors <= NEAR)
        table[name] = {"runs": len(rows), "inside": inside, "share": share, "low": low, "high": high}
    return {"cameras": table}


def covered(off: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Whether tips so far from the middle of what was stated are inside of it; NaN is not. Shape (n,)."""
    return off <= radius
