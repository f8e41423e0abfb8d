"""An evaluation in words: a table a trial, means by kind, and what changed since another evaluation."""

import json
from pathlib import Path

import pandas as pd

from trunkline.errors import InputError
from trunkline.identification.evaluation.error_tables import LABELS, REFERENCES, number, pair
from trunkline.program import aligned

ERRORS = ("e_internal_mm", "e_position_mm", "e_tip_mm")


def trial_lines(trials: pd.DataFrame, fitted: set[str]) -> list[str]:
    """A line a trial, `*` at those that the model was fitted to; position / tip error of what stands beside it."""
    models = {name for name, label in LABELS.items() if label in set(trials.model)}
    rows = [["trial", "experiment", "split", *_heads(models)]]
    for trial in dict.fromkeys(trials.trial):
        of_trial = trials[trials.trial == trial].set_index("model")
        errors = {name: of_trial.loc[LABELS[name]].to_dict() for name in models if LABELS[name] in of_trial.index}
        scores = errors["model"]
        label = f"{trial} *" if trial in fitted else trial
        rows.append([label, scores["experiment"], scores["split"], *_cells(errors, models)])
    return aligned(rows, 3)


def kind_lines(metrics: dict) -> list[str]:
    """A line a kind: means over its trials, and how well the arm repeats itself."""
    models = {name for name in ("model", *REFERENCES) if name in metrics}
    repeats = metrics["repeatability_mm"]
    rows = [["mean of", "trials", *_heads(models), "repeatability"]]
    for kind, table in metrics["model"]["by_experiment"].items():
        errors = {name: metrics[name]["by_experiment"].get(kind, {}) for name in models}
        repeat = repeats.get(kind, {})
        scatter = pair(repeat.get("mean_mm"), repeat.get("tip_mm"))
        rows.append([kind, str(table["trials"]), *_cells(errors, models), scatter])
    return aligned(rows, 1)


def read_reference(path: Path) -> dict:
    """The metrics.json of another evaluation, or that in its folder.

    Raises:
        InputError: there is none, or it is of something else.
    """
    file = path / "metrics.json" if path.is_dir() else path
    try:
        metrics = json.loads(file.read_text(encoding="utf-8"))
        _ = metrics["model"]["by_experiment"], metrics["evaluated"]["model"]
    except FileNotFoundError:
        raise InputError(f"--reference: {file}: no such file, expected metrics.json of another evaluation") from None
    except (ValueError, KeyError, TypeError) as error:
        expected = "expected what `trunkline evaluate` writes"
        raise InputError(f"--reference: {file}: {error!r}, {expected}") from error
    return metrics


def change_lines(before: dict, now: dict) -> list[str]:
    """Each kind's errors in a reference and now, and what else differs between the two."""
    rows = [["change of", *(f"{word}: then → now" for word in ("E_internal", "position", "tip"))]]
    old, new = (metrics["model"]["by_experiment"] for metrics in (before, now))
    for kind in sorted(old.keys() & new.keys()):
        rows.append([kind, *(_change(old[kind].get(error), new[kind].get(error)) for error in ERRORS)])
    lines = aligned(rows, 1)
    alone = [f"{kind} in the {where} alone" for kinds, where in ((old.keys() - new.keys(), "reference"),
             (new.keys() - old.keys(), "session")) for kind in sorted(kinds)]  # fmt: skip
    lines += [f"not compared: {', '.join(alone)}"] if alone else []
    for key, words in (("model", "another model"), ("frames", "other numbers of frames"), ("command_delay", "a delay")):
        old_value, new_value = (metrics["evaluated"].get(key) for metrics in (before, now))
        if old_value != new_value:
            both = f"({old_value}, here {new_value})"
            lines.append(f"the reference is of {words} {both}: not all of the change is the arm's")
    return lines


def _heads(models: set[str]) -> list[str]:
    return ["E_internal", "position", "tip", "tip %", *(LABELS[name] for name in REFERENCES if name in models)]


def _cells(errors: dict[str, dict], models: set[str]) -> list[str]:
    scores = errors["model"]
    pairs = [
        pair(row.get("e_position_mm"), row.get("e_tip_mm"))
        for row in (errors.get(name, {}) for name in REFERENCES if name in models)
    ]
    return [*(number(scores.get(error)) for error in (*ERRORS, "e_tip_pct")), *pairs]


def _change(old: float | None, new: float | None) -> str:
    if old is None or new is None:
        return "–"
    return f"{number(old)} → {number(new)} mm ({round(100 * (new / old - 1)):+d} %)"
