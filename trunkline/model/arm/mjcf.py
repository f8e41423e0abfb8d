"""Geometry and unit properties to a MuJoCo model: a pseudo-rigid chain, two hinges a joint, pulling tendons.

Names: bodies `base`, `unit_01`…, `tip_load`; hinges `unit_01_x`, `unit_01_y`; sites `unit_01_center` (the tracked
frame), `unit_01_tendon_1`…, `base_center`, `tip`; tendons `tendon_1`…; actuators `tendon_1_position`…. Markers
that an arm tracks elsewhere than in its units' centres have their own names: site `<marker>_center`. Actuators that
are sent tensions are `tendon_1_tension`….
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import UnitProperties
from trunkline.model.arm.tendons import Route
from trunkline.model.arm_model import (
    AXIAL_STIFFNESS,
    BACKLASH,
    FORCE_SCALE,
    PRELOAD,
    RATE_LIMIT,
    SECTIONS,
    TIP_LOAD,
    WINDING,
)

TENDON_RGBA = (0.15, 0.15, 0.15, 1)
LONGEST_DEAD_TIME = 0.2  # s; what a motor remembers of its commands
UNIT_RGBA = (0.93, 0.55, 0.2, 1)
LOAD_RGBA = (0.4, 0.4, 0.45, 1)

Coefficient = Annotated[float, Field(ge=-1e6, le=1e6)]  # negative ones are stiffness and damping themselves
Aside = Annotated[float, Field(ge=-1, le=1)]
Share = Annotated[float, Field(ge=0, le=1)]
Solref = tuple[Coefficient, Coefficient]
Solimp = tuple[Share, Share, Share, Share, Annotated[float, Field(ge=1, le=100)]]


@dataclass
class Actuation:
    """What pulls each tendon.

    Attributes:
        friction: friction loss of the tendon, N.
        kp: position gain, N/m; None of motors that are commanded by force.
        max_force: largest pull F, N; a tendon cannot push.
        time_constant: of the first-order filter on the commanded length, or force, s.
        dead_time: from a command to the motor's first answer, s; 0 for motors without.
        rate_limit: of the winch, m/s of cable; 0 for none. backlash: of the winch, m of cable.
        commands: what motors are sent, and hold: a length of cable, or the force with which they pull it.
    """

    friction: Annotated[float, Field(ge=0, le=1000)]
    max_force: Annotated[float, Field(gt=0, le=1e5)]
    time_constant: Annotated[float, Field(gt=0, le=10)]
    dead_time: Annotated[float, Field(ge=0, le=LONGEST_DEAD_TIME)] = 0.0
    rate_limit: Annotated[float, Field(ge=0, le=100)] = 0.0
    backlash: Annotated[float, Field(ge=0, le=1)] = 0.0
    commands: Literal["length", "force"] = "length"
    kp: Annotated[float, Field(gt=0, le=1e7)] | None = field(default=None, kw_only=True)

    def __post_init__(self):
        if self.commands == "length" and self.kp is None:
            raise ValueError("kp: missing, expected the position gain of motors that are commanded by length, N/m")
        if self.commands == "force":
            for name in ("kp", "rate_limit", "backlash"):
                if getattr(self, name):
                    raise ValueError(f"{name}: found {getattr(self, name):g} beside `commands: force`, expected none: "
                                     "that is of motors that hold lengths")  # fmt: skip


@dataclass(kw_only=True)
class Tendons(Actuation):
    """routes: one a tendon, in their order. kv: velocity gain, N s/m. described: whether each was described by itself:
    then the model has numbers for what commands draw in."""

    routes: list[Route]
    kv: float
    described: bool = False


@dataclass
class Solver:
    """Numbers of the simulation that are not the arm's.

    Attributes:
        timestep: s.
        armature: added to each hinge, kg m²; the units at the tip are too light for the step without it.
        limit_solref, limit_solimp, friction_solref, friction_solimp: MuJoCo's constraint parameters of joint
            limits and of tendon friction, fixed because they are part of what "friction" means.
    """

    timestep: Annotated[float, Field(ge=1e-5, le=0.01)]
    armature: Annotated[float, Field(ge=0, le=1)]
    limit_solref: Solref
    limit_solimp: Solimp
    friction_solref: Solref
    friction_solimp: Solimp


@dataclass
class Marker:
    """distance: of a tracked point from the mount along the straight arm, m; beyond the tip it sticks out of the last
    unit. aside: x and y of it from the axis, m."""

    distance: Annotated[float, Field(gt=0, le=10)]
    aside: tuple[Aside, Aside] = (0.0, 0.0)


def unit_name(index: int) -> str:
    """Name of unit `index`, counted from 0 at the base: `unit_01` is the first."""
    return f"unit_{index + 1:02d}"


def build_spec(
    chain: ChainGeometry,
    properties: UnitProperties,
    tendons: Tendons,
    solver: Solver,
    tip_load: float = 0.0,
    markers: dict[str, Marker] | None = None,
    joint_place: float = 0.0,
) -> mujoco.MjSpec:
    """The arm hanging straight down from its mount, in SI units. Compile it with `.compile()`.

    Args:
        tip_load: kg that hangs at the tip.
        markers: name of a marker to where it sits.
        joint_place: where a unit bends, as a share of its length from its upper end.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "arm"
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    spec.option.timestep = solver.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    cables = [_add_cable(spec, index, tendons, solver) for index in range(len(tendons.routes))]
    for name in (RATE_LIMIT, BACKLASH):  # MJCF has no such thing: the stepper reads it
        if cables and getattr(tendons, name):
            spec.add_numeric(name=name, data=[getattr(tendons, name)], size=1)

    if cables and tendons.commands == "force":
        spec.add_numeric(name=FORCE_SCALE, data=[1.0], size=1)
    elif tendons.described and tendons.kp is not None:
        preload = [route.pretension / tendons.kp for route in tendons.routes]
        spec.add_numeric(name=WINDING, data=[1.0], size=1)
        spec.add_numeric(name=PRELOAD, data=preload, size=len(preload))
    if properties.axial_stiffness is not None:
        spec.add_numeric(name=AXIAL_STIFFNESS, data=properties.axial_stiffness, size=chain.units)
    if chain.sections:
        spec.add_numeric(name=SECTIONS, data=chain.sections, size=len(chain.sections))

    body = spec.worldbody.add_body(name="base")
    body.explicitinertial, body.mass, body.inertia = True, 1.0, [1e-3] * 3  # fixed: never felt
    _add_geom(body, "base", chain.widths[0] / 2, 0.005, (0, 0, 0.005))
    body.add_site(name="base_center")
    _add_holes(body, "base", 0, 0.0, tendons.routes, cables)
    units = []
    for index in range(chain.units):
        body = _add_unit(body, index, chain, properties, solver, joint_place)
        _add_holes(body, unit_name(index), index + 1, -chain.lengths[index] / 2, tendons.routes, cables)
        units.append(body)
    for name, marker in (markers or {}).items():
        unit = chain.unit_at(marker.distance)
        place = [*marker.aside, chain.lengths[:unit].sum() - marker.distance]
        units[unit].add_site(name=f"{name}_center", pos=place)
    body.add_site(name="tip", pos=[0, 0, -chain.lengths[-1]])
    if tip_load:
        _add_load(body, tip_load, chain)
    return spec


def _add_load(parent, mass: float, chain: ChainGeometry) -> None:
    """A ball at the tip, half as wide as the arm there."""
    radius = chain.widths[-1] / 4
    body = parent.add_body(name=TIP_LOAD, pos=[0, 0, -chain.lengths[-1]])
    body.explicitinertial, body.mass, body.ipos, body.inertia = True, mass, [0, 0, 0], [0.4 * mass * radius**2] * 3
    body.add_geom(
        name="tip_load_geom", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], contype=0, conaffinity=0, mass=0,
        rgba=LOAD_RGBA,
    )  # fmt: skip


def _add_unit(
    parent, index: int, chain: ChainGeometry, properties: UnitProperties, solver: Solver, joint_place: float
):
    name, length = unit_name(index), chain.lengths[index]
    body = parent.add_body(name=name, pos=[0, 0, -chain.lengths[index - 1] if index else 0.0])
    body.explicitinertial = True
    body.mass = properties.masses[index]
    body.ipos = [0, 0, -length / 2]
    body.inertia = [properties.transverse_inertia[index]] * 2 + [properties.axial_inertia[index]]
    axes = (("x", (1, 0, 0)), ("y", (0, 1, 0)))
    # Two hinges in a row turn a unit about its own length too, by half the product of their angles. In the other order
    # the next unit turns it back, so that the arm does not twist as it bends, as none does that is stiff against it.
    for axis, direction in axes if index % 2 == 0 else axes[::-1]:
        body.add_joint(
            name=f"{name}_{axis}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            pos=[0, 0, -joint_place * length],
            axis=direction,
            limited=True,
            range=[-chain.joint_range[index], chain.joint_range[index]],
            stiffness=[properties.stiffness[index], 0, 0],
            damping=[properties.damping[index], 0, 0],
            armature=solver.armature,
            solref_limit=solver.limit_solref,
            solimp_limit=solver.limit_solimp,
        )
    rim_gap = min(chain.widths[index] / 2 * chain.joint_range[index], length)
    _add_geom(body, name, chain.widths[index] / 2, (length - 0.5 * rim_gap) / 2, (0, 0, -length / 2))
    body.add_site(name=f"{name}_center", pos=[0, 0, -length / 2])
    return body


def _add_geom(body, name: str, radius: float, half_height: float, position) -> None:
    body.add_geom(
        name=f"{name}_geom",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, half_height, 0],
        pos=position,
        contype=0,
        conaffinity=0,
        mass=0,
        rgba=UNIT_RGBA,
    )


def _add_cable(spec: mujoco.MjSpec, index: int, tendons: Tendons, solver: Solver):
    name = f"tendon_{index + 1}"
    cable = spec.add_tendon(
        name=name,
        frictionloss=tendons.friction,
        solref_friction=solver.friction_solref,
        solimp_friction=solver.friction_solimp,
        width=0.0008,
        rgba=TENDON_RGBA,
    )
    forced = tendons.commands == "force"
    name = f"{name}_{'tension' if forced else 'position'}"
    actuator = spec.add_actuator(name=name, target=cable.name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    if forced:
        pull_with(actuator, tendons.max_force)
        actuator.dyntype, actuator.dynprm[0] = mujoco.mjtDyn.mjDYN_FILTEREXACT, tendons.time_constant
    else:
        actuator.set_to_position(kp=tendons.kp, kv=tendons.kv, timeconst=tendons.time_constant)
        actuator.forcelimited, actuator.forcerange = True, [-tendons.max_force, 0]
    if tendons.dead_time:
        actuator.delay = tendons.dead_time
        actuator.nsample = int(np.ceil(LONGEST_DEAD_TIME / solver.timestep)) + 1
        actuator.interp = 1  # linear: else a dead time that is longer by less than a step changes nothing
    return cable


def pull_with(actuator, most: float) -> None:
    """Let an actuator on a tendon pull with the force that it is sent, from 0 to `most` N, in place: a force that
    shortens a tendon is negative to MuJoCo."""
    actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE
    actuator.gainprm, actuator.biasprm = np.eye(len(actuator.gainprm))[0] * -1.0, np.zeros(len(actuator.biasprm))
    actuator.gear = np.eye(6)[0]
    actuator.ctrllimited, actuator.ctrlrange = True, [0, most]
    actuator.forcelimited, actuator.forcerange = True, [-most, 0]


def _add_holes(body, name: str, place: int, height: float, routes: list[Route], cables: list) -> None:
    """The holes of the mount, `place` 0, or of unit `place`, for the tendons that run there."""
    for number, (route, cable) in enumerate(zip(routes, cables, strict=True), start=1):
        if not 0 <= place - route.start < len(route.distances):
            continue
        site, radius = f"{name}_tendon_{number}", route.distances[place - route.start]
        at = [radius * np.cos(route.angle), radius * np.sin(route.angle), height]
        body.add_site(name=site, pos=at, size=[0.0015] * 3)
        cable.wrap_site(site)
