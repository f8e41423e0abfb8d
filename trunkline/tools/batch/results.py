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


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter. low, high: of its 95 % interval, given the model."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Results:
    """parameters: by name, as the last stage that identified each has it. split: whose errors these are. trials: of
    it. errors: (position, tip) in mm, by what they are of. All empty where no stage has run."""

    name: str
    parameters: dict[str, ParameterEstimate]
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
    parameters, split, trials, errors = {}, "", 0, {}
    for table in read_tables(folder / "artifacts").values():
        for key, row in table["parameters"].items():
            low, high = row["interval_95_given_model"]
            parameters[key] = ParameterEstimate(row["value"], low, high, row["unit"])
    scored = _read(folder / "artifacts/score/metrics.json")
    for stage in STAGES:
        scores, which = scored.get(stage, {}), TEST
        if not scores:  # not scored, or no trial to be scored on
            scores, which = _read(folder / "artifacts" / stage / "metrics.json"), VALIDATE
        compared = {model: scores[model][which] for model in TABLED if which in scores.get(model, {})}
        if "identified" in compared and (which == TEST or split != TEST):
            split, trials = which, compared["identified"]["trials"]
            errors = {model: (row["e_position_mm"], row["e_tip_mm"]) for model, row in compared.items()}
    return Results(name, parameters, split, trials, errors)


def drift(now: Results, before: Results) -> dict[str, Drift]:
    """Of the parameters that both have."""
    drifts = {}
    for name in now.parameters.keys() & before.parameters.keys():
        parameter, new, old = parameter_named(name), now.parameters[name], before.parameters[name]
        scale = parameter.scale if parameter.signed else 1.0
        change = float(parameter.coordinate(new.value) - parameter.coordinate(old.value)) * scale
        mine, theirs = (float(np.ptp(parameter.coordinate([row.low, row.high]))) / 2 * scale for row in (new, old))
        drifts[name] = Drift(change, float(np.hypot(mine, theirs)))
    return {name: drifts[name] for name in now.parameters if name in drifts}


def _read(file: Path) -> dict:
    if not file.is_file():
        return {}
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{file}: {error}, expected what a stage writes") from error
