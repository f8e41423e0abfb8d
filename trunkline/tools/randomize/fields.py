"""Drawn parameters as fields of a MuJoCo model, for simulations that each have their own."""

from dataclasses import replace

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.parameters.parameters import candidate_fields, parameter_named
from trunkline.tools.randomize.randomization import Randomization

OWN = "numeric_data"  # numbers that MuJoCo only keeps: Trunkline's stepper reads them, others would not
STEP = 1e-3  # of x
NEAR = 1e-4  # of a value; an MJCF keeps fewer digits than parameters.json


def drawn_fields(model: mujoco.MjModel, values: dict[str, np.ndarray]) -> Fields:
    """Every field that any of the parameters writes, for n simulations: what `Batch.expand` takes.

    Args:
        model: the calibrated arm.
        values: name to values (n,), in the parameters' units.

    Returns:
        Field to its values, shape (n, ...). To the last bit those of `model` where the values are what it has.
    """
    extended = {name: np.append(parameter_named(name).read(model), drawn) for name, drawn in values.items()}
    fields = candidate_fields(model, extended)
    # rounding: what is written and what is in the model differ by it, so only the difference is added
    return {name: getattr(model, name) + (written[1:] - written[0]) for name, written in fields.items()}


def changed_fields(model: mujoco.MjModel, drawn: Randomization) -> dict[str, dict[str, int]]:
    """By parameter, the fields of `model` that a step of it changes, and how many numbers of each."""
    by_parameter = {}
    for i, name in enumerate(drawn.names):
        x = STEP * np.eye(len(drawn.names))[[i, i]] * [[0], [1]]
        fields = drawn_fields(model, drawn.values(x))
        changed = {field: int(np.sum(values[0] != values[1])) for field, values in fields.items()}
        by_parameter[name] = {field: count for field, count in changed.items() if count}
    return by_parameter


def of_model(model: mujoco.MjModel, drawn: Randomization, where: str) -> Randomization:
    """The same about what the model has, which is the centre but for the digits that its file lacks.

    Raises:
        InputError: the model at `where` has other values, or lacks a part.
    """
    centre = []
    for name, stated in zip(drawn.names, drawn.centre, strict=True):
        parameter = parameter_named(name)
        if not parameter.belongs_to(model):
            raise InputError(f"{where}: {name}: found an arm without its part, expected the model that was identified")
        centre.append(value := parameter.read(model))
        if abs(value - stated) > NEAR * abs(stated) + NEAR**2:
            unit = f" {parameter.unit}" if parameter.unit else ""
            raise InputError(f"{where}: {name}: found {value:.6g}, expected the {stated:.6g}{unit} of parameters.json")
    return replace(drawn, centre=np.array(centre))
