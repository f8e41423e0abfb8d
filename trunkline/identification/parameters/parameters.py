"""Identifiable parameters: from a name and values to the fields of a MuJoCo model, for many candidates at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.model.elements import (
    BACKLASH,
    BRANCH,
    CAPSTAN_FRICTION,
    DIAGONAL,
    DIAGONAL_SHARE,
    HINGE_SHARE,
    PRELOAD,
    RATE_LIMIT,
    SECTIONS,
    SLIDER,
    WINDING,
    all_elements,
    arm_hinges,
    cables,
    diagonal_lengths,
    elements,
    hole_tendons,
    numbers_place,
    numeric,
    numeric_place,
)
from trunkline.recordings.trials.experiments import ExperimentKind

SHORTEST = 1e-6  # m; a unit whose ends are nearer to each other has no line along which its hinges may move
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
        scale: of a signed one, in its unit: what is searched is so many of it.
        part: what of an arm it belongs to, if not every arm has it: "tendons", their motors' "dead time", RATE_LIMIT or
            BACKLASH, the "motor 2", …, the "tendon 2", …, what commands draw in, WINDING and PRELOAD, the "section 2",
            …, a joint's "branch 1", "slider 1", …, or "holes" on which cables rub.
        identifiable_from: whether trials of a kind of experiment determine it; from others alone it comes out wrong.
    """

    unit: str
    fields: tuple[str, ...]
    read: Callable[[mujoco.MjModel], float]
    write: Callable[[Fields, np.ndarray, mujoco.MjModel], None]
    signed: bool = False
    part: str = ""
    identifiable_from: Callable[[ExperimentKind], bool] = lambda kind: True
    scale: float = 1.0

    def belongs_to(self, model: mujoco.MjModel) -> bool:
        """Whether the arm has the part of which this is."""
        if self.part == "dead time":
            return bool(model.nhistory)
        if self.part == "holes":
            return hole_tendons(model).size > 0
        if self.part in (RATE_LIMIT, BACKLASH, WINDING):
            return numeric_place(model, self.part) is not None
        kind, _, number = self.part.partition(" ")
        if kind in ("motor", "tendon"):
            return model.nu >= int(number)
        if kind in (PRELOAD, "section"):
            return len(numbers_place(model, PRELOAD if kind == PRELOAD else SECTIONS)) >= int(number)
        if number:
            return len(elements(model, kind, int(number)).tendon) > 0
        return not kind or model.nu > 0

    def coordinate(self, value):
        """Where a value lies on the axis that is searched: its natural logarithm, or over `scale` if signed."""
        return np.asarray(value, dtype=float) / self.scale if self.signed else np.log(value)

    def value(self, coordinate):
        """The inverse of `coordinate`."""
        return np.asarray(coordinate, dtype=float) * self.scale if self.signed else np.exp(coordinate)


def _moving(kind: ExperimentKind) -> bool:
    """At rest friction, dampers, branches and sliders are off."""
    return not kind.static


def _pulled(kind: ExperimentKind) -> bool:
    return kind.needs_motors


def _pulled_and_moving(kind: ExperimentKind) -> bool:
    return kind.needs_motors and not kind.static


def _start_measured(kind: ExperimentKind) -> bool:
    """The bent pose from which a release starts is fitted beforehand, with the hinges where they were then."""
    return kind.static or kind.needs_motors


def _column(values: np.ndarray, field: np.ndarray) -> np.ndarray:
    return values.reshape(-1, *[1] * (field.ndim - 1))


def _scale_stiffness(fields: Fields, factors: np.ndarray, model: mujoco.MjModel) -> None:
    """Scale what joints bend against, springs and what is in proportion to them, by factors (candidates, n hinges)."""
    arm = factors.shape[1]
    fields["jnt_stiffness"][:, :arm] *= factors
    fields["jnt_stiffnesspoly"][:, :arm] *= factors[..., None]
    for part in all_elements(model, DIAGONAL):
        fields["tendon_stiffnesspoly"][:, part.tendon] *= factors[:, part.hinge, None]
    for part in (*all_elements(model, BRANCH), *all_elements(model, SLIDER)):
        fields["tendon_stiffness"][:, part.tendon] *= factors[:, part.hinge]
        fields["dof_damping"][:, part.branch] *= factors[:, part.hinge[: len(part.branch)]]


def _scale_damping(fields: Fields, factors: np.ndarray, model: mujoco.MjModel) -> None:
    """Scale the dampers of joints, not those of their branches, by factors (candidates, n hinges)."""
    arm = factors.shape[1]
    fields["dof_damping"][:, :arm] *= factors
    fields["dof_dampingpoly"][:, :arm] *= factors[..., None]


def _whole_arm(scale: Callable, reference: Callable[[mujoco.MjModel], float]) -> Callable:
    """Scale all joints alike, so that the parameter, the first joint's value, becomes the one asked for."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        scale(fields, np.repeat((values / reference(model))[:, None], arm_hinges(model), axis=1), model)

    return write


def _unit_ends(model: mujoco.MjModel) -> np.ndarray:
    """Where each hinge's unit ends, m, in the frame of the unit's body, whose origin is its upper end: in the origin of
    the next unit, or at the tip, of the arm as it was drawn. Shape (n, 3).

    Raises:
        InputError: a unit that the next one, or the tip, does not hang from, or that has no length.
    """
    hinges = model.jnt_bodyid[: arm_hinges(model)]
    bodies, units = np.unique(hinges, return_inverse=True)
    tip, ends = model.site("tip"), []
    for body, below in zip(bodies, [*bodies[1:], None], strict=True):
        at, end = (tip.bodyid[0], tip.pos) if below is None else (below, np.zeros(3))
        while at not in (body, 0):  # through what is welded in between
            at, end = model.body_parentid[at], model.body_pos[at] + rotation_from_wxyz(model.body_quat[at]).apply(end)
        lower = "site 'tip'" if below is None else f"body {model.body(below).name!r}"
        name = f"model: body {model.body(body).name!r}"
        if at != body:
            raise InputError(f"{name}: found {lower} to hang from another body, expected all units in one chain")
        if np.linalg.norm(end) < SHORTEST:
            raise InputError(f"{name}: found {lower} in its origin, expected that at the unit's lower end")
        ends.append(end)
    return np.array(ends)[units]


def _places(model: mujoco.MjModel, ends: np.ndarray) -> np.ndarray:
    """Where each hinge lies along its unit, as a share of the unit's length. Shape (n,)."""
    return np.sum(model.jnt_pos[: len(ends)] * ends, axis=1) / np.sum(ends * ends, axis=1)


def _write_place(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Move every hinge along its unit, and no other way: one that lies beside the unit's line stays as far from it."""
    ends = _unit_ends(model)
    moves = values[:, None] - _places(model, ends)
    fields["jnt_pos"][:, : len(ends)] += moves[..., None] * ends


def _set(name: str, index: tuple, sign: float = 1.0) -> Callable:
    """Set one column of a field for every element."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        target = fields[name][(slice(None), *index)]
        target[:] = sign * _column(values, target)

    return write


def _write_kp(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of the first motor; the others keep their ratios to it."""
    gains = values[:, None] * (model.actuator_gainprm[:, 0] / model.actuator_gainprm[0, 0])
    fields["actuator_gainprm"][:, :, 0] = gains
    fields["actuator_biasprm"][:, :, 1] = -gains


def _gain_ratio(number: int) -> Parameter:
    """Gain of motor `number` over that of the first: cables and winches are not equally stiff."""

    def read(model: mujoco.MjModel) -> float:
        gains = model.actuator_gainprm[:, 0]
        return float(gains[number - 1] / gains[0]) if len(gains) >= number else 1.0

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        gain = values * fields["actuator_gainprm"][:, 0, 0]
        fields["actuator_gainprm"][:, number - 1, 0] = gain
        fields["actuator_biasprm"][:, number - 1, 1] = -gain

    fields = ("actuator_gainprm", "actuator_biasprm")
    return Parameter("", fields, read, write, part=f"motor {number}", identifiable_from=_pulled)


def _hinge_share(model: mujoco.MjModel) -> float:
    """How much of a joint's hardening its hinges have; its diagonals have the rest."""
    return HINGE_SHARE if all_elements(model, DIAGONAL) else 1.0


def _read_hardening(model: mujoco.MjModel) -> float:
    return float(model.jnt_stiffnesspoly[0, 1] / model.jnt_stiffness[0] / _hinge_share(model))


def _write_hardening(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    hardening = values[:, None] * fields["jnt_stiffness"]  # 0 for branches' hinges
    fields["jnt_stiffnesspoly"][:, :, 1] = _hinge_share(model) * hardening
    for part in all_elements(model, DIAGONAL):
        fields["tendon_stiffnesspoly"][:, part.tendon, 1] = DIAGONAL_SHARE * hardening[:, part.hinge]


def follow_rest(fields: Fields, model: mujoco.MjModel) -> None:
    """Let the diagonals of round joints be slack where the hinges are, whose `qpos_spring` (C, nq) is in `fields`."""
    tendons, lengths = diagonal_lengths(model, fields["qpos_spring"])
    if len(tendons):
        shape = (len(lengths), *model.tendon_lengthspring.shape)
        slack = fields.setdefault("tendon_lengthspring", np.broadcast_to(model.tendon_lengthspring, shape).copy())
        slack[:, tendons] = lengths[..., None]


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


def _write_tendons(name: str, index: tuple = ()) -> Callable:
    """Set a number of every tendon along the arm."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        fields[name][(slice(None), cables(model), *index)] = values[:, None]

    return write


def _share(kind: str, number: int) -> Parameter:
    """Stiffness of the joints' branches or sliders over that of their springs; a branch keeps its time."""

    def read(model: mujoco.MjModel) -> float:
        part = elements(model, kind, number)
        shares = model.tendon_stiffness[part.tendon] / model.jnt_stiffness[part.hinge]
        return float(shares[0]) if len(shares) else 0.0

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        part = elements(model, kind, number)
        times = fields["dof_damping"][:, part.branch] / fields["tendon_stiffness"][:, part.tendon[: len(part.branch)]]
        stiffness = values[:, None] * fields["jnt_stiffness"][:, part.hinge]
        fields["tendon_stiffness"][:, part.tendon] = stiffness
        fields["dof_damping"][:, part.branch] = times * stiffness[:, : len(part.branch)]

    fields = ("tendon_stiffness", "dof_damping", "jnt_stiffness")
    return Parameter("", fields, read, write, part=f"{kind} {number}", identifiable_from=_moving)


def _relaxation_time(number: int) -> Parameter:
    def read(model: mujoco.MjModel) -> float:
        part = elements(model, BRANCH, number)
        return (
            float(model.dof_damping[part.branch[0]] / model.tendon_stiffness[part.tendon[0]])
            if len(part.branch)
            else 0.0
        )

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        part = elements(model, BRANCH, number)
        fields["dof_damping"][:, part.branch] = values[:, None] * fields["tendon_stiffness"][:, part.tendon]

    fields = ("dof_damping", "tendon_stiffness")
    return Parameter("s", fields, read, write, part=f"{BRANCH} {number}", identifiable_from=_moving)


def _yield_bend(number: int) -> Parameter:
    def read(model: mujoco.MjModel) -> float:
        part = elements(model, SLIDER, number)
        return float(model.tendon_springyield[part.tendon[0]]) if len(part.tendon) else 0.0

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        fields["tendon_springyield"][:, elements(model, SLIDER, number).tendon] = values[:, None]

    return Parameter("rad", ("tendon_springyield",), read, write, part=f"{SLIDER} {number}", identifiable_from=_moving)


def _rest_bend(axis: int, power: int) -> Parameter:
    """A coefficient of the shape in which the springs are slack: every joint bends by c_0 + c_1 s about an axis, s from
    -1 at the first joint to 1 at the last. Of a joint's two hinges, one is about x, or nearer to it, whichever comes
    first."""

    def basis(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
        pairs = np.arange(arm_hinges(model)).reshape(-1, 2)
        about_x = np.abs(model.jnt_axis[pairs, 0]).argmax(axis=1)
        hinges = pairs[np.arange(len(pairs)), about_x if axis == 0 else 1 - about_x]
        sense = np.where(model.jnt_axis[hinges, axis] < 0, -1.0, 1.0)
        return hinges, sense * np.linspace(-1, 1, len(hinges)) ** power

    def read(model: mujoco.MjModel) -> float:
        hinges, shape = basis(model)
        return float(shape @ model.qpos_spring[hinges] / (shape @ shape))

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        hinges, shape = basis(model)
        fields["qpos_spring"][:, hinges] += (values - read(model))[:, None] * shape
        follow_rest(fields, model)

    return Parameter("rad", ("qpos_spring",), read, write, signed=True)


def _number(
    name: str, unit: str, part: str, identifiable_from: Callable[[ExperimentKind], bool] = _pulled_and_moving
) -> Parameter:
    """One that is no field of MuJoCo's but a number of that name, which the stepper reads."""

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        fields["numeric_data"][:, numeric_place(model, name)] = values

    read = partial(numeric, name=name)
    return Parameter(unit, ("numeric_data",), read, write, part=part, identifiable_from=identifiable_from)


def _winds(kind: ExperimentKind) -> bool:
    """Backlash shows where tendons go to and fro."""
    return kind.needs_motors and (not kind.static or kind.stepwise)


def _preload(number: int) -> Parameter:
    """How far cable `number` is drawn in beyond the straight arm's length where its command is 0; below 0 it is slack.
    """

    def read(model: mujoco.MjModel) -> float:
        places = numbers_place(model, PRELOAD)
        return float(model.numeric_data[places[number - 1]]) if len(places) >= number else 0.0

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        fields["numeric_data"][:, numbers_place(model, PRELOAD)[number - 1]] = values

    return Parameter("m", ("numeric_data",), read, write, True, f"{PRELOAD} {number}", _pulled, scale=0.01)


def _holes_of(model: mujoco.MjModel, number: int) -> np.ndarray:
    """Numbers of the sites through which cable `number` runs, that of the mount first; none if there is no such cable.
    """
    if model.nu < number:
        return np.zeros(0, dtype=int)
    cable = cables(model)[number - 1]
    return model.wrap_objid[model.tendon_adr[cable] : model.tendon_adr[cable] + model.tendon_num[cable]]


def _angle(number: int) -> Parameter:
    """At which angle about the arm's axis cable `number` runs, from +x towards +y, between -π and π."""

    def read(model: mujoco.MjModel) -> float:
        sites = _holes_of(model, number)
        return float(np.arctan2(*model.site_pos[sites[0], 1::-1])) if len(sites) else 0.0

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        sites = _holes_of(model, number)
        turns = values - read(model)
        x, y = fields["site_pos"][:, sites, 0], fields["site_pos"][:, sites, 1]
        cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]
        fields["site_pos"][:, sites, :2] = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)

    return Parameter("rad", ("site_pos",), read, write, True, f"tendon {number}", _pulled)


def _read_distance(model: mujoco.MjModel) -> float:
    sites = _holes_of(model, 1)
    return float(np.hypot(*model.site_pos[sites[0], :2])) if len(sites) else 0.0


def _write_distance(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of the first cable from the axis at the mount; all holes keep their ratios to it."""
    sites = np.concatenate([_holes_of(model, number + 1) for number in range(model.nu)])
    fields["site_pos"][:, sites, :2] *= (values / _read_distance(model))[:, None, None]


def _section_stiffness(number: int) -> Parameter:
    """Stiffness of the first joint of section `number` over that of the first section's; all of its joints keep their
    ratios to it."""

    def read(model: mujoco.MjModel) -> float:
        units = np.cumsum(model.numeric_data[numbers_place(model, SECTIONS)]).astype(int)
        if len(units) < number:
            return 1.0
        first = np.flatnonzero(unit_of_hinge(model) == units[number - 2])[0]
        return float(model.jnt_stiffness[first] / model.jnt_stiffness[0])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        edges = np.append(0, np.cumsum(model.numeric_data[numbers_place(model, SECTIONS)]))
        unit = unit_of_hinge(model)
        in_section = (unit >= edges[number - 1]) & (unit < edges[number])
        _scale_stiffness(fields, np.where(in_section, (values / read(model))[:, None], 1.0), model)

    return Parameter("", STIFFNESS_FIELDS, read, write, part=f"section {number}")


STIFFNESS_FIELDS = ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly", "dof_damping")
DAMPING_FIELDS = ("dof_damping", "dof_dampingpoly")

# Order matters: what scales with stiffness is written after it.
PARAMETERS: dict[str, Parameter] = {
    "stiffness": Parameter(
        "N m/rad", STIFFNESS_FIELDS, lambda m: float(m.jnt_stiffness[0]),
        _whole_arm(_scale_stiffness, lambda m: float(m.jnt_stiffness[0])),
    ),
    # where a unit bends, as a share of its length: 0 at its upper end, 0.5 if all along; 1 - γ, γ the characteristic
    # radius factor of pseudo-rigid-body models (L. L. Howell, Compliant Mechanisms, 2001)
    "joint_place": Parameter(
        "", ("jnt_pos",), lambda m: float(_places(m, _unit_ends(m))[0]), _write_place, signed=True,
        identifiable_from=_start_measured,
    ),
    "hardening": Parameter(
        "1/rad²", STIFFNESS_FIELDS, _read_hardening, _write_hardening,
    ),
    "joint_friction": Parameter(
        "rad", ("dof_frictionloss", "jnt_stiffness"),
        lambda m: float(m.dof_frictionloss[0] / m.jnt_stiffness[0]), _write_joint_friction, identifiable_from=_moving,
    ),
    "damping": Parameter(
        "N m s/rad", DAMPING_FIELDS, lambda m: float(m.dof_damping[0]),
        _whole_arm(_scale_damping, lambda m: float(m.dof_damping[0])), identifiable_from=_moving,
    ),
    "relaxation": _share(BRANCH, 1),
    "relaxation_time": _relaxation_time(1),
    "relaxation_2": _share(BRANCH, 2),
    "relaxation_time_2": _relaxation_time(2),
    "hysteresis": _share(SLIDER, 1),
    "yield_bend": _yield_bend(1),
    "hysteresis_2": _share(SLIDER, 2),
    "yield_bend_2": _yield_bend(2),
    "hysteresis_3": _share(SLIDER, 3),
    "yield_bend_3": _yield_bend(3),
    "rest_bend_x": _rest_bend(0, 0),
    "rest_bend_y": _rest_bend(1, 0),
    "rest_gradient_x": _rest_bend(0, 1),
    "rest_gradient_y": _rest_bend(1, 1),
    "tendon_friction": Parameter(
        "N", ("tendon_frictionloss",), lambda m: float(m.tendon_frictionloss[0]), _write_tendons("tendon_frictionloss"),
        part="tendons", identifiable_from=_moving,
    ),
    # the smallest speed at which a regularised friction yields falls with it: a slow one lets a hook creep straight
    "friction_time": Parameter(
        "s", ("tendon_solref_fri",), lambda m: float(m.tendon_solref_fri[0, 0]),
        _write_tendons("tendon_solref_fri", (0,)), part="tendons", identifiable_from=_moving,
    ),
    # μ of cables on the holes that they pass, in the capstan equation
    "capstan_friction": _number(CAPSTAN_FRICTION, "", "holes"),
    "kp": Parameter(
        "N/m", ("actuator_gainprm", "actuator_biasprm"), lambda m: float(m.actuator_gainprm[0, 0]), _write_kp,
        part="tendons", identifiable_from=_pulled,
    ),
    # of motors with their cables, which are not all equally stiff
    "kp_ratio_2": _gain_ratio(2),
    "kp_ratio_3": _gain_ratio(3),
    "kv": Parameter(
        "N s/m", ("actuator_biasprm",), lambda m: float(-m.actuator_biasprm[0, 2]),
        _set("actuator_biasprm", (slice(None), 2), -1.0), part="tendons", identifiable_from=_pulled_and_moving,
    ),
    "force_range": Parameter(
        "N", ("actuator_forcerange",), lambda m: float(-m.actuator_forcerange[0, 0]),
        _set("actuator_forcerange", (slice(None), 0), -1.0), part="tendons", identifiable_from=_pulled,
    ),
    "time_constant": Parameter(
        "s", ("actuator_dynprm",), lambda m: float(m.actuator_dynprm[0, 0]), _set("actuator_dynprm", (slice(None), 0)),
        part="tendons", identifiable_from=_pulled_and_moving,
    ),
    "dead_time": Parameter(
        "s", ("actuator_delay",), lambda m: float(m.actuator_delay[0]), _set("actuator_delay", ()),
        part="dead time", identifiable_from=_pulled_and_moving,
    ),
    "rate_limit": _number(RATE_LIMIT, "m/s", RATE_LIMIT),
    "backlash": _number(BACKLASH, "m", BACKLASH, _winds),
    # metres of cable that a commanded metre draws in: the drum's radius over what session.yaml takes it for
    "winding": _number(WINDING, "", WINDING, _pulled),
    "tendon_distance": Parameter(
        "m", ("site_pos",), _read_distance, _write_distance, part="tendons", identifiable_from=_pulled,
    ),
    "mount_tilt_x": _mount(0),
    "mount_tilt_y": _mount(1),
    "mount_twist": _mount(2),
}  # fmt: skip
MOST = 24  # tendons, and sections, of which each may have a parameter of its own
NUMBERED: dict[str, tuple[Callable[[int], Parameter], int]] = {  # name to what makes one, and the first number
    "tendon_angle": (_angle, 1), "preload": (_preload, 1), "section_stiffness": (_section_stiffness, 2),
}  # fmt: skip
PARAMETERS |= {f"{name}_{k}": make(k) for name, (make, first) in NUMBERED.items() for k in range(first, MOST + 1)}
SESSION_MARK = "@"  # between a parameter and the session that has it for itself
EVERY = "_*"  # ends the name of one of `NUMBERED` in params.yaml for all that the arm has

# what a factor of each unit's own may scale: the fields, and how
PER_JOINT = {"stiffness": (STIFFNESS_FIELDS, _scale_stiffness), "damping": (DAMPING_FIELDS, _scale_damping)}

if TYPE_CHECKING:
    ParameterName = str
    PerJointName = str
else:  # so that whoever names another is told which there are
    ParameterName = Literal[(*PARAMETERS, *(f"{name}{EVERY}" for name in NUMBERED))]
    PerJointName = Literal[tuple(PER_JOINT)]


def parameter_named(name: str) -> Parameter:
    """Of PARAMETERS; of a name that stands for several, the first; of `name@session` one that a number of that name in
    the model holds."""
    shared, apart, _ = name.partition(SESSION_MARK)
    if apart:
        parameter, number = PARAMETERS[shared], _number(name, "", "")
        return replace(parameter, fields=number.fields, read=number.read, write=number.write)
    stem = name.removesuffix(EVERY)
    return PARAMETERS[name if stem == name else f"{stem}_{NUMBERED[stem][1]}"]


def names_of(name: str, model: mujoco.MjModel) -> list[str]:
    """The parameters of an arm for which a name stands: itself, or one for each of its tendons or sections."""
    stem = name.removesuffix(EVERY)
    if stem == name:
        return [name]
    make, first = NUMBERED[stem]
    return [f"{stem}_{k}" for k in range(first, MOST + 1) if make(k).belongs_to(model)]


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
    names = {f for p in values for f in parameter_named(p).fields} | {f for p in factors for f in PER_JOINT[p][0]}
    names -= {"tendon_stiffness"} if not model.ntendon else set()
    fields = {name: np.repeat(np.array(getattr(model, name))[None], count, axis=0) for name in sorted(names)}
    for parameter in PARAMETERS:
        if parameter in values:
            PARAMETERS[parameter].write(fields, np.asarray(values[parameter], dtype=float), model)
        if parameter in factors:
            PER_JOINT[parameter][1](fields, factors[parameter][:, unit_of_hinge(model)], model)
    for name in values:
        if SESSION_MARK in name and numeric_place(model, name) is not None:
            parameter_named(name).write(fields, np.asarray(values[name], dtype=float), model)
    return fields


def unit_of_hinge(model: mujoco.MjModel) -> np.ndarray:
    """For each hinge of the arm the number, from 0, of the unit that it moves. Shape (n,)."""
    return np.unique(model.jnt_bodyid[: arm_hinges(model)], return_inverse=True)[1]


def set_fields(model: mujoco.MjModel, fields: Fields, candidate: int = 0) -> None:
    """Write one candidate's fields into `model`."""
    for name, values in fields.items():
        getattr(model, name)[:] = values[candidate].reshape(getattr(model, name).shape)
