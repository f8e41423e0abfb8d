"""A parameter: a number for the whole arm, and the fields of MuJoCo's model that it writes, for many candidates."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import ExperimentKind

Fields = dict[str, np.ndarray]  # name of an MjModel field → its values per candidate, (candidates, ...)


@dataclass(frozen=True)
class ArmPart:
    """What of an arm a parameter belongs to.

    has: whether an arm has it. lacking: what is wrong with such a parameter for an arm that has not.
    """

    has: Callable[[ArmModel], bool]
    lacking: str


WHOLE = ArmPart(lambda arm: True, "")


@dataclass(frozen=True)
class Parameter:
    """A scalar for the whole arm.

    Attributes:
        unit: of its value.
        fields: the MjModel fields that it writes.
        read: its value in the model of an arm that has the part.
        write: (fields, values (candidates,), model) sets it in every candidate.
        signed: whether it may be 0 or less. Only others are searched on a logarithmic scale.
        part: what of an arm it belongs to.
        identifiable_from: whether trials of a kind of experiment determine it; from others alone it comes out wrong.
        scale: of a signed one, in its unit: what is searched is so many of it.
    """

    unit: str
    fields: tuple[str, ...]
    read: Callable[[mujoco.MjModel], float]
    write: Callable[[Fields, np.ndarray, mujoco.MjModel], None]
    signed: bool = False
    part: ArmPart = WHOLE
    identifiable_from: Callable[[ExperimentKind], bool] = lambda kind: True
    scale: float = 1.0

    def belongs_to(self, model: mujoco.MjModel) -> bool:
        """Whether the arm has the part of which this is."""
        return self.part.has(ArmModel(model))

    def coordinate(self, value):
        """Where a value lies on the axis that is searched: its natural logarithm, or over `scale` if signed."""
        return np.asarray(value, dtype=float) / self.scale if self.signed else np.log(value)

    def value(self, coordinate):
        """The inverse of `coordinate`."""
        return np.asarray(coordinate, dtype=float) * self.scale if self.signed else np.exp(coordinate)


def moving(kind: ExperimentKind) -> bool:
    """At rest friction, dampers, branches and sliders are off."""
    return not kind.static


def pulled(kind: ExperimentKind) -> bool:
    return kind.needs_motors


def pulled_and_moving(kind: ExperimentKind) -> bool:
    return kind.needs_motors and not kind.static


def number(
    name: str, unit: str, part: ArmPart, identifiable_from=pulled_and_moving, index: int = 0, **search
) -> Parameter:
    """One that is no field of MuJoCo's but among its numbers of that name, which the stepper reads; `search`: `signed`
    and `scale`."""

    def read(model: mujoco.MjModel) -> float:
        return float(ArmModel(model).numbers(name)[index])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        fields["numeric_data"][:, ArmModel(model).places(name)[index]] = values

    return Parameter(unit, ("numeric_data",), read, write, part=part, identifiable_from=identifiable_from, **search)
