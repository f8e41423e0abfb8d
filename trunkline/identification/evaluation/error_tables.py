"""Errors as tables: of every trial, so that a bad one is seen, and along the arm."""

import numpy as np
import pandas as pd

from trunkline.identification.evaluation.evaluation import Prediction, survived, trial_errors
from trunkline.identification.simulate.experiment import Experiment

# by name in metrics.json: how tables and figures call a model, and what it stands beside
LABELS = {
    "identified": "identified",
    "smooth": "cables do not rub",
    "model": "model",
    "cad": "CAD",
    "initial": "initial",
    "coarse": "coarse",
    "null": "null: mean rest shape",
    "null_straight": "null: straight arm",
    "null_held": "null: start held",
    "noise_floor": "noise floor",
    "prompt": "identified, winches that wind as they are told",
}
REFERENCES = ("cad", "null", "null_straight", "null_held", "noise_floor")  # all that a model stands beside
TABLED = ("identified", "cad", "null", "noise_floor")  # where four columns have to do


def number(value: float | None, digits: int = 3) -> str:
    """A cell of a table for people: so many digits that count, a dash for what there is not."""
    return "–" if value is None or pd.isna(value) else f"{value:.{digits}g}"


def pair(position: float | None, tip: float | None) -> str:
    """Position and tip error as a cell."""
    return "–" if position is None else f"{number(position)} / {number(tip)}"


def trial_table(predictions: dict[str, Prediction]) -> pd.DataFrame:
    """A row a trial and model: columns trial, experiment, split, model, e_internal_mm, e_position_mm, e_tip_mm,
    e_tip_pct, e_velocity_mm_s; nan where a trial has no such error. Models have their `LABELS`."""
    names = ("e_internal_mm", "e_position_mm", "e_tip_mm", "e_tip_pct", "e_velocity_mm_s")
    return pd.DataFrame(
        [
            {"trial": e.name, "experiment": e.kind, "split": e.split, "model": LABELS[model]}
            | {name: row.get(name, np.nan) for name in names}
            for model, prediction in predictions.items()
            for e, row in trial_errors(prediction)
        ]
    )


def marker_table(predictions: dict[str, Prediction], markers: tuple[str, ...]) -> pd.DataFrame:
    """The position error along the arm, mean over frames, then over the trials of a kind: columns experiment, model,
    marker, from_base_mm (in the straight arm), e_position_mm. Models have their `LABELS`."""
    rows = []
    for model, prediction in predictions.items():
        replayed = prediction.replay
        places = np.linalg.norm(replayed.straight, axis=1) * 1e3
        for kind in sorted({e.kind for e in prediction.experiments}):
            errors = [
                _along(positions, e, replayed.length)
                for positions, e in zip(replayed.positions, prediction.experiments, strict=True)
                if e.kind == kind
            ]
            valid = np.isfinite(errors)
            means = np.where(valid, errors, 0).sum(axis=0) / np.where(valid.any(axis=0), valid.sum(axis=0), np.nan)
            for index in np.argsort(places):
                rows.append((kind, LABELS[model], markers[index], places[index], means[index] * 1e3))
    return pd.DataFrame(rows, columns=["experiment", "model", "marker", "from_base_mm", "e_position_mm"])


def _along(positions: np.ndarray, experiment: Experiment, length: float) -> np.ndarray:
    """Mean distance of each marker from its measurement, m; nan for one that was never measured. Shape (S,)."""
    distances = np.linalg.norm(survived(positions, length) - experiment.positions, axis=-1)
    count = experiment.measured.sum(axis=0)
    return np.where(experiment.measured, distances, 0).sum(axis=0) / np.where(count, count, np.nan)
