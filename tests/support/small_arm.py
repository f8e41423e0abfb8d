"""A small spiral arm for tests: the real geometry and material, fewer units."""

import mujoco
import numpy as np

from trunkline.model.arm.material import TPU_95A_DENSITY, TPU_95A_MODULUS, unit_properties
from trunkline.model.arm.mjcf import Marker, Solver, Tendons, build_spec
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm.tendons import even_routes
from trunkline.model.arm.uniform import uniform_chain, uniform_properties

LIMIT = ([0.01, 1.0], [0.9, 0.95, 0.001, 0.5, 2.0])  # solref, solimp


def small_spec(units: int = 8, **motors: float) -> mujoco.MjSpec:
    """`motors`: what they have beside these gains and this lag, or instead, as `Actuation` names it."""
    chain = spiral_chain(0.507, 0.080, 0.012, units)
    properties = unit_properties(chain, TPU_95A_MODULUS, TPU_95A_DENSITY, 0.24, 0.1)
    gains = {"kp": 2000, "kv": 85, "max_force": 80, "time_constant": 0.05}
    tendons = Tendons(routes=even_routes(chain, 3, 0.85), friction=0.5, **gains | motors)
    return build_spec(chain, properties, tendons, Solver(0.001, 1e-5, *LIMIT, *LIMIT))


def plain_spec(damping: float, timestep: float, load: float, markers: dict[str, float] | None = None) -> mujoco.MjSpec:
    """Four equal units without tendons, 0.3 m in all. load: kg at the tip. markers: how far from the mount, m."""
    chain, places = uniform_chain(0.3, 0.05, 4, 1.0), {name: Marker(away) for name, away in (markers or {}).items()}
    tendons = Tendons(friction=0.1, kp=200, max_force=20, time_constant=0.1, routes=[], kv=10)
    solver = Solver(timestep, 1e-5, *LIMIT, *LIMIT)
    return build_spec(chain, uniform_properties(chain, [0.02], 1.0, damping), tendons, solver, load, places)


def hinges_about(model: mujoco.MjModel, axis: int) -> np.ndarray:
    """Numbers of the hinges about x (0) or y (1), from the base on: in every second unit, y is the first."""
    return np.flatnonzero(model.jnt_axis[:, axis] == 1)


def small_mjcf(units: int = 8) -> str:
    spec = small_spec(units)
    spec.compile()
    return spec.to_xml()
