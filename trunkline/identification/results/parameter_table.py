"""parameters.json: what was identified, how sure that is, and what the data leave open."""

import numpy as np

from trunkline.identification.fit.identify import Identification
from trunkline.identification.fit.intervals import weakest_in_words
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import SESSION_MARK, parameter_named

ENDS = np.array([-1, 1])


def parameter_table(result: Identification, bounds: dict[str, Bounds]) -> dict:
    """parameters.json: values, 95 % intervals, correlations, factors, and what the data leave open.

    A value is the scalar of the scaling law; the model's joint i has that times α^{3(i-1)} times its factor.
    Intervals are given what earlier stages found, and those of factors given the scalars; they end where the range
    does. `bootstrap_95_given_model` cross-checks `interval_95_given_model` by resampling trials. "Given model": they
    hold the truth if the model is right; what biases every trial alike shows in none of them. `interval_95` has what
    the model fixes beside, where it is considered, and `considered` by how much a standard deviation of each quantity
    moves each parameter, on the axis of the search.
    """
    names, certainty = list(result.values), result.certainty
    place = {name: i for i, name in enumerate(names)}
    initial, vague = result.models["initial"], undetermined(result, bounds)
    scalars = {}
    for i, (name, value) in enumerate(result.values.items()):
        estimate = parameter_named(name).coordinate(value)
        wide = _within(name, bounds, estimate + ENDS * result.half_width[i])
        scalars[name] = {
            "value": value,
            "unit": parameter_named(name).unit,
            "initial": parameter_named(name).read(initial),
            "interval_95_given_model": _within(name, bounds, estimate + ENDS * certainty.half_width[i]),
            **({"interval_95": wide} if result.considered else {}),
            "bootstrap_95_given_model": _within(name, bounds, result.bootstrap[:, i]),
            "range": [bounds[name].low, bounds[name].high],
            "at_bound": name in result.at_bound,
            "undetermined": name in vague,
        }
    per_session = {name: row for name, row in scalars.items() if SESSION_MARK in name}
    names = [name for name in names if name not in per_session]
    return {
        "parameters": {name: scalars[name] for name in names},
        **({"per_session": per_session} if per_session else {}),
        "correlation": {a: {b: certainty.correlation[place[a], place[b]] for b in names} for a in names},
        "condition": certainty.condition,
        "weakest_direction": weakest_in_words(list(result.values), certainty.weakest),
        "per_joint": _factor_table(result),
        **({"considered": _considered_table(result)} if result.considered else {}),
        "at_bound": result.at_bound,
        "influence": result.influence.table(),
        "trial_weights": dict(zip(result.influence.trials, result.influence.weights.tolist(), strict=True)),
    }


def _considered_table(result: Identification) -> dict:
    """By source and label of a quantity, by how much a standard deviation of it moves each parameter."""
    table: dict[str, dict] = {}
    for (source, label), move in result.considered.items():
        table.setdefault(source, {})[label] = dict(zip(result.values, move.tolist(), strict=True))
    return table


def undetermined(result: Identification, bounds: dict[str, Bounds]) -> list[str]:
    """Which scalars are left open: a 95 % interval, with what is considered, as wide as the range that was searched."""
    searched = {
        name: np.diff(parameter_named(name).coordinate([span.low, span.high]))[0] for name, span in bounds.items()
    }
    halves = zip(result.values, result.half_width, strict=True)
    return [name for name, half in halves if 2 * half > searched[name]]


def _within(name: str, bounds: dict[str, Bounds], interval: np.ndarray) -> list[float]:
    """An interval on the axis of the search as values, its ends no further out than those of the range searched."""
    parameter, span = parameter_named(name), bounds[name]
    return parameter.value(np.clip(interval, *parameter.coordinate([span.low, span.high]))).tolist()


def _factor_table(result: Identification) -> dict:
    """Factors on top of the scaling law by unit, with the half width of their 95 % intervals, null if infinite."""
    if not result.factors:
        return {}
    assert result.factor_certainty is not None, "factors are searched and judged together"
    widths = result.factor_certainty.half_width.reshape(len(result.factors), -1).tolist()
    return {
        name: {"factor": factors, "half_width_95_given_model": [half if np.isfinite(half) else None for half in width]}
        for (name, factors), width in zip(result.factors.items(), widths, strict=True)
    }
