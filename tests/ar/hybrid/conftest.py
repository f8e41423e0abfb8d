"""Parts that the tests of this room share. The arm is a spiral of the default size, built from CAD."""

import json
from pathlib import Path

import mujoco
import pytest
from pydantic import TypeAdapter

from trunkline.ar.hybrid.settings import HybridModelSettings
from trunkline.model.arm.guide_holes import Holes, add_holes
from trunkline.model.arm.joints import Branch, Joints, add_elements
from trunkline.model.arm.material import unit_properties
from trunkline.model.arm.mjcf import Solver, Tendons, build_spec
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm.tendons import even_routes
from trunkline.pipeline.config import compose_settings

CONF = Path(__file__).parents[3] / "conf" / "hybrid"
SIZE = {"length": 0.507, "base_width": 0.080, "tip_width": 0.012, "units": 24}
STIFFER = (0.01, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)


def hybrid_settings(**groups: str) -> HybridModelSettings:
    """conf/hybrid with these choices."""
    composed = json.dumps(compose_settings(CONF, groups, "conf/hybrid"))
    return TypeAdapter(HybridModelSettings).validate_json(composed, strict=True)


@pytest.fixture(scope="session")
def chain():
    return spiral_chain(**SIZE)


def rubbing_arm(chain, stretches: int) -> mujoco.MjSpec:
    """With what the identified arm has: creeping joints, cables that rub, motors with a dead time."""
    properties = unit_properties(chain, 26e6, 1210.0, 0.24, 0.1)
    tendons = Tendons(friction=0.0, kp=2000.0, max_force=18.0, time_constant=0.02, dead_time=0.02, kv=7.0,
                      routes=even_routes(chain, 3, 0.85))  # fmt: skip
    spec = build_spec(chain, properties, tendons, Solver(1 / 480, 1e-5, *STIFFER, *STIFFER))
    add_elements(spec, Joints(branches=[Branch(0.2, 0.3)]), 1e-5)
    add_holes(spec, Holes(0.12, stretches))
    return spec


@pytest.fixture(scope="session")
def arm(chain) -> mujoco.MjSpec:
    return rubbing_arm(chain, 8)
