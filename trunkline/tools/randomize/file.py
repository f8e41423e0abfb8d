"""randomisation.json: the distribution for programs that know nothing of Trunkline, and read back."""

import json
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import NAMES, parameter_named
from trunkline.tools.randomize.fields import OWN
from trunkline.tools.randomize.randomization import MOST, Randomization

FORMAT = "trunkline randomisation 1"
LOGNORMAL, NORMAL = "lognormal", "normal"


def to_table(drawn: Randomization, fields: dict[str, dict[str, int]], model: dict[str, str]) -> dict:
    """Args: fields: as `changed_fields` gives them. model: what says which model it is for."""
    parameters, (low, high) = {}, drawn.interval
    for i, name in enumerate(drawn.names):
        parameters[name] = {
            "unit": parameter_named(name).unit,
            "distribution": NORMAL if parameter_named(name).signed else LOGNORMAL,
            "centre": float(drawn.centre[i]),
            "sd": float(drawn.deviation[i]),
            f"interval_{MOST}": [float(low[i]), float(high[i])],
            "limits": [float(drawn.low[i]), float(drawn.high[i])],
            "group": drawn.groups[i],
            "fields": fields[name],
            "read_by": "trunkline" if set(fields[name]) == {OWN} else "mujoco",
        }
    groups = {}
    for group in dict.fromkeys(drawn.groups):
        members = [i for i, other in enumerate(drawn.groups) if other == group]
        covariance = drawn.covariance[np.ix_(members, members)].tolist()
        groups[group] = {"parameters": [drawn.names[i] for i in members], "covariance": covariance}
    meaning = {
        "sd": "of ln(value) where lognormal, of the value where normal; unit: the value's",
        "covariance": "of the same, before limits cut; groups are independent of each other",
        "fields": "of MjModel that it writes, and how many numbers of each",
    }
    return {"format": FORMAT, "model": model, "arms": drawn.arms, "meaning": meaning, "parameters": parameters,
            "groups": groups}  # fmt: skip


def read_randomization(path: Path) -> tuple[Randomization, dict[str, str]]:
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
        centre = np.array([float(rows[name]["centre"]) for name in names])
        limits = np.array([rows[name]["limits"] for name in names], float).reshape(-1, 2)
        covariance, first = np.zeros((len(names), len(names))), 0
        for group in table["groups"].values():
            block = slice(first, first + len(group["parameters"]))
            covariance[block, block], first = group["covariance"], block.stop
        groups = [rows[name]["group"] for name in names]
        if unknown := [name for name in names if name not in NAMES]:
            raise InputError(f"{path}: parameters: found {unknown[0]!r}, expected one that can be identified")
        return Randomization(names, groups, centre, covariance, limits[:, 0], limits[:, 1], table["arms"]), table[
            "model"
        ]
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}, expected a randomisation.json") from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: {error!r}, expected what `trunkline randomize` writes") from error
