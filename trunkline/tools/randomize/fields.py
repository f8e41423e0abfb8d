"""Drawn parameters as fields of a MuJoCo model, for simulations that each have their own."""

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import Fields, candidate_fields, parameter_named
from trunkline.twin.posterior import Posterior
from trunkline.twin.twin import Twin

OWN = "numeric_data"  # numbers that MuJoCo only keeps: Trunkline's stepper reads them, others would not
STEP = 1e-3  # of z
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


def changed_fields(model: mujoco.MjModel, posterior: Posterior) -> dict[str, dict[str, int]]:
    """By parameter, the fields of `model` that a step of it changes, and how many numbers of each."""
    by_parameter = {}
    middle = {name: parameter_named(name).coordinate(parameter_named(name).read(model)) for name in posterior.names}
    for stepped in posterior.names:
        z = {name: place + (name == stepped) * np.array([0.0, STEP]) for name, place in middle.items()}
        fields = drawn_fields(model, {name: parameter_named(name).value(places) for name, places in z.items()})
        changed = {field: int(np.sum(values[0] != values[1])) for field, values in fields.items()}
        by_parameter[stepped] = {field: count for field, count in changed.items() if count}
    return by_parameter


def check_model(twin: Twin) -> None:
    """Refuse a twin whose model has other values than its tables, but for the digits that a file lacks.

    Raises:
        InputError: naming the first such parameter, or one that the model has not.
    """
    where = twin.provenance.model
    if not twin.posterior.names:
        raise InputError(f"{where}: found no parameters.json beside it, expected the artifacts of identification")
    for name in twin.posterior.names:
        parameter, expected = parameter_named(name), twin.posterior.value(name)
        if not parameter.belongs_to(twin.arm.model):
            problem = "found an arm without its part, expected the model that was identified"
            raise InputError(f"{where}: {name}: {problem}")
        value = parameter.read(twin.arm.model)
        if abs(value - expected) > NEAR * abs(expected) + NEAR**2:
            unit = f" {parameter.unit}" if parameter.unit else ""
            stated_value = f"{expected:.6g}{unit} of parameters.json"
            raise InputError(f"{where}: {name}: found {value:.6g}, expected the {stated_value}")
