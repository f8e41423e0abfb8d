"""What a stage would find without some of its trials, and how well that predicts them."""

from dataclasses import replace

import pandas as pd

from trunkline.identification.evaluation.error_tables import trial_table
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import Identification, identify
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.parameters.tolerances import Tolerances
from trunkline.identification.simulate.experiment import Experiment
from trunkline.recordings.trials.splits import IDENTIFY

ERRORS = ("e_internal_mm", "e_position_mm", "e_tip_mm", "e_tip_pct")


def errors_left_out(
    label: str, result: Identification, experiments: list[Experiment], fit: Fit, folds: int
) -> pd.DataFrame:
    """Errors on trials of the `identify` split that the fit did not see, as `error_tables.trial_table` gives them.

    Every trial is left out once. A fit on the others starts from the one on all: least squares ends in the same place
    from there, and sooner. Models are "coarse" and "identified", before and after per-joint tuning: what only fits
    noise lowers the errors of `identify` but not these. A measured shape at rest is the one of all releases, those left
    out included.

    Args:
        folds: into how many groups the trials go, in turn.
    """
    fitted = [e for e in experiments if e.split == IDENTIFY]
    near = replace(fit.method, optimizer=LeastSquares(starts=0, descents=1, iterations=1, tolerance=1.0))
    tables = []
    for fold in range(folds):
        left_out = fitted[fold::folds]
        others = [e for i, e in enumerate(fitted) if i % folds != fold]
        title = f"{label} fold {fold + 1} of {folds}"
        refit = identify(title, result.models["coarse"], others, replace(fit, method=near, considered=Tolerances()))
        models = {name: refit.models[name] for name in ("coarse", "identified")}
        replays = {name: replay(model, left_out, fit.markers) for name, model in models.items()}
        tables.append(trial_table({name: Prediction(replayed, left_out) for name, replayed in replays.items()}))
    return pd.concat(tables, ignore_index=True)


def cross_validate(
    label: str, result: Identification, experiments: list[Experiment], fit: Fit, folds: int
) -> dict[str, dict[str, float]]:
    """The means of `errors_left_out`, whose arguments these are: for "coarse" and "identified" `e_internal_mm`,
    `e_position_mm`, `e_tip_mm` and `e_tip_pct`; without tip errors where a trial never saw the tip."""
    table = errors_left_out(label, result, experiments, fit, folds)
    rows = table.groupby("model", sort=False)[list(ERRORS)].mean()
    whole = [name for name in ERRORS if table[name].notna().all()]
    return {str(model): {name: float(row[name]) for name in whole} for model, row in rows.iterrows()}
