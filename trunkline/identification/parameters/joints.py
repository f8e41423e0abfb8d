"""Parameters of joints: their springs, dampers and friction, where they are slack, and where they lie."""

from collections.abc import Callable

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from trunkline.identification.parameters.parameter import ArmPart, Fields, Parameter, moving, pulled
from trunkline.model.arm_model import AXIAL_STIFFNESS, BRANCH, DIAGONAL_SHARE, HINGE_SHARE, SLIDER, ArmModel
from trunkline.recordings.trials.experiments import ExperimentKind

SHORTEST = 1e-6  # m; a unit whose ends are nearer to each other has no line along which its hinges may move
STIFFNESS_FIELDS = ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly", "dof_damping")
DAMPING_FIELDS = ("dof_damping", "dof_dampingpoly")


def scale_stiffness(fields: Fields, factors: np.ndarray, model: mujoco.MjModel) -> None:
    """Scale what joints bend against, springs and what is in proportion to them, by factors (candidates, n hinges)."""
    arm, hinges = ArmModel(model), factors.shape[1]
    fields["jnt_stiffness"][:, :hinges] *= factors
    fields["jnt_stiffnesspoly"][:, :hinges] *= factors[..., None]
    for part in arm.diagonals:
        fields["tendon_stiffnesspoly"][:, part.tendon] *= factors[:, part.hinge, None]
    for part in (*arm.branches, *arm.sliders):
        fields["tendon_stiffness"][:, part.tendon] *= factors[:, part.hinge]
        fields["dof_damping"][:, part.branch] *= factors[:, part.hinge[: len(part.branch)]]


def scale_damping(fields: Fields, factors: np.ndarray, model: mujoco.MjModel) -> None:
    """Scale the dampers of joints, not those of their branches, by factors (candidates, n hinges)."""
    hinges = factors.shape[1]
    fields["dof_damping"][:, :hinges] *= factors
    fields["dof_dampingpoly"][:, :hinges] *= factors[..., None]


def _of_the_first(
    unit: str, fields: tuple[str, ...], first: str, scale: Callable, identifiable_from=lambda kind: True
) -> Parameter:
    """The value of the first joint in the field `first`; the others keep their ratios to it."""

    def read(model: mujoco.MjModel) -> float:
        return float(getattr(model, first)[0])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        scale(fields, np.repeat((values / read(model))[:, None], ArmModel(model).hinge_count, axis=1), model)

    return Parameter(unit, fields, read, write, identifiable_from=identifiable_from)


def section_stiffness(number: int) -> Parameter:
    """Stiffness of the first joint of section `number` over that of the first section's; all of its joints keep their
    ratios to it."""

    def hinges(model: mujoco.MjModel) -> np.ndarray:
        arm = ArmModel(model)
        edges = np.append(0, np.cumsum(arm.sections))
        return (arm.unit_of_hinge >= edges[number - 1]) & (arm.unit_of_hinge < edges[number])

    def read(model: mujoco.MjModel) -> float:
        return float(model.jnt_stiffness[np.argmax(hinges(model))] / model.jnt_stiffness[0])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        scale_stiffness(fields, np.where(hinges(model), (values / read(model))[:, None], 1.0), model)

    lacking = f"found it for an arm without section {number}, expected build_mjcf.arm of the kind sections"
    part = ArmPart(lambda arm: len(arm.sections) >= number, lacking)
    return Parameter("", STIFFNESS_FIELDS, read, write, part=part)


def _read_axial(model: mujoco.MjModel) -> float:
    return float(ArmModel(model).axial_stiffness[0])


def _write_axial(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """EA of the first unit; the others keep their ratios to it."""
    fields["numeric_data"][:, ArmModel(model).places(AXIAL_STIFFNESS)] *= (values / _read_axial(model))[:, None]


def unit_ends(model: mujoco.MjModel) -> np.ndarray:
    """Where each hinge's unit ends, m, in the frame of the unit's body, whose origin is its upper end: in the origin of
    the next unit, or at the tip, of the arm as it was drawn. Shape (n, 3).

    Raises:
        InputError: a unit that the next one, or the tip, does not hang from, or that has no length.
    """
    arm = ArmModel(model)
    bodies, tip, ends = arm.unit_bodies, model.site(arm.tip_site), []
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
    return np.array(ends)[arm.unit_of_hinge]


def _places(model: mujoco.MjModel, ends: np.ndarray) -> np.ndarray:
    """Where each hinge lies along its unit, as a share of the unit's length. Shape (n,)."""
    return np.sum(model.jnt_pos[: len(ends)] * ends, axis=1) / np.sum(ends * ends, axis=1)


def _write_place(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Move every hinge along its unit, and no other way: one that lies beside the unit's line stays as far from it."""
    ends = unit_ends(model)
    moves = values[:, None] - _places(model, ends)
    fields["jnt_pos"][:, : len(ends)] += moves[..., None] * ends


def _start_measured(kind: ExperimentKind) -> bool:
    """The bent pose from which a release starts is fitted beforehand, with the hinges where they were then."""
    return kind.static or kind.needs_motors


def _hinge_share(model: mujoco.MjModel) -> float:
    """How much of a joint's hardening its hinges have; its diagonals have the rest."""
    return HINGE_SHARE if ArmModel(model).diagonals else 1.0


def _read_hardening(model: mujoco.MjModel) -> float:
    return float(model.jnt_stiffnesspoly[0, 1] / model.jnt_stiffness[0] / _hinge_share(model))


def _write_hardening(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    hardening = values[:, None] * fields["jnt_stiffness"]  # 0 for branches' hinges
    fields["jnt_stiffnesspoly"][:, :, 1] = _hinge_share(model) * hardening
    for part in ArmModel(model).diagonals:
        fields["tendon_stiffnesspoly"][:, part.tendon, 1] = DIAGONAL_SHARE * hardening[:, part.hinge]


def _write_friction(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    fields["dof_frictionloss"][:] = values[:, None] * fields["jnt_stiffness"]


def follow_rest(fields: Fields, model: mujoco.MjModel) -> None:
    """Let the diagonals of round joints be slack where the hinges are, whose `qpos_spring` (C, nq) is in `fields`."""
    tendons, lengths = ArmModel(model).diagonal_lengths(fields["qpos_spring"])
    if len(tendons):
        shape = (len(lengths), *model.tendon_lengthspring.shape)
        slack = fields.setdefault("tendon_lengthspring", np.broadcast_to(model.tendon_lengthspring, shape).copy())
        slack[:, tendons] = lengths[..., None]


def _part(kind: str, number: int) -> ArmPart:
    lacking = f"found it for joints without {kind} {number}, expected build_mjcf.joints with one"
    return ArmPart(lambda arm: len(arm.elements[kind]) >= number, lacking)


def _share(kind: str, number: int) -> Parameter:
    """Stiffness of the joints' branches or sliders over that of their springs; a branch keeps its time."""

    def read(model: mujoco.MjModel) -> float:
        part = ArmModel(model).elements[kind][number - 1]
        return float(model.tendon_stiffness[part.tendon[0]] / model.jnt_stiffness[part.hinge[0]])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        part = ArmModel(model).elements[kind][number - 1]
        times = fields["dof_damping"][:, part.branch] / fields["tendon_stiffness"][:, part.tendon[: len(part.branch)]]
        stiffness = values[:, None] * fields["jnt_stiffness"][:, part.hinge]
        fields["tendon_stiffness"][:, part.tendon] = stiffness
        fields["dof_damping"][:, part.branch] = times * stiffness[:, : len(part.branch)]

    fields = ("tendon_stiffness", "dof_damping", "jnt_stiffness")
    return Parameter("", fields, read, write, part=_part(kind, number), identifiable_from=moving)


def _relaxation_time(number: int) -> Parameter:
    def read(model: mujoco.MjModel) -> float:
        part = ArmModel(model).branches[number - 1]
        return float(model.dof_damping[part.branch[0]] / model.tendon_stiffness[part.tendon[0]])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        part = ArmModel(model).branches[number - 1]
        fields["dof_damping"][:, part.branch] = values[:, None] * fields["tendon_stiffness"][:, part.tendon]

    fields = ("dof_damping", "tendon_stiffness")
    return Parameter("s", fields, read, write, part=_part(BRANCH, number), identifiable_from=moving)


def _yield_bend(number: int) -> Parameter:
    def read(model: mujoco.MjModel) -> float:
        return float(model.tendon_springyield[ArmModel(model).sliders[number - 1].tendon[0]])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        fields["tendon_springyield"][:, ArmModel(model).sliders[number - 1].tendon] = values[:, None]

    fields = ("tendon_springyield",)
    return Parameter("rad", fields, read, write, part=_part(SLIDER, number), identifiable_from=moving)


def _rest_bend(axis: int, power: int) -> Parameter:
    """A coefficient of the shape in which the springs are slack: every joint bends by c_0 + c_1 s about an axis, s from
    -1 at the first joint to 1 at the last. Of a joint's two hinges, one is about x, or nearer to it, whichever comes
    first."""

    def basis(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
        pairs = np.arange(ArmModel(model).hinge_count).reshape(-1, 2)
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


# Order matters: what scales with stiffness is written after it.
JOINT_PARAMETERS: dict[str, Parameter] = {
    "stiffness": _of_the_first("N m/rad", STIFFNESS_FIELDS, "jnt_stiffness", scale_stiffness),
    # where a unit bends, as a share of its length: 0 at its upper end, 0.5 if all along; 1 - γ, γ the characteristic
    # radius factor of pseudo-rigid-body models (L. L. Howell, Compliant Mechanisms, 2001)
    "joint_place": Parameter(
        "", ("jnt_pos",), lambda m: float(_places(m, unit_ends(m))[0]), _write_place, signed=True,
        identifiable_from=_start_measured,
    ),
    "hardening": Parameter("1/rad²", STIFFNESS_FIELDS, _read_hardening, _write_hardening),
    "axial_stiffness": Parameter(
        "N", ("numeric_data",), _read_axial, _write_axial, identifiable_from=pulled,
        part=ArmPart(
            lambda arm: len(arm.axial_stiffness) > 0,
            "found it for units that keep their lengths, expected build_mjcf.arm.sections with axial_stiffness",
        ),
    ),
    "joint_friction": Parameter(
        "rad", ("dof_frictionloss", "jnt_stiffness"),
        lambda m: float(m.dof_frictionloss[0] / m.jnt_stiffness[0]), _write_friction, identifiable_from=moving,
    ),
    "damping": _of_the_first("N m s/rad", DAMPING_FIELDS, "dof_damping", scale_damping, moving),
    "relaxation": _share(BRANCH, 1),
    "relaxation_time": _relaxation_time(1),
    "relaxation_2": _share(BRANCH, 2),
    "relaxation_time_2": _relaxation_time(2),
    "relaxation_3": _share(BRANCH, 3),
    "relaxation_time_3": _relaxation_time(3),
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
}  # fmt: skip
