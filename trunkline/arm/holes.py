"""Friction of cables on the holes that they pass, in plain MJCF as far as that goes.

Where a cable turns by an angle θ at a hole over which it slides, its tension T falls by exp(-μ θ): the capstan
equation. So what it loses in a stretch of the arm is a dry friction of at most about μ θ T against the sliding there,
and what slides is the rest of the cable, from there to its anchor. Each stretch is a further tendon on the cable's path
from the stretch's middle to the anchor, without stiffness. Its `frictionloss` is that limit. It is 0 in the file, where
the cable does not rub, as MJCF knows constants alone; `trunkline/simulation/rubbing.py` sets it while the arm moves.
"""

from dataclasses import dataclass
from typing import Annotated

import mujoco
from pydantic import Field

from trunkline.elements import CAPSTAN_FRICTION, HOLE

RIGID_TIME, RIGID = 0.004, 0.999  # s and impedance of the friction: nearer to rigid than MuJoCo's own 0.02 and 0.95


@dataclass
class Holes:
    """friction: μ, a guess. stretches: of the arm, in each of which friction is taken together; 0 for none, and at most
    one a unit."""

    friction: Annotated[float, Field(ge=0, le=3)] = 0.0
    stretches: Annotated[int, Field(ge=0, le=30)] = 0


def add_holes(spec: mujoco.MjSpec, holes: Holes) -> None:
    """Let the cables of an arm rub, in place."""
    cables = [tendon for tendon in spec.tendons if tendon.path[0].type == mujoco.mjtWrap.mjWRAP_SITE]
    if not holes.stretches or not cables:
        return
    spec.add_numeric(name=CAPSTAN_FRICTION, data=[holes.friction], size=1)
    for cable in cables:
        sites = [wrap.target.name for wrap in cable.path]
        units = len(sites) - 1  # the first site is the base's
        stretches = min(holes.stretches, units)
        for number in range(stretches):
            rubbing = spec.add_tendon(
                name=f"{cable.name}_{HOLE}_{number + 1}", solref_friction=[RIGID_TIME, 1],
                solimp_friction=[RIGID, RIGID, 0.001, 0.5, 2], rgba=(0, 0, 0, 0),
            )  # fmt: skip
            begin, end = (n * units // stretches for n in (number, number + 1))
            for site in sites[(begin + end) // 2 :]:
                rubbing.wrap_site(site)
