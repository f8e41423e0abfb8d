"""What a pipeline has found, from the files that its stages write: parameters with their intervals, and errors."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.identification.evaluation.error_tables import TABLED
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.stages import STAGES, read_tables
from trunkline.recordings.trials.splits import TEST, VALIDATE
from trunkline.twin.posterior import Posterior


@dataclass(frozen=True)
class Results:
    """posterior: of the parameters. split: whose errors these are. trials: of it. errors: (position, tip) in mm, by
    what they are of. All empty where no stage has run."""

    name: str
    posterior: Posterior
    split: str
    trials: int
    errors: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Drift:
    """Of a parameter since another session: as a share of ln(value), or in its unit if signed, ± half_width.

    Both intervals are taken as independent and symmetric where the parameter is searched.
    """

    change: float
    half_width: float

    @property
    def beyond(self) -> bool:
        return abs(self.change) > self.half_width


def read_results(name: str, folder: Path) -> Results:
    """Of the pipeline in `folder`.

    Raises:
        InputError: a file there is not what a stage writes.
    """
    posterior, split, trials, errors = Posterior.from_tables(read_tables(folder / "artifacts")), "", 0, {}
    scored = _read(folder / "artifacts/score/metrics.json")
    for stage in STAGES:
        scores, which = scored.get(stage, {}), TEST
        if not scores:  # not scored, or no trial to be scored on
            scores, which = _read(folder / "artifacts" / stage / "metrics.json"), VALIDATE
        compared = {model: scores[model][which] for model in TABLED if which in scores.get(model, {})}
        if "identified" in compared and (which == TEST or split != TEST):
            split, trials = which, compared["identified"]["trials"]
            errors = {model: (row["e_position_mm"], row["e_tip_mm"]) for model, row in compared.items()}
    return Results(name, posterior, split, trials, errors)


def drift(now: Results, before: Results) -> dict[str, Drift]:
    """Of the parameters that both have."""
    drifts, new, old = {}, now.posterior, before.posterior
    for i, name in enumerate(new.names):
        if name in old.names:
            j, scale = old.names.index(name), parameter_named(name).scale
            change = float(new.estimate[i] - old.estimate[j]) * scale
            drifts[name] = Drift(change, float(np.hypot(new.half_width[i], old.half_width[j])) * scale)
    return drifts


def _read(file: Path) -> dict:
    if not file.is_file():
        return {}
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{file}: {error}, expected what a stage writes") from error
