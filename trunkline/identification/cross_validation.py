"""What a stage would find without some of its trials, and how well that predicts them."""

from dataclasses import replace

import numpy as np

from trunkline.identification.evaluation import replay, scores
from trunkline.identification.experiment import Experiment
from trunkline.identification.fit import Fit
from trunkline.identification.identify import Identification, identify
from trunkline.identification.optimizers import LeastSquares
from trunkline.trials.splits import IDENTIFY


def cross_validate(
    label: str,
    result: Identification,
    experiments: list[Experiment],
    fit: Fit,
    folds: int,
) -> dict[str, dict[str, float]]:
    """Errors on trials of the `identify` split that the fit did not see, before and after per-joint tuning.

    Every trial is left out once. A fit on the others starts from the one on all: least squares ends in the same place
    from there, and sooner. Per-joint tuning that only fits noise lowers the errors of `identify` but not these. A
    measured shape at rest is the one of all releases, those left out included.

    Args:
        folds: into how many groups the trials go, in turn.

    Returns:
        "coarse" and "identified", each with `e_internal_mm`, `e_position_mm`, `e_tip_mm` and `e_tip_pct`, means over
        all left-out trials; without tip errors where a group never saw the tip.
    """
    seen = [e for e in experiments if e.split == IDENTIFY]
    near = replace(fit.method, optimizer=LeastSquares(starts=0, descents=1, iterations=1, tolerance=1.0))
    rows: dict[str, list] = {"coarse": [], "identified": []}
    for fold in range(folds):
        left_out = seen[fold::folds]
        kept = [e for i, e in enumerate(seen) if i % folds != fold]
        title = f"{label} fold {fold + 1} of {folds}"
        found = identify(title, result.models["coarse"], kept, replace(fit, method=near))
        for name, table in rows.items():
            model = found.models[name]
            found_scores = scores(replay(model, left_out, fit.segments), left_out)[IDENTIFY]
            table.append((len(left_out), found_scores))
    return {
        name: {
            key: float(np.average([row[key] for _, row in table], weights=[count for count, _ in table]))
            for key in ("e_internal_mm", "e_position_mm", "e_tip_mm", "e_tip_pct")
            if all(key in row for _, row in table)
        }
        for name, table in rows.items()
    }
