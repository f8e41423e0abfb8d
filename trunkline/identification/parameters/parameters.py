"""Identifiable parameters by name, and models of many candidates with other values of them."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import count, takewhile
from typing import TYPE_CHECKING, Annotated, Literal

import mujoco
import numpy as np
from pydantic import AfterValidator
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError, nearest
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.identification.parameters.joints import (
    DAMPING_FIELDS,
    JOINT_PARAMETERS,
    STIFFNESS_FIELDS,
    scale_damping,
    scale_stiffness,
    section_stiffness,
)
from trunkline.identification.parameters.parameter import WHOLE, Fields, Parameter, number
from trunkline.identification.parameters.tendons import TENDON_PARAMETERS, angle, preload
from trunkline.model.arm_model import ArmModel

SESSION_MARK = "@"  # between a parameter and the session that has it for itself
EVERY = "_*"  # ends the name of a numbered one in params.yaml for all that the arm has
MASS = "mass"
DERIVED_FROM = {"body_mass", "jnt_pos"}  # fields of which MuJoCo makes constants as it compiles


def _mount(axis: int) -> Parameter:
    """One component of the rotation vector that turns the mount in the tracked base frame."""

    def read(model: mujoco.MjModel) -> float:
        return float(rotation_from_wxyz(model.body_quat[ArmModel(model).base_body]).as_rotvec()[axis])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        turned = fields["body_quat"][:, ArmModel(model).base_body]
        vectors = rotation_from_wxyz(turned).as_rotvec()
        vectors[:, axis] = values
        turned[:] = wxyz_from_rotation(Rotation.from_rotvec(vectors))

    return Parameter("rad", ("body_quat",), read, write, signed=True)


def _read_mass(model: mujoco.MjModel) -> float:
    return float(model.body_mass[ArmModel(model).own_bodies].sum())


def _write_mass(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of the whole arm; its bodies keep their ratios, and a load its mass."""
    bodies, factors = ArmModel(model).own_bodies, values / _read_mass(model)
    fields["body_mass"][:, bodies] *= factors[:, None]
    fields["body_inertia"][:, bodies] *= factors[:, None, None]


# in the order in which they are written
PARAMETERS: dict[str, Parameter] = JOINT_PARAMETERS | TENDON_PARAMETERS | {
    "mount_tilt_x": _mount(0),
    "mount_tilt_y": _mount(1),
    "mount_twist": _mount(2),
    MASS: Parameter("kg", ("body_mass", "body_inertia"), _read_mass, _write_mass),
}  # fmt: skip
# of each tendon or section, `<name>_<number>`: what makes one, and the first number
NUMBERED: dict[str, tuple[Callable[[int], Parameter], int]] = {
    "tendon_angle": (angle, 1), "preload": (preload, 1), "section_stiffness": (section_stiffness, 2),
}  # fmt: skip
# what a factor of each unit's own may scale: the fields, and how
PER_JOINT = {"stiffness": (STIFFNESS_FIELDS, scale_stiffness), "damping": (DAMPING_FIELDS, scale_damping)}

EVERY_NAME = tuple(f"{stem}{EVERY}" for stem in NUMBERED)


def parameter_name(name: str) -> str:
    """The name itself, of a parameter that some arm has; an arm's own are those of `parameters_of`.

    Raises:
        ValueError: it is none, with the nearest that is.
    """
    try:
        parameter_named(name)
    except KeyError:
        names = [*PARAMETERS, *EVERY_NAME, *(f"{stem}_{first}" for stem, (_, first) in NUMBERED.items())]
        raise ValueError(f"found {name!r}, expected the name of a parameter{nearest(name, names)}") from None
    return name


ParameterName = Annotated[str, AfterValidator(parameter_name)]
if TYPE_CHECKING:
    PerJointName = str
else:
    PerJointName = Literal[tuple(PER_JOINT)]


def parameter_named(name: str) -> Parameter:
    """The parameter of a name; of one that stands for several, the first; of `name@session` one that a number of that
    name in the model holds.

    Raises:
        KeyError: there is none.
    """
    shared, apart, _ = name.partition(SESSION_MARK)
    if apart:
        own_number = number(name, "", WHOLE)
        return replace(parameter_named(shared), fields=own_number.fields, read=own_number.read, write=own_number.write)
    if name in PARAMETERS:
        return PARAMETERS[name]
    stem, _, last = name.rpartition("_")
    make, first = NUMBERED.get(stem, (None, 0))
    if make is None or not (last == "*" or (last.isdecimal() and last == str(int(last)) and int(last) >= first)):
        raise KeyError(name)
    return make(first if last == "*" else int(last))


def names_of(name: str, model: mujoco.MjModel) -> list[str]:
    """The parameters of an arm for which a name stands: itself, or one for each of its tendons or sections."""
    if not name.endswith(EVERY):
        return [name]
    stem = name.removesuffix(EVERY)
    make, first = NUMBERED[stem]
    return [f"{stem}_{k}" for k in takewhile(lambda k: make(k).belongs_to(model), count(first))]


def parameters_of(model: mujoco.MjModel) -> dict[str, Parameter]:
    """Those that an arm has, in the order in which they are written."""
    names = [name for entry in (*PARAMETERS, *EVERY_NAME) for name in names_of(entry, model)]
    return {name: parameter_named(name) for name in names if parameter_named(name).belongs_to(model)}


def parameter_of(model: mujoco.MjModel, name: str) -> Parameter:
    """An arm's parameter of this name.

    Raises:
        InputError: the arm lacks the part; of a numbered name, with the nearest that it has.
    """
    parameter, names = parameter_named(name), list(parameters_of(model))
    if name not in names:
        raise InputError(parameter.part.lacking + (nearest(name, names) if name[-1].isdecimal() else ""))
    return parameter


def in_writing_order(names: Iterable[str]) -> list[str]:
    """Names of parameters, none of them per session, in the order in which they are written."""
    recipes = [*PARAMETERS, *NUMBERED]

    def place(name: str) -> tuple[int, int]:
        stem, _, last = name.rpartition("_")
        return (recipes.index(stem), int(last)) if stem in NUMBERED else (recipes.index(name), 0)

    return sorted(names, key=place)


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
    factors, arm = factors or {}, ArmModel(model)
    candidates = len(next(iter((values | factors).values())))
    names = {f for p in values for f in parameter_named(p).fields} | {f for p in factors for f in PER_JOINT[p][0]}
    names -= {"tendon_stiffness"} if not model.ntendon else set()
    fields = {name: np.repeat(np.array(getattr(model, name))[None], candidates, axis=0) for name in sorted(names)}
    shared = dict.fromkeys(name for name in (*values, *factors) if SESSION_MARK not in name)
    per_session = [name for name in values if SESSION_MARK in name and len(arm.places(name))]
    for name in (*in_writing_order(shared), *per_session):
        if name in values:
            parameter_named(name).write(fields, np.asarray(values[name], dtype=float), model)
        if name in factors:
            PER_JOINT[name][1](fields, factors[name][:, arm.unit_of_hinge], model)
    return fields


def set_fields(
    model: mujoco.MjModel, fields: Fields, candidate: int = 0, data: mujoco.MjData | None = None
) -> None:
    """Write one candidate's fields into `model`, and the constants that follow, as when such a model is compiled: what
    softens joint limits. `data`: of the model, to work in."""
    for name, values in fields.items():
        getattr(model, name)[:] = values[candidate].reshape(getattr(model, name).shape)
    if DERIVED_FROM & fields.keys():
        mujoco.mj_setConst(model, data or mujoco.MjData(model))
