"""What a model of an arm fixes and no stage identifies: tolerances of its making, as changes of the model's fields.

Each is as large as one standard deviation. What scatters from unit to unit changes by the lowest cosines along the arm,
which are alike in size and independent of each other (the Karhunen-Loève expansion of independent scatter is by any
orthonormal basis); an arm's shape answers the slow ones, as it sums up what its units do.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, NamedTuple

import mujoco
import numpy as np
from pydantic import Field

from trunkline.identification.parameters.joints import STIFFNESS_FIELDS, follow_rest, scale_stiffness, unit_ends
from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.parameters.parameters import ParameterName, parameter_named
from trunkline.model.arm_model import SLIP_LENGTH, ArmModel

# cosines along the arm for what scatters from unit to unit: many at rest, where simulations cost little and rest shapes
# are identified, few in motion, which faster ones do not change
WAVES, WAVES_MOVING = 6, 3
MASS_FIELDS = ("body_mass", "body_inertia")
MOTOR_FIELDS = ("actuator_gainprm", "actuator_biasprm")
ONE_SIDED = ("joint_friction", "tendon_friction")  # parameters that a model without them has at 0, and which only grow

Share = Annotated[float, Field(ge=0, le=1)]
Metres = Annotated[float, Field(ge=0, le=0.1)]
Radians = Annotated[float, Field(ge=0, le=1)]


@dataclass
class Tolerances:
    """Standard deviations of what is considered, 0 for what is not: conf/shared/considered/ has them with sources.

    stiffness_scatter: of a unit's, relative. diameter: of the first joint's core, relative; all cores are as much
    thicker or thinner. clamp: stiffness of the first joint, relative. ovality: stiffness about x over that about y,
    half of it, relative. unit_end: m, where a unit ends, sideways. place_taper: of `joint_place`, from the middle to
    the tip. mass, mass_taper: relative, of all units, and from the middle to the tip. hole_place: m, of all holes of a
    cable. gain: of a motor with its cable over the first, relative.
    joint_friction: rad, as the parameter. tendon_friction: N. slip_length: relative.
    marker_place: m, along each axis of its body. base_place: m, likewise. gravity: rad, about x and y of the base.
    zero: m, of a cable. backlash: m.
    by_kind: of parameters on the axis of the search, from one kind of experiment to another.
    """

    stiffness_scatter: Share = 0.0
    diameter: Share = 0.0
    clamp: Share = 0.0
    ovality: Share = 0.0
    unit_end: Metres = 0.0
    place_taper: Share = 0.0
    mass: Share = 0.0
    mass_taper: Share = 0.0
    hole_place: Metres = 0.0
    gain: Share = 0.0
    joint_friction: Radians = 0.0
    tendon_friction: Annotated[float, Field(ge=0, le=10)] = 0.0
    slip_length: Share = 0.0
    marker_place: Metres = 0.0
    base_place: Metres = 0.0
    gravity: Radians = 0.0
    zero: Metres = 0.0
    backlash: Metres = 0.0
    by_kind: dict[ParameterName, Share] = field(default_factory=dict)

    @property
    def none(self) -> bool:
        """Whether nothing is considered."""
        return not any(vars(self).values())

    def scaled(self, factor: float) -> "Tolerances":
        """All of them times `factor`."""
        sizes = {name: factor * size for name, size in vars(self).items() if name != "by_kind"}
        return Tolerances(**sizes, by_kind={name: factor * size for name, size in self.by_kind.items()})


class Perturbation(NamedTuple):
    """Of one candidate. source: field of `Tolerances`. label: which of several. fields: that it writes. write: (fields,
    candidate, model) changes that candidate in place."""

    source: str
    label: str
    fields: tuple[str, ...]
    write: Callable[[Fields, int, mujoco.MjModel], None]


def changes(model: mujoco.MjModel, sizes: Tolerances, moving: bool, pulled: bool) -> list[Perturbation]:
    """Those of the model's own fields.

    Args:
        moving, pulled: whether the arm moves in any trial, and whether cables do; at rest, dry friction is off.
    """
    arm = ArmModel(model)
    units = len(arm.unit_bodies)
    along = np.linspace(-1, 1, units)
    slowest = waves(units, WAVES_MOVING if moving else WAVES)
    listed = [
        *_scaled("stiffness_scatter", sizes.stiffness_scatter, STIFFNESS_FIELDS, slowest, _scale_joints),
        *_scaled("diameter", sizes.diameter, STIFFNESS_FIELDS, [_bending(model)], _scale_joints),
        *_scaled("clamp", sizes.clamp, STIFFNESS_FIELDS, [np.eye(units)[0]], _scale_joints),
        *_scaled("mass", sizes.mass, MASS_FIELDS, [np.ones(units)], _scale_masses),
        *_scaled("mass_taper", sizes.mass_taper, MASS_FIELDS, [along], _scale_masses),
    ]
    if sizes.ovality:
        listed.append(Perturbation("ovality", "", STIFFNESS_FIELDS, _oval(sizes.ovality)))
    if sizes.place_taper:
        listed.append(Perturbation("place_taper", "", ("jnt_pos",), _places(sizes.place_taper * along)))
    if sizes.unit_end:
        listed += list(_bent(model, sizes.unit_end, slowest))
    for cable in range(model.nu if sizes.hole_place and pulled else 0):
        listed += [Perturbation("hole_place", f"{cable + 1} {way}", ("site_pos",), _holes(cable, way, sizes.hole_place))
                   for way in ("out", "round")]  # fmt: skip
    for motor in range(1, model.nu if sizes.gain and pulled and arm.commands == "length" else 0):
        listed.append(Perturbation("gain", str(motor + 1), MOTOR_FIELDS, _gain(motor, 1 + sizes.gain)))
    for name in ONE_SIDED if moving else ():
        parameter = parameter_named(name)
        if getattr(sizes, name) and parameter.belongs_to(model) and (pulled or name != "tendon_friction"):
            listed.append(of_parameter(name, parameter.read(model) + getattr(sizes, name), source=name))
    if sizes.slip_length and moving and pulled and arm.rubs:
        listed.append(Perturbation("slip_length", "", ("numeric_data",), _slip(1 + sizes.slip_length)))
    return listed


def of_parameter(name: str, value: float, source: str) -> Perturbation:
    """A parameter of the model at another value."""
    parameter = parameter_named(name)
    fields = parameter.fields
    if "qpos_spring" in fields:
        fields = (*fields, "tendon_lengthspring")

    def write(fields: Fields, candidate: int, model: mujoco.MjModel) -> None:
        parameter.write(_row(fields, candidate), np.array([value]), model)

    return Perturbation(source, name, fields, write)


def waves(units: int, count: int = WAVES) -> list[np.ndarray]:
    """The slowest `count` cosines of those that make up independent scatter of unit size, one a unit. Each (units,)."""
    middles = (np.arange(units) + 0.5) / units
    sizes = np.sqrt(np.where(np.arange(units) > 0, 2.0, 1.0) / units)
    return [sizes[k] * np.cos(np.pi * k * middles) for k in range(min(count, units))]


def _row(fields: Fields, candidate: int) -> Fields:
    """One candidate's fields, views of them, with the axis of candidates."""
    return {name: values[candidate : candidate + 1] for name, values in fields.items()}


def _scaled(
    source: str, size: float, fields: tuple[str, ...], shapes: list[np.ndarray], scale
) -> Iterator[Perturbation]:
    """A change by factors 1 + size times a shape (units,), for each of `shapes`."""
    for number, shape in enumerate(shapes if size else []):
        label = str(number + 1) if len(shapes) > 1 else ""
        yield Perturbation(source, label, fields, partial(scale, factors=1 + size * shape))


def _scale_joints(fields: Fields, candidate: int, model: mujoco.MjModel, factors: np.ndarray) -> None:
    scale_stiffness(_row(fields, candidate), factors[ArmModel(model).unit_of_hinge][None], model)


def _scale_masses(fields: Fields, candidate: int, model: mujoco.MjModel, factors: np.ndarray) -> None:
    bodies = ArmModel(model).unit_bodies
    fields["body_mass"][candidate, bodies] *= factors
    fields["body_inertia"][candidate, bodies] *= factors[:, None]


def _bending(model: mujoco.MjModel) -> np.ndarray:
    """How a unit's stiffness answers the same growth of every core's diameter d, over that of the first joint's. Shape
    (units,).

    A joint has K ~ d⁴ / l, and a unit's length l is in proportion to its d, so d ~ K^(1/3) and ΔK / K = 4 Δd / d.
    """
    arm = ArmModel(model)
    first = np.searchsorted(arm.unit_of_hinge, np.arange(len(arm.unit_bodies)))
    return 4 * (model.jnt_stiffness[0] / model.jnt_stiffness[first]) ** (1 / 3)


def _oval(size: float):
    def write(fields: Fields, candidate: int, model: mujoco.MjModel) -> None:
        about_x = np.abs(model.jnt_axis[: ArmModel(model).hinge_count, 0]) > np.sqrt(0.5)
        scale_stiffness(_row(fields, candidate), np.where(about_x, 1 + size, 1 - size)[None], model)

    return write


def _places(shares: np.ndarray):
    def write(fields: Fields, candidate: int, model: mujoco.MjModel) -> None:
        ends = unit_ends(model)
        fields["jnt_pos"][candidate, : len(ends)] += shares[ArmModel(model).unit_of_hinge][:, None] * ends

    return write


def _bent(model: mujoco.MjModel, size: float, shapes: list[np.ndarray]) -> Iterator[Perturbation]:
    """Rest shapes of units whose ends are off to a side: about each of their two hinges, along the arm by `shapes`."""
    arm = ArmModel(model)
    first = np.searchsorted(arm.unit_of_hinge, np.arange(len(arm.unit_bodies)))
    angles = size / np.linalg.norm(unit_ends(model)[first], axis=1)
    about_x = np.abs(model.jnt_axis[: arm.hinge_count, 0]) > np.sqrt(0.5)
    for axis, hinges in (("x", about_x), ("y", ~about_x)):
        for number, wave in enumerate(shapes):
            bends = np.where(hinges, (angles * wave)[arm.unit_of_hinge], 0.0)

            def write(fields: Fields, candidate: int, model: mujoco.MjModel, bends: np.ndarray = bends) -> None:
                fields["qpos_spring"][candidate, : len(bends)] += bends
                follow_rest(_row(fields, candidate), model)

            yield Perturbation("unit_end", f"{axis} {number + 1}", ("qpos_spring", "tendon_lengthspring"), write)


def _holes(cable: int, way: str, size: float):
    def write(fields: Fields, candidate: int, model: mujoco.MjModel) -> None:
        arm = ArmModel(model)
        sites = arm.cable_sites(arm.cables[cable])
        x, y = model.site_pos[sites, 0], model.site_pos[sites, 1]
        out = np.stack([x, y] if way == "out" else [-y, x], axis=1)
        fields["site_pos"][candidate, sites, :2] += size * out / np.linalg.norm(out, axis=1, keepdims=True)

    return write


def _gain(motor: int, factor: float):
    def write(fields: Fields, candidate: int, model: mujoco.MjModel) -> None:
        fields["actuator_gainprm"][candidate, motor, 0] *= factor
        fields["actuator_biasprm"][candidate, motor, 1] *= factor

    return write


def _slip(factor: float):
    def write(fields: Fields, candidate: int, model: mujoco.MjModel) -> None:
        fields["numeric_data"][candidate, ArmModel(model).places(SLIP_LENGTH)] *= factor

    return write
