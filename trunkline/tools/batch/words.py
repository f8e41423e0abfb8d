"""A fleet as tables: errors and parameters of every arm, and by how much they have drifted."""

import numpy as np
import pandas as pd

from trunkline.identification.evaluation.error_tables import LABELS, TABLED, pair
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.tools.batch.results import Drift, Results


def error_table(fleet: list[Results]) -> list[str]:
    """A row an arm."""
    lines = [f"| position / tip error, mm | trials | {' | '.join(LABELS[model] for model in TABLED)} |"]
    lines.append("|---|---|" + "---:|" * len(TABLED))
    for one in fleet:
        cells = [pair(*one.errors.get(model, (None, None))) for model in TABLED]
        count = f"{one.trials} of `{one.split}`" if one.split else "–"
        lines.append(f"| {one.name} | {count} | {' | '.join(cells)} |")
    return lines


def parameter_table(fleet: list[Results], drifts: dict[str, dict[str, Drift]]) -> list[str]:
    """A row a parameter, a column an arm: the value, its interval, and by how much it drifted."""
    lines = [f"| parameter | {' | '.join(one.name for one in fleet)} |", "|---|" + "---:|" * len(fleet)]
    for name in parameters_of(fleet):
        unit = next(one.parameters[name].unit for one in fleet if name in one.parameters)
        cells = []
        for one in fleet:
            found = one.parameters.get(name)
            if found is None:
                cells.append("–")
                continue
            own = drifts.get(one.name, {}).get(name)
            said = "" if own is None else f", {drift_words(name, own)}"
            cells.append(f"{_number(found.value)} ({_number(found.low)} to {_number(found.high)}){said}")
        lines.append(f"| `{name}`{f', {unit}' if unit else ''} | {' | '.join(cells)} |")
    return lines


def drift_words(name: str, own: Drift) -> str:
    """Such as `**-5.1 % ± 1.2**`, in bold where it is beyond what both intervals leave open."""
    if PARAMETERS[name].signed:
        said = f"{own.change:+.2g} ± {own.half_width:.2g}"
    else:
        size, width = 100 * np.expm1(own.change), 100 * np.exp(own.change) * own.half_width
        said = f"{'-' if size < 0 else '+'}{_number(abs(size))} % ± {_number(width)}"
    return f"**{said}**" if own.beyond else said


def parameters_of(fleet: list[Results]) -> list[str]:
    """Names of all that any arm has, in the order of the stages."""
    return list(dict.fromkeys(name for one in fleet for name in one.parameters))


def long_table(fleet: list[Results], drifts: dict[str, dict[str, Drift]], since: dict[str, str]) -> pd.DataFrame:
    """A row an arm and number: parameters with intervals and drift (of ln(value), or in the unit), errors in mm."""
    rows = []
    for one in fleet:
        for name, found in one.parameters.items():
            own = drifts.get(one.name, {}).get(name)
            drifted = {} if own is None else {
                "drift": own.change, "drift_half_width": own.half_width, "since": since[one.name]
            }  # fmt: skip
            row = {"arm": one.name, "kind": "parameter", "name": name, "value": found.value, "low": found.low}
            rows.append(row | {"high": found.high, "unit": found.unit} | drifted)
        for model, errors in one.errors.items():
            for error, value in zip(("position", "tip"), errors, strict=True):
                name = f"{model}_{error}_{one.split}"
                rows.append({"arm": one.name, "kind": "error", "name": name, "value": value, "unit": "mm"})
    columns = ["arm", "kind", "name", "value", "low", "high", "unit", "drift", "drift_half_width", "since"]
    return pd.DataFrame(rows, columns=columns)


def _number(value: float) -> str:
    """Three digits that count, without a power of ten where that is as short."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
