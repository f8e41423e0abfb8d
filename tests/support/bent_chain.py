"""Chains for the tests of statics: the base of the spiral arm, the same made awkward, and a plain cantilever."""

import mujoco
import numpy as np

from tests.support.small_arm import LIMIT
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.material import TPU_95A_DENSITY, TPU_95A_MODULUS, unit_properties
from trunkline.model.arm.mjcf import Solver, Tendons, build_spec
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm.tendons import even_routes
from trunkline.model.arm_model import DIAGONAL


def stump_spec(units: int = 7) -> mujoco.MjSpec:
    """The first units of the arm of 24, half as stiff. The spiral is self-similar, so they bend as the whole arm does;
    a whole spiral of so few units would not: its long units snap over when pulled."""
    whole = spiral_chain(0.507, 0.080, 0.012, 24)
    geometry = ChainGeometry(
        whole.lengths[:units], whole.widths[:units], whole.joint_range[:units], whole.ratio
    )
    properties = unit_properties(geometry, TPU_95A_MODULUS / 2, TPU_95A_DENSITY, 0.24, 0.1)
    tendons = Tendons(
        routes=even_routes(geometry, 3, 0.85), friction=0.5, kp=2000, kv=85, max_force=80, time_constant=0.05
    )
    return build_spec(geometry, properties, tendons, Solver(0.001, 1e-5, *LIMIT, *LIMIT))


def stump() -> mujoco.MjModel:
    return stump_spec().compile()


def hardening_stump() -> mujoco.MjModel:
    """The stump with hardening, lopsided springs that rest bent, other limits, tilted hinge axes and diagonals with
    limits: everything that the plain one leaves at zero."""
    spec = stump_spec()
    rng = np.random.default_rng(7)
    for joint in spec.joints:
        joint.stiffness = [joint.stiffness[0], 0.2 * joint.stiffness[0], 1.5 * joint.stiffness[0]]
        joint.springref = rng.uniform(-0.1, 0.1)
        joint.range = [-0.3, 0.35]
        joint.margin = 0.02
        joint.solimp_limit = [0.5, 0.95, 0.05, 0.4, 3]
        joint.axis = np.array(joint.axis) + rng.uniform(-0.1, 0.1, 3)
    for first, second in zip(spec.joints[::2], spec.joints[1::2], strict=True):
        axis = first.axis / np.linalg.norm(first.axis)
        second.axis = second.axis - (second.axis @ axis) * axis  # at right angles
        for number, sign in enumerate((1, -1), 1):
            name = f"{first.name}_{DIAGONAL}_{number}"
            diagonal = spec.add_tendon(name=name, stiffness=[0, 0, number * first.stiffness[0]])
            diagonal.wrap_joint(first.name, 1)
            diagonal.wrap_joint(second.name, sign)
            diagonal.limited, diagonal.range, diagonal.margin = True, [-0.4, 0.36 + 0.03 * number], 0.03
            diagonal.solimp_limit = [0.4, 0.9, 0.06, 0.5, 2]
    return spec.compile()


def rubbing(chain, friction: float):
    """The chain with cables that rub on its holes."""
    return chain._replace(capstan=friction, slip=0.01 * chain.length / chain.units)


HINGES = ("x", (1, 0, 0)), ("y", (0, 1, 0))


def cantilever(units: int, stiffness: float, length: float, mass: float = 1e-3, hinges=HINGES) -> mujoco.MjModel:
    """A straight chain of equal units along -z without tendons: a rod clamped at its base.

    Args:
        stiffness: of each hinge, N m/rad. length: of each unit, m. mass: of each unit, kg, at its middle.
        hinges: names and axes of those at the upper end of each unit.
    """
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="base")
    for index in range(units):
        body = body.add_body(name=f"unit_{index + 1:02d}", pos=[0, 0, -length if index else 0])
        body.explicitinertial, body.mass, body.inertia = True, mass, [1e-6] * 3
        body.ipos = [0, 0, -length / 2]
        for name, axis in hinges:
            kind = mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=f"{body.name}_{name}", type=kind, axis=axis, stiffness=[stiffness, 0, 0])
    body.add_site(name="tip", pos=[0, 0, -length])
    return spec.compile()
