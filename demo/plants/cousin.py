"""The cousin: an arm that shares the model's structure, and is not the model. Tests of recovery go on with it.

Every unit of the spiral hangs on a short elastic link with a joint at each end (twice the joints), the joints
harden, scatter and have dry friction, the masses are off, and the cables are stiff springs wound by motors.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from demo.plants.bench import COMMAND_RATE, SAMPLE_RATE, Bench, PlantMotion, PrintedArm, Share
from trunkline.compute.progress import progress
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import unit_properties
from trunkline.model.arm.mjcf import Solref, unit_name
from trunkline.model.simulation.load import hang
from trunkline.model.simulation.motion import batch_of, move

CALM = 8.0  # times the arm's damping: it comes to rest sooner, and in the same place
LONGEST_REST = 8.0  # s


@dataclass
class WinchMotors:
    """What winds the cables: it follows commands late and no faster than it can.

    rate_limit: m/s of cable. command_delay: s.
    """

    rate_limit: Annotated[float, Field(gt=0, le=100)]
    command_delay: Annotated[float, Field(ge=0, le=10)]


@dataclass
class CousinSettings(PrintedArm):
    """The truth about the arm on the bench, which scatters by joint pair.

    damping_ratio: ζ of D = 2ζ √(K m) ℓ. dry_friction: torque over stiffness, rad. tendon_friction, max_force: N.
    link_ratio: length of the elastic link over that of its unit. link_mass_ratio: likewise for the mass.
    armature: kg m². limit_solref: s and ratio, of the units closing on each other.
    """

    kind: Literal["cousin"]
    damping_ratio: Annotated[float, Field(gt=0, le=100)]
    dry_friction: Annotated[float, Field(ge=0, le=10)]
    tendon_friction: Annotated[float, Field(ge=0, le=1000)]
    max_force: Annotated[float, Field(gt=0, le=1e5)]
    link_ratio: Share
    link_mass_ratio: Share
    armature: Annotated[float, Field(ge=0, le=1)]
    limit_solref: Solref
    motors: WinchMotors


class Cousin:
    """The plant, hanging straight down. Draws the stiffness scatter from `rng`."""

    def __init__(self, chain: ChainGeometry, settings: CousinSettings, tendons: int, rng: np.random.Generator) -> None:
        self.chain, self.settings, self.tendons = chain, settings, tendons
        self.model = build_model(chain, settings, tendons, rng)

    def run(self, label: str, bench: Bench, tracked: list[int]) -> PlantMotion:
        wound = wind(bench.commands, self.settings.motors)
        controls = np.concatenate([self.model.tendon_length0 - wound, bench.pulls], axis=2)
        angles = self._simulate(label, bench, controls)[:, bench.skipped :]
        sites = [self.model.site(f"{unit_name(index)}_center").id for index in tracked]
        positions = np.empty((*angles.shape[:2], len(sites), 3))
        rotations = np.empty((*positions.shape, 3))
        data = mujoco.MjData(self.model)
        for trial, path in enumerate(angles):
            for frame, qpos in enumerate(path):
                data.qpos[:] = qpos
                mujoco.mj_kinematics(self.model, data)
                positions[trial, frame] = data.site_xpos[sites]
                rotations[trial, frame] = data.site_xmat[sites].reshape(-1, 3, 3)
        return PlantMotion(positions, rotations, wound[:, :: bench.stride][:, bench.skipped :][:, : angles.shape[1]])

    def answers(self) -> dict:
        """Stiffness, with its mean scatter, and damping are those of a unit's two joints in series, at the base."""
        s, model = self.settings, self.model
        properties = unit_properties(self.chain, s.modulus, s.density, s.core_ratio, s.damping_ratio)
        hinges = model.nv // self.chain.units  # two joints of two hinges a unit, each joint twice as stiff as the unit
        scatter = model.jnt_stiffness[::hinges] / 2 / properties.stiffness
        values = {
            "stiffness": scatter.mean() * properties.stiffness[0],
            "joint_place": 0.0,  # two joints, evenly on both sides of it
            "hardening": s.hardening,
            "damping": model.dof_damping[0] / 2,
            "tendon_friction": model.tendon_frictionloss[0] if model.ntendon else None,
            "friction_time": model.tendon_solref_fri[0, 0] if model.ntendon else None,
            "kp": s.cable_stiffness,
            "kv": s.cable_damping,
            "force_range": s.max_force,
            "time_constant": None,
        }
        return {
            "parameters": values,
            "forces": ["stiffness", "damping", "tendon_friction", "kp", "kv", "force_range"],
            "mass_factor": s.mass_factor,
            "stiffness_factors": scatter / scatter.mean(),
        }

    def _simulate(self, label: str, bench: Bench, controls: np.ndarray) -> np.ndarray:
        """Joint angles (n, T, nq) at SAMPLE_RATE of n trials that start at rest, straight if the mount is upright."""
        batch = batch_of(self.model, len(controls))
        batch.expand("opt.gravity")[:] = bench.gravity
        damping = batch.expand("dof_damping")
        if bench.loads.any():
            hang(batch, self.model, bench.loads)
        stride = bench.stride
        if bench.hanging:
            damping *= CALM
            move(batch, np.repeat(controls[:, :1], round(LONGEST_REST * COMMAND_RATE), axis=1), (), stride)
        damping[:] = bench.steady_factor * self.model.dof_damping
        instants = controls.shape[1] // stride
        parts = [batch.bind("qpos")[:, None].copy()]
        with progress(instants, f"record {label}", "instants") as bar:
            for start, end in pairwise((0, round(bench.steady * SAMPLE_RATE), instants)):
                if start or not bench.steady:
                    damping[:] = self.model.dof_damping
                rows = controls[:, start * stride : end * stride]
                if len(rows[0]):
                    parts.append(move(batch, rows, ("qpos",), stride, at=stride - 1, moved=bar.update)["qpos"])
        assert not batch.warning.any(), "the cousin's simulation diverged: its steps are too long"
        return np.concatenate(parts, axis=1)[:, :instants]


def wind(commands: np.ndarray, motors: WinchMotors) -> np.ndarray:
    """Cable wound by motors that follow `commands` (n, T, K) at COMMAND_RATE late and at a limited rate, in m."""
    delay, furthest = round(motors.command_delay * COMMAND_RATE), motors.rate_limit / COMMAND_RATE
    wound = np.empty_like(commands)
    position = commands[:, 0]
    for row in range(commands.shape[1]):
        position = position + np.clip(commands[:, max(row - delay, 0)] - position, -furthest, furthest)
        wound[:, row] = position
    return wound


def build_model(
    chain: ChainGeometry, settings: CousinSettings, tendons: int, rng: np.random.Generator
) -> mujoco.MjModel:
    """The cousin, hanging straight down; gravity is set per trial. Draws the stiffness scatter from `rng`.

    Actuators: first a cable spring for each tendon (ctrl: wound length, m), then a pull for each (ctrl: N), by
    which a hand bends the arm before it lets go.
    """
    properties = unit_properties(chain, settings.modulus, settings.density, settings.core_ratio, settings.damping_ratio)
    scatter = 1 + settings.stiffness_scatter * rng.uniform(-1, 1, chain.units)
    spec = mujoco.MjSpec()
    spec.compiler.degree = spec.compiler.autolimits = False
    spec.option.timestep = 1 / COMMAND_RATE
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


def _add_cable(spec: mujoco.MjSpec, index: int, settings: CousinSettings):
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
