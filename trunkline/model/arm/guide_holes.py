"""Friction of cables on the holes that they pass, in plain MJCF as far as that goes.

Where a cable turns by an angle θ at a hole over which it slides, its tension T falls by exp(-μ θ): the capstan
equation. So what it loses in a stretch of the arm is a dry friction of at most about μ θ T against the sliding there,
and what slides is the rest of the cable, from there to its anchor. Each stretch is a further tendon without stiffness:
a sum of hinges' angles, each times the cable's distance from that hinge. (A tendon through the holes themselves would
do, but six for each cable cost more than all the rest of a step.) Its `frictionloss` is that limit, 0 in the file,
where the cable does not rub: MJCF knows constants alone. `trunkline/model/simulation/capstan.py` sets it, and the
distances, which are those of the straight arm in the file, while the arm moves.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.model.arm_model import CAPSTAN_FRICTION, HOLE, SLIP, SLIP_LENGTH, ArmModel, stretch_edges

RIGID_TIME, RIGID = 0.004, 0.999  # s and impedance of the friction: nearer to rigid than MuJoCo's own 0.02 and 0.95


@dataclass
class GuideHoles:
    """friction: μ, a guess. stretches: of the arm, in each of which friction is taken together; 0 for none, and at most
    one a unit. slip: m of sliding within which friction builds up, at rest (`trunkline/model/statics/capstan.py`)."""

    friction: Annotated[float, Field(ge=0, le=3)] = 0.0
    stretches: Annotated[int, Field(ge=0, le=30)] = 0
    slip: Annotated[float, Field(gt=0, le=0.1)] = SLIP


def add_holes(spec: mujoco.MjSpec, holes: GuideHoles) -> None:
    """Let the cables of an arm rub, in place.

    Raises:
        InputError: a cable ends before the last unit, or starts behind the first: how those rub is not modelled.
    """
    cables = [tendon for tendon in spec.tendons if tendon.path[0].type == mujoco.mjtWrap.mjWRAP_SITE]
    if not holes.stretches or not cables:
        return
    spec.add_numeric(name=CAPSTAN_FRICTION, data=[holes.friction], size=1)
    spec.add_numeric(name=SLIP_LENGTH, data=[holes.slip], size=1)
    straight = spec.compile()
    data = mujoco.MjData(straight)
    mujoco.mj_forward(straight, data)
    units = len(ArmModel(straight).unit_bodies)
    for cable in cables:
        arms = _moment_arms(straight, data, straight.tendon(cable.name).id)
        if len(arms) < units:
            problem = f"found holes in which cables rub, and {cable.name!r}, which bends {len(arms)} of {units} units"
            raise InputError(f"build_mjcf.holes: {problem}, expected cables from the mount to the last, or `smooth`")
        edges = stretch_edges(len(arms), holes.stretches)
        for number, (begin, end) in enumerate(pairwise(edges), start=1):
            rubbing = spec.add_tendon(
                name=f"{cable.name}_{HOLE}_{number}", solref_friction=[RIGID_TIME, 1],
                solimp_friction=[RIGID, RIGID, 0.001, 0.5, 2],
            )  # fmt: skip
            for unit in arms[(begin + end) // 2 :]:
                for hinge, arm in unit.items():
                    rubbing.wrap_joint(hinge, arm)


def _moment_arms(model: mujoco.MjModel, data: mujoco.MjData, cable: int) -> list[dict[str, float]]:
    """For each unit that a cable crosses, by hinge: how its path answers the angle, m/rad."""
    row = model.ten_J_rowadr[cable] + np.arange(model.ten_J_rownnz[cable])
    hinges = model.dof_jntid[model.ten_J_colind[row]]
    units: dict[int, dict[str, float]] = {}
    for hinge, arm in zip(hinges, data.ten_J[row], strict=True):
        units.setdefault(int(model.jnt_bodyid[hinge]), {})[model.joint(hinge).name] = float(arm)
    return list(units.values())
