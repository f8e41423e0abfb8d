"""A small spiral arm for tests: the real geometry and material, fewer units."""

import mujoco
import numpy as np

from trunkline.model.arm.material import TPU_95A_DENSITY, TPU_95A_MODULUS, unit_properties
from trunkline.model.arm.mjcf import Solver, Tendons, build_spec
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm.tendons import even_routes

LIMIT = ([0.01, 1.0], [0.9, 0.95, 0.001, 0.5, 2.0])  # solref, solimp


def small_spec(units: int = 8, **motors: float) -> mujoco.MjSpec:
    """`motors`: what they have beside these gains and this lag, or instead, as `Actuation` names it."""
    chain = spiral_chain(0.507, 0.080, 0.012, units)
    properties = unit_properties(chain, TPU_95A_MODULUS, TPU_95A_DENSITY, 0.24, 0.1)
    gains = {"kp": 2000, "kv": 85, "max_force": 80, "time_constant": 0.05}
    tendons = Tendons(routes=even_routes(chain, 3, 0.85), friction=0.5, **gains | motors)
    return build_spec(chain, properties, tendons, Solver(0.001, 1e-5, *LIMIT, *LIMIT))


def hinges_about(model: mujoco.MjModel, axis: int) -> np.ndarray:
    """Numbers of the hinges about x (0) or y (1), from the base on: in every second unit, y is the first."""
    return np.flatnonzero(model.jnt_axis[:, axis] == 1)


def small_mjcf(units: int = 8) -> str:
    spec = small_spec(units)
    spec.compile()
    return spec.to_xml()
