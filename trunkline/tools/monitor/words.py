"""The monitor in words: a line a trial, what has changed, and the chart as a table."""

from collections import Counter

import numpy as np
import pandas as pd

from trunkline.identification.parameters.parameters import parameter_named
from trunkline.tools.monitor.attribution import Attribution, Change
from trunkline.tools.monitor.baseline import LEAST, Baseline
from trunkline.tools.monitor.control_chart import Chart, Charted

TWO_SIDED = 1.96
REPEATED = 2  # times a condition, on average, from which the reference knows few of those to come
HARDLY = 100.0  # %, of a change that one trial does not tell from none


def amount(name: str, size: float, half_width: float | None = None) -> str:
    """A change of a parameter, such as `stiffness -5.2 % ± 0.8`; size: where it is searched."""
    unit, scale = shown_in(name)
    if parameter_named(name).signed:
        value, width = size * scale, None if half_width is None else half_width * scale
    else:
        value, width = 100 * np.expm1(size), None if half_width is None else 100 * np.exp(size) * half_width
    sign = "-" if value < 0 else "+"
    return f"{name} {sign}{_short(abs(value))} {unit}".rstrip() + ("" if width is None else f" ± {_short(width)}")


def _short(value: float) -> str:
    """Two digits that count, and no power of ten."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def shown_in(name: str) -> tuple[str, float]:
    """The unit in which changes of a parameter are printed, and how many of it a step of 1 is where it is searched (for
    ln(value), in which a step is a share, to first order)."""
    parameter = parameter_named(name)
    if not parameter.signed:
        return "%", 100.0
    return ("°", float(np.degrees(parameter.scale))) if parameter.unit == "rad" else (parameter.unit, parameter.scale)


def trial_line(where: str, charted: Charted, chart: Chart, names: tuple[str, ...]) -> str:
    """A line for a new trial: the parameter whose chart is nearest to its limit, or beyond."""
    if not charted.levels:
        kind = charted.score.kind
        count = sum(score.kind == kind for score in chart.baseline.reference)
        return f"{where}: says nothing: found {count} reference trials of {kind}, it takes {LEAST + 1} or more"
    most = max(charted.levels, key=lambda p: abs(charted.levels[p]) / chart.lines[p].limit)
    departure, name = charted.departures[most], names[most]
    state = "beyond limits: chart of" if charted.alarms else "within limits, nearest: chart of"
    level = f"{name} at {charted.levels[most]:+.1f} of ± {chart.lines[most].limit:.1f}"
    alone = amount(name, departure.change, TWO_SIDED * departure.deviation).removeprefix(f"{name} ")
    return f"{where}: {state} {level}, this trial alone {alone}"


def change_lines(chart: Chart, attribution: Attribution, names: tuple[str, ...], wheres: list[str]) -> list[str]:
    """That the arm has changed, and which parameter would explain it. wheres: of the chart's trials."""
    at, since = chart.changed(), chart.suspects()
    assert at is not None, "asked for where there was an alarm"
    first = wheres[at - len(since) + 1]
    trials = f"{len(since)} trial{'s' if len(since) > 1 else ''}"
    lines = [f"the arm has changed: seen at {wheres[at]}, by {trials} since {first}"]
    lines.append(f"explained best by {_amount_of(attribution.best, names)}")
    if attribution.alike:
        others = "; ".join(_amount_of(change, names) for change in attribution.alike)
        lines.append(f"these trials cannot tell it apart from {others}")
    if not attribution.whole:
        lines.append("no single parameter explains all of it: what is left is more than chance")
    return lines


def _amount_of(change: Change, names: tuple[str, ...]) -> str:
    return amount(names[change.parameter], change.size, change.half_width)


def reference_lines(baseline: Baseline, chart: Chart, names: tuple[str, ...]) -> list[str]:
    """How many trials of each kind, under how many conditions, stand for the unchanged arm; which change a trial of
    each shows; and what is not charted."""
    kinds = list(dict.fromkeys(score.kind for score in baseline.reference))
    trials = Counter(score.kind for score in baseline.reference)
    conditions = Counter(kind for kind, *_ in {score.condition for score in baseline.reference})
    lines = ["reference: " + ", ".join(f"{trials[kind]} {kind} under {conditions[kind]} conditions" for kind in kinds)]
    if repeated := [kind for kind in kinds if trials[kind] >= REPEATED * conditions[kind]]:
        lines.append(f"  few conditions of {', '.join(repeated)}, as where a session is planned for identification: "
                     "trials under others may raise more false alarms (docs/lab-tools.md)")  # fmt: skip
    for kind in kinds:
        widths = []
        for p in chart.lines:
            departures = [departure for score in baseline.reference if score.kind == kind
                   and (departure := baseline.departure(score, p)) is not None]  # fmt: skip
            if departures:
                unit, scale = shown_in(names[p])
                width = TWO_SIDED * scale * float(np.median([departure.deviation for departure in departures]))
                if unit != "%" or width < HARDLY:
                    widths.append(f"{names[p]} {_short(width)} {unit}".rstrip())
        lines.append(f"  one {kind} tells to ±: {', '.join(widths) or f'nothing, it takes {LEAST + 1} or more'}")
    lines += [f"  {line}" for line in outlier_lines(baseline, names)]
    idle = [name for p, name in enumerate(names) if p not in chart.lines]
    return lines + ([f"  not charted, as the reference does not tell them: {', '.join(idle)}"] if idle else [])


def outlier_lines(baseline: Baseline, names: tuple[str, ...]) -> list[str]:
    """Which reference trials were left out, and of what."""
    lines = []
    for number, unlike in baseline.outliers.items():
        trial, charts = baseline.reference[number].name, ", ".join(names[p] for p in unlike)
        lines.append(f"{trial} is unlike the others of its kind, and left out of the charts of {charts}")
    return lines


def chart_table(chart: Chart, names: tuple[str, ...], wheres: list[str]) -> pd.DataFrame:
    """A row a trial and parameter. change, deviation: in `unit`."""
    rows = []
    for number, (trial, where) in enumerate(zip(chart.trials, wheres, strict=True), 1):
        for p, departure in trial.departures.items():
            unit, scale = shown_in(names[p])
            rows.append(
                {
                    "number": number, "trial": where, "kind": trial.score.kind, "parameter": names[p],
                    "change": departure.change * scale, "deviation": departure.deviation * scale, "unit": unit,
                    "z": departure.z, "chart": trial.levels[p], "limit": chart.lines[p].limit,
                    "beyond": p in trial.alarms,
                }
            )  # fmt: skip
    columns = ["number", "trial", "kind", "parameter", "change", "deviation", "unit", "z", "chart", "limit", "beyond"]
    return pd.DataFrame(rows, columns=columns)
