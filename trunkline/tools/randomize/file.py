"""randomisation.json: the distribution for programs that know nothing of Trunkline, and read back."""

import json
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import parameter_name, parameter_named
from trunkline.tools.randomize.fields import OWN
from trunkline.twin.posterior import Posterior

FORMAT = "trunkline randomisation 2"
MEANING = {
    "distribution": "t: value is Student's t about the centre; log-t: ln(value) is",
    "scale": "of t, for ln(value) where log-t, for the value where t; unit: the value's",
    "scale_matrix": "of the group's multivariate t, of the same; groups are independent of each other",
    "limits": "what is drawn beyond one counts as at it",
    "fields": "of MjModel that it writes, and how many numbers of each",
}


def to_table(posterior: Posterior, arms: int, fields: dict[str, dict[str, int]], model: dict[str, str]) -> dict:
    """Args: arms: how many it comes from. fields: as `changed_fields` gives them. model: what says which model it is
    for."""
    parameters, units = {}, np.array([parameter_named(name).scale for name in posterior.names])
    for i, name in enumerate(posterior.names):
        parameters[name] = {
            "unit": parameter_named(name).unit,
            "distribution": "t" if parameter_named(name).signed else "log-t",
            "centre": posterior.value(name),
            "scale": float(posterior.deviation[i] * units[i]),
            "interval_95": list(posterior.interval(name)),
            "limits": [float(posterior.low[i]), float(posterior.high[i])],
            "group": posterior.stages[i],
            "fields": fields[name],
            "read_by": "trunkline" if set(fields[name]) == {OWN} else "mujoco",
        }
    matrix, groups = posterior.covariance * np.outer(units, units), {}
    for group in dict.fromkeys(posterior.stages):
        members = [i for i, other in enumerate(posterior.stages) if other == group]
        groups[group] = {
            "parameters": [posterior.names[i] for i in members],
            "degrees_of_freedom": float(posterior.degrees[members[0]]),
            "scale_matrix": matrix[np.ix_(members, members)].tolist(),
        }
    return {"format": FORMAT, "model": model, "arms": arms, "meaning": MEANING, "parameters": parameters,
            "groups": groups}  # fmt: skip


def read_randomization(path: Path) -> tuple[Posterior, dict[str, str]]:
    """The distribution, and what says which model it is for.

    Raises:
        InputError: it is no such file.
    """
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        if table["format"] != FORMAT:
            raise InputError(f"{path}: format: found {table['format']!r}, expected {FORMAT!r}")
        rows = table["parameters"]
        names = [name for group in table["groups"].values() for name in group["parameters"]]
        units = np.array([parameter_named(parameter_name(name)).scale for name in names])
        matrix, degrees = np.zeros((len(names), len(names))), np.zeros(len(names))
        for group in table["groups"].values():
            members = [names.index(name) for name in group["parameters"]]
            matrix[np.ix_(members, members)], degrees[members] = group["scale_matrix"], group["degrees_of_freedom"]
        deviation = np.array([float(rows[name]["scale"]) for name in names]) / units
        spread = np.where(deviation > 0, units * deviation, 1.0)
        correlation = matrix / np.outer(spread, spread)
        estimate = np.array([parameter_named(name).coordinate(rows[name]["centre"]) for name in names])
        low, high = np.array([rows[name]["limits"] for name in names], float).reshape(-1, 2).T
        stages = [rows[name]["group"] for name in names]
        return Posterior(names, stages, estimate, deviation, degrees, correlation, low, high), table["model"]
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}, expected a randomisation.json") from error
    except ValueError as error:
        raise InputError(f"{path}: {error}, in place of what `trunkline randomize` writes") from error
    except (KeyError, TypeError) as error:
        raise InputError(f"{path}: {error!r}, expected what `trunkline randomize` writes") from error
