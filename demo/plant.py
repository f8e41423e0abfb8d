"""The stand-in arm: what the lab has on its bench. It is not the model that gets identified.

Every unit of the spiral hangs on a short elastic link with a joint at each end (twice the joints), the joints
harden, scatter and have dry friction, the masses are off, and the cables are stiff springs wound by motors.
"""

from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.arm.geometry import ChainGeometry
from trunkline.arm.material import unit_properties
from trunkline.arm.mjcf import Solref, unit_name
from trunkline.frames import STANDARD_GRAVITY

Share = Annotated[float, Field(gt=0, lt=1)]


@dataclass
class PlantSettings:
    """The truth about the arm on the bench.

    modulus: Pa. density: kg/m³. core_ratio: core diameter over width.
    mass_factor: of every unit's mass. stiffness_scatter: relative, uniform, per joint pair.
    hardening: relative growth of a joint's stiffness per rad² of bend between two units.
    damping_ratio: ζ of D = 2ζ √(K m) ℓ. dry_friction: torque over stiffness, rad.
    tendon_friction: N. cable_stiffness: N/m. cable_damping: N s/m. max_force: N.
    hole_ratio: distance of the cables from the axis over the unit's radius.
    link_ratio: length of the elastic link over that of its unit. link_mass_ratio: likewise for the mass.
    armature: kg m². timestep: s. limit_solref: s and ratio, of the units closing on each other.
    """

    modulus: Annotated[float, Field(ge=1e3, le=1e12)]
    density: Annotated[float, Field(ge=1, le=30000)]
    core_ratio: Share
    mass_factor: Annotated[float, Field(gt=0, le=100)]
    stiffness_scatter: Annotated[float, Field(ge=0, lt=1)]
    hardening: Annotated[float, Field(ge=0, le=1e6)]
    damping_ratio: Annotated[float, Field(gt=0, le=100)]
    dry_friction: Annotated[float, Field(ge=0, le=10)]
    tendon_friction: Annotated[float, Field(ge=0, le=1000)]
    cable_stiffness: Annotated[float, Field(gt=0, le=1e7)]
    cable_damping: Annotated[float, Field(ge=0, le=1e6)]
    max_force: Annotated[float, Field(gt=0, le=1e5)]
    hole_ratio: Annotated[float, Field(gt=0, le=1)]
    link_ratio: Share
    link_mass_ratio: Share
    armature: Annotated[float, Field(ge=0, le=1)]
    timestep: Annotated[float, Field(ge=1e-5, le=0.01)]
    limit_solref: Solref


def build_plant(
    chain: ChainGeometry, settings: PlantSettings, tendons: int, rng: np.random.Generator
) -> mujoco.MjModel:
    """The plant, hanging straight down; gravity is set per trial. Draws the stiffness scatter from `rng`.

    Actuators: first a cable spring for each tendon (ctrl: wound length, m), then a pull for each (ctrl: N), by
    which a hand bends the arm before it lets go.
    """
    properties = unit_properties(chain, settings.modulus, settings.density, settings.core_ratio, settings.damping_ratio)
    scatter = 1 + settings.stiffness_scatter * rng.uniform(-1, 1, chain.units)
    spec = mujoco.MjSpec()
    spec.compiler.degree = spec.compiler.autolimits = False
    spec.option.timestep = settings.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    cables = [_add_cable(spec, index, settings) for index in range(tendons)]
    for cable in cables:
        _add_pull(spec, cable.name)

    body = spec.worldbody.add_body(name="base")
    _add_holes(body, "base", settings.hole_ratio * chain.widths[0] / 2, 0.0, cables)
    bottom = 0.0  # of the body's frame, where its lower neighbour begins
    for index, length in enumerate(chain.lengths):
        name, half_link = unit_name(index), settings.link_ratio * length / 2
        stiffness = 2 * scatter[index] * properties.stiffness[index]
        joint = {
            "type": mujoco.mjtJoint.mjJNT_HINGE,
            "limited": True,
            "range": [-chain.joint_range[index] / 2, chain.joint_range[index] / 2],
            # half the bend in each of the two joints: h q² becomes h (2 q)²
            "stiffness": [stiffness, 0, 4 * settings.hardening * stiffness],
            "damping": [2 * properties.damping[index], 0, 0],
            "frictionloss": settings.dry_friction * properties.stiffness[index],
            "armature": settings.armature,
            "solref_limit": settings.limit_solref,
        }
        mass = settings.mass_factor * properties.masses[index]
        inertia = np.array([properties.transverse_inertia[index]] * 2 + [properties.axial_inertia[index]])
        inertia *= settings.mass_factor
        share = settings.link_mass_ratio
        # the link spans half_link above and below the unit's nominal joint; the base has none above it
        start = bottom + (half_link if index else 0.0)
        link = body.add_body(name=f"{name}_link", pos=[0, 0, start])
        link_length = half_link * (2 if index else 1)
        _set_inertia(link, share * mass, share * inertia * settings.link_ratio, -link_length / 2)
        for axis, direction in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
            link.add_joint(name=f"{name}_upper_{axis}", axis=direction, **joint)
        body = link.add_body(name=name, pos=[0, 0, -link_length])
        for axis, direction in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
            body.add_joint(name=f"{name}_lower_{axis}", axis=direction, **joint)
        center = -(length / 2 - half_link)
        _set_inertia(body, (1 - share) * mass, (1 - share) * inertia, center)
        body.add_site(name=f"{name}_center", pos=[0, 0, center])
        _add_holes(body, name, settings.hole_ratio * chain.widths[index] / 2, center, cables)
        bottom = -(length - half_link)
    body.add_site(name="tip", pos=[0, 0, bottom])
    return spec.compile()


def _set_inertia(body, mass: float, inertia: np.ndarray, center: float) -> None:
    body.explicitinertial, body.mass, body.inertia, body.ipos = True, mass, inertia, [0, 0, center]


def _add_cable(spec: mujoco.MjSpec, index: int, settings: PlantSettings):
    cable = spec.add_tendon(name=f"tendon_{index + 1}", frictionloss=settings.tendon_friction)
    spring = spec.add_actuator(name=f"{cable.name}_spring", target=cable.name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    spring.set_to_position(kp=settings.cable_stiffness, kv=settings.cable_damping)
    spring.forcelimited, spring.forcerange = True, [-settings.max_force, 0]
    return cable


def _add_pull(spec: mujoco.MjSpec, tendon: str) -> None:
    pull = spec.add_actuator(name=f"{tendon}_pull", target=tendon, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    pull.set_to_motor()
    pull.gear = [-1, 0, 0, 0, 0, 0]


def _add_holes(body, name: str, radius: float, height: float, cables: list) -> None:
    for index, cable in enumerate(cables):
        angle = 2 * np.pi * index / len(cables)
        body.add_site(name=f"{name}_hole_{index + 1}", pos=[radius * np.cos(angle), radius * np.sin(angle), height])
        cable.wrap_site(f"{name}_hole_{index + 1}")
