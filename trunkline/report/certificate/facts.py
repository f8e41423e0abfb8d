"""All that a certificate says, as one plain dictionary: facts.json, and what the page shows."""

import numpy as np

from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.identification.stages import last_stages, model_name
from trunkline.recordings.trials.conditions import Conditions
from trunkline.report.certificate.budget import COVERAGE, LEAST, Budget
from trunkline.report.certificate.words import certainty_words, open_lines, strong_pairs, telling

SHOWN = ("identified", "cad", "null", "null_straight", "noise_floor")  # models of the table of errors
ERRORS = ("e_position_mm", "e_position_pct", "e_tip_mm", "e_tip_pct")


def error_rows(stages: dict[str, dict], scored: dict[str, dict]) -> list[dict]:
    """The errors of every stage's model, the last one's, which is shipped, first: by split and, within it, by kind, all
    together first.

    Args:
        stages: metrics of the identification stages by name, with the splits that they may read. scored: of the stage
            `score`, by the same names, with the other one.
    """
    rows = []
    for stage in sorted(stages, key=lambda stage: stage != list(stages)[-1]):
        shipped = stage == list(stages)[-1]
        for metrics in (stages[stage], scored.get(stage, {})):
            for split in metrics.get("identified", {}):
                whole = {name: metrics[name][split] for name in SHOWN if split in metrics.get(name, {})}
                kinds = [None, *whole["identified"]["by_experiment"]]
                for kind in kinds if len(kinds) > 2 else kinds[1:]:
                    by_model = {name: scores if kind is None else scores["by_experiment"].get(kind, {})
                             for name, scores in whole.items()}  # fmt: skip
                    errors = {LABELS[name]: {key: scores[key] for key in ERRORS if key in scores}
                              for name, scores in by_model.items() if "e_position_mm" in scores}  # fmt: skip
                    trials = by_model["identified"]["trials"]
                    rows.append({"stage": stage, "model": model_name(stage, stages), "shipped": shipped, "split": split,
                                 "kind": kind, "trials": trials, "errors": errors})  # fmt: skip
    return rows


def parameter_facts(tables: dict[str, dict]) -> dict[str, dict]:
    """By stage: values with their intervals, of several sessions also what all but the first have for themselves; what
    trades off, what is told least, and what is open. A parameter that several stages identify is in the last of them
    alone, whose value the model has."""
    facts, keys = {}, ("parameters", "per_session")
    last = last_stages(tables, *keys)
    for stage, whole in tables.items():
        table = whole | {
            key: {name: row for name, row in whole[key].items() if last[name] == stage} for key in keys if key in whole
        }
        rows = {
            key: {name: _parameter_fact(name, row) for name, row in table[key].items()} for key in keys if key in table
        }
        facts[stage] = rows | {
            "trials": len(table["fitted_to"]),
            "weakest_direction": table["weakest_direction"],
            "hardly_told_apart": strong_pairs(table),
            "correlation": table["correlation"],
            "open": open_lines(table),
        }
    return facts


def _parameter_fact(name: str, row: dict) -> dict:
    keys = ("value", "unit", "interval_95_given_model", "range", "at_bound", "undetermined")
    wide = {"interval_95": row["interval_95"]} if "interval_95" in row else {}
    return {key: row[key] for key in keys} | wide | {"words": certainty_words(name, row), "told_by": telling(name)}


def uncertainty_facts(budget: Budget, conditions: Conditions, length: float, draws: int) -> dict:
    """The budget over its poses: of each line the root mean square of its contributions, mm."""
    finite = np.isfinite(budget.radius)
    radius = budget.radius[finite] * 1e3
    lines = []
    still = [source.name for source in budget.sources if source.contributions.max(initial=0) < LEAST]
    for source in (source for source in budget.sources if source.name not in still):
        share = _rms(source.contributions[finite]) * 1e3
        spread = source.uncertainty
        lines.append(
            {
                "source": source.name,
                "distribution": source.distribution,
                "standard_uncertainty": spread,
                "unit": source.unit,
                "sensitivity_mm": None if spread is None else share / spread,
                "contribution_mm": share,
            }
        )
    combined = _rms(budget.combined[finite]) * 1e3
    correlated = float(np.mean(budget.correlated[finite])) * 1e6
    return {
        "coverage": COVERAGE,
        "poses": len(budget.radius),
        "without_rest": int((~finite).sum()),
        "draws": draws,
        "conditions": vars(conditions),
        "radius_mm": {"median": np.median(radius), "p95": np.quantile(radius, 0.95), "max": radius.max()},
        "radius_pct": {"median": np.median(radius) / length / 10},
        "combined_mm": combined,
        "correlations_mm2": correlated,
        "lines": lines,
        "move_no_tip": still,
    }


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
