"""Identifiable parameters: from a name and values to the fields of a MuJoCo model, for many candidates at once."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

Fields = dict[str, np.ndarray]  # name of an MjModel field → its values per candidate, (candidates, ...)


@dataclass(frozen=True)
class Parameter:
    """A scalar for the whole arm.

    Attributes:
        unit: of its value.
        fields: the MjModel fields that it writes.
        read: its value in a model.
        write: (fields, values (candidates,), model) sets it in every candidate.
        signed: whether it may be 0 or less. Only others are searched on a logarithmic scale.
    """

    unit: str
    fields: tuple[str, ...]
    read: Callable[[mujoco.MjModel], float]
    write: Callable[[Fields, np.ndarray, mujoco.MjModel], None]
    signed: bool = False

    def coordinate(self, value):
        """Where a value lies on the axis that is searched: its natural logarithm, or itself if signed."""
        return np.asarray(value, dtype=float) if self.signed else np.log(value)

    def value(self, coordinate):
        """The inverse of `coordinate`."""
        return np.asarray(coordinate, dtype=float) if self.signed else np.exp(coordinate)


def _column(values: np.ndarray, field: np.ndarray) -> np.ndarray:
    return values.reshape(-1, *[1] * (field.ndim - 1))


def _scale(names: tuple[str, ...], reference: Callable[[mujoco.MjModel], float]) -> Callable:
    """Scale whole fields, so that the parameter (their first joint's value) becomes the one asked for."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        for name in names:
            fields[name] *= _column(values / reference(model), fields[name])

    return write


def _set(name: str, index: tuple, sign: float = 1.0) -> Callable:
    """Set one column of a field for every element."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        target = fields[name][(slice(None), *index)]
        target[:] = sign * _column(values, target)

    return write


def _write_kp(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    fields["actuator_gainprm"][:, :, 0] = values[:, None]
    fields["actuator_biasprm"][:, :, 1] = -values[:, None]


def _write_hardening(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    fields["jnt_stiffnesspoly"][:, :, 1] = values[:, None] * fields["jnt_stiffness"]


def _write_joint_friction(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    fields["dof_frictionloss"][:] = values[:, None] * fields["jnt_stiffness"]


def _read_mount(model: mujoco.MjModel, axis: int) -> float:
    return float(rotation_from_wxyz(model.body("base").quat).as_rotvec()[axis])


def _write_mount(axis: int) -> Callable:
    """Set one component of the rotation vector that turns the mount in the tracked base frame."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        turned = fields["body_quat"][:, model.body("base").id]
        vectors = rotation_from_wxyz(turned).as_rotvec()
        vectors[:, axis] = values
        turned[:] = wxyz_from_rotation(Rotation.from_rotvec(vectors))

    return write


def _mount(axis: int) -> Parameter:
    return Parameter("rad", ("body_quat",), partial(_read_mount, axis=axis), _write_mount(axis), signed=True)


STIFFNESS_FIELDS = ("jnt_stiffness", "jnt_stiffnesspoly")
DAMPING_FIELDS = ("dof_damping", "dof_dampingpoly")

# Order matters: what scales with stiffness is written after it.
PARAMETERS: dict[str, Parameter] = {
    "stiffness": Parameter(
        "N m/rad", STIFFNESS_FIELDS, lambda m: float(m.jnt_stiffness[0]),
        _scale(STIFFNESS_FIELDS, lambda m: float(m.jnt_stiffness[0])),
    ),
    "hardening": Parameter(
        "1/rad²", STIFFNESS_FIELDS, lambda m: float(m.jnt_stiffnesspoly[0, 1] / m.jnt_stiffness[0]), _write_hardening,
    ),
    "joint_friction": Parameter(
        "rad", ("dof_frictionloss", "jnt_stiffness"),
        lambda m: float(m.dof_frictionloss[0] / m.jnt_stiffness[0]), _write_joint_friction,
    ),
    "damping": Parameter(
        "N m s/rad", DAMPING_FIELDS, lambda m: float(m.dof_damping[0]),
        _scale(DAMPING_FIELDS, lambda m: float(m.dof_damping[0])),
    ),
    "tendon_friction": Parameter(
        "N", ("tendon_frictionloss",), lambda m: float(m.tendon_frictionloss[0]), _set("tendon_frictionloss", ()),
    ),
    # the smallest speed at which a regularised friction yields falls with it: a slow one lets a hook creep straight
    "friction_time": Parameter(
        "s", ("tendon_solref_fri",), lambda m: float(m.tendon_solref_fri[0, 0]),
        _set("tendon_solref_fri", (slice(None), 0)),
    ),
    "kp": Parameter(
        "N/m", ("actuator_gainprm", "actuator_biasprm"), lambda m: float(m.actuator_gainprm[0, 0]), _write_kp,
    ),
    "kv": Parameter(
        "N s/m", ("actuator_biasprm",), lambda m: float(-m.actuator_biasprm[0, 2]),
        _set("actuator_biasprm", (slice(None), 2), -1.0),
    ),
    "force_range": Parameter(
        "N", ("actuator_forcerange",), lambda m: float(-m.actuator_forcerange[0, 0]),
        _set("actuator_forcerange", (slice(None), 0), -1.0),
    ),
    "time_constant": Parameter(
        "s", ("actuator_dynprm",), lambda m: float(m.actuator_dynprm[0, 0]), _set("actuator_dynprm", (slice(None), 0)),
    ),
    "mount_tilt_x": _mount(0),
    "mount_tilt_y": _mount(1),
    "mount_twist": _mount(2),
}  # fmt: skip

PER_JOINT_FIELDS = {"stiffness": STIFFNESS_FIELDS, "damping": DAMPING_FIELDS}

if TYPE_CHECKING:
    ParameterName = str
    PerJointName = str
else:  # so that whoever names another is told which there are
    ParameterName = Literal[tuple(PARAMETERS)]
    PerJointName = Literal[tuple(PER_JOINT_FIELDS)]


def candidate_fields(
    model: mujoco.MjModel, values: dict[str, np.ndarray], factors: dict[str, np.ndarray] | None = None
) -> Fields:
    """Model fields of many candidates.

    Args:
        model: the model that the candidates start from.
        values: parameter name → its values, shape (candidates,).
        factors: "stiffness" or "damping" → a factor for each unit, on top of the scalar. Shape (candidates, units).
            Both hinges of a unit share it.

    Returns:
        Every field that any of them writes, shape (candidates, ...).
    """
    factors = factors or {}
    count = len(next(iter((values | factors).values())))
    names = {f for p in values for f in PARAMETERS[p].fields} | {f for p in factors for f in PER_JOINT_FIELDS[p]}
    fields = {name: np.repeat(np.array(getattr(model, name))[None], count, axis=0) for name in sorted(names)}
    for parameter in PARAMETERS:
        if parameter in values:
            PARAMETERS[parameter].write(fields, np.asarray(values[parameter], dtype=float), model)
        if parameter in factors:
            per_hinge = factors[parameter][:, unit_of_hinge(model)]
            for name in PER_JOINT_FIELDS[parameter]:
                field = fields[name]
                field *= per_hinge.reshape(per_hinge.shape + (1,) * (field.ndim - 2))
    return fields


def unit_of_hinge(model: mujoco.MjModel) -> np.ndarray:
    """For each hinge the number, from 0, of the jointed body that it moves. Shape (njnt,)."""
    return np.unique(model.jnt_bodyid, return_inverse=True)[1]


def set_fields(model: mujoco.MjModel, fields: Fields, candidate: int = 0) -> None:
    """Write one candidate's fields into `model`."""
    for name, values in fields.items():
        getattr(model, name)[:] = values[candidate].reshape(getattr(model, name).shape)
