"""A batch of arms as tables: errors and parameters of every arm, and by how much they have drifted."""

import numpy as np
import pandas as pd

from trunkline.identification.evaluation.error_tables import LABELS, TABLED, pair
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.tools.batch.results import Drift, Results


def error_table(fleet: list[Results]) -> list[str]:
    """A row an arm."""
    lines = [f"| position / tip error, mm | trials | {' | '.join(LABELS[model] for model in TABLED)} |"]
    lines.append("|---|---|" + "---:|" * len(TABLED))
    for arm in fleet:
        cells = [pair(*arm.errors.get(model, (None, None))) for model in TABLED]
        count = f"{arm.trials} of `{arm.split}`" if arm.split else "–"
        lines.append(f"| {arm.name} | {count} | {' | '.join(cells)} |")
    return lines


def parameter_table(fleet: list[Results], drifts: dict[str, dict[str, Drift]]) -> list[str]:
    """A row a parameter, a column an arm: the value, its interval, and by how much it drifted."""
    lines = [f"| parameter | {' | '.join(arm.name for arm in fleet)} |", "|---|" + "---:|" * len(fleet)]
    for name in parameters_of(fleet):
        unit, cells = parameter_named(name).unit, []
        for arm in fleet:
            if name not in arm.posterior.names:
                cells.append("–")
                continue
            change = drifts.get(arm.name, {}).get(name)
            suffix = "" if change is None else f", {drift_words(name, change)}"
            low, high = arm.posterior.interval(name)
            cells.append(f"{_number(arm.posterior.value(name))} ({_number(low)} to {_number(high)}){suffix}")
        lines.append(f"| `{name}`{f', {unit}' if unit else ''} | {' | '.join(cells)} |")
    return lines


def drift_words(name: str, change: Drift) -> str:
    """Such as `**-5.1 % ± 1.2**`, in bold where it is beyond what both intervals leave open."""
    if parameter_named(name).signed:
        text = f"{change.change:+.2g} ± {change.half_width:.2g}"
    else:
        size, width = 100 * np.expm1(change.change), 100 * np.exp(change.change) * change.half_width
        text = f"{'-' if size < 0 else '+'}{_number(abs(size))} % ± {_number(width)}"
    return f"**{text}**" if change.beyond else text


def parameters_of(fleet: list[Results]) -> list[str]:
    """Names of all that any arm has, in the order of the stages."""
    return list(dict.fromkeys(name for arm in fleet for name in arm.posterior.names))


def long_table(fleet: list[Results], drifts: dict[str, dict[str, Drift]], since: dict[str, str]) -> pd.DataFrame:
    """A row an arm and number: parameters with intervals and drift (of ln(value), or in the unit), errors in mm."""
    rows = []
    for arm in fleet:
        for name in arm.posterior.names:
            low, high = arm.posterior.interval(name)
            change = drifts.get(arm.name, {}).get(name)
            drifted = {} if change is None else {
                "drift": change.change, "drift_half_width": change.half_width, "since": since[arm.name]
            }  # fmt: skip
            row = {"arm": arm.name, "kind": "parameter", "name": name, "value": arm.posterior.value(name), "low": low}
            rows.append(row | {"high": high, "unit": parameter_named(name).unit} | drifted)
        for model, millimetres in arm.errors.items():
            for error, value in zip(("position", "tip"), millimetres, strict=True):
                name = f"{model}_{error}_{arm.split}"
                rows.append({"arm": arm.name, "kind": "error", "name": name, "value": value, "unit": "mm"})
    columns = ["arm", "kind", "name", "value", "low", "high", "unit", "drift", "drift_half_width", "since"]
    return pd.DataFrame(rows, columns=columns)


def _number(value: float) -> str:
    """Three digits that count, without a power of ten where that is as short."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
