"""What a joint of an elastomer does beside bending like two springs: it creeps, remembers, is round. In plain MJCF.

A Maxwell branch, a spring and a damper in series, is a hinge of negligible inertia on the world, tied to the arm's
hinge by a fixed tendon of stiffness k (coefficients 1 and -1), with damping k τ. A Jenkins element, a spring and a dry
slider in series, is a fixed tendon on the arm's hinge alone, whose spring yields. Both are in proportion to the
stiffness of their joint, so they fall along a spiral with α³ as that does. At rest a branch bears nothing; sliders open
a band of shapes at rest, of which the model's statics are the middle.

A round joint hardens by its whole bend, whichever way: its energy is K/2 (x² + y²) + K c/4 (x² + y²)². Two hinges that
harden each by itself would be half as hard half-way between their axes. As 3 (x² + y²)² = 2 x⁴ + 2 y⁴ + ((x + y)⁴ +
(x - y)⁴)/2, hinges have two thirds of K c, and two fixed tendons, the diagonals x + y and x - y, a sixth each.

Nor has a round joint a side to which it bends further. Hinges that end at r each would let it bend by √2 r half-way
between their axes; |x ± y| ≤ √2 r, the same r along the diagonals, make an octagon of that square, which lets it bend
by r / cos 22.5°, 8 % beyond the circle, at most. MuJoCo divides a limit's force by the inverse inertia that it moves,
w of a hinge and 2 w of a diagonal, whose length grows √2 times as fast as the bend: a torque √2 · √2 / 2 as large, the
same. What is in rad of a hinge is √2 times that of a diagonal: range, margin, and the width in `solimp`.
"""

from dataclasses import dataclass, field
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.model.arm_model import BRANCH, DIAGONAL, DIAGONAL_SHARE, HINGE_SHARE, SLIDER, TIE

LIMIT_FIELDS = ("jnt_limited", "jnt_range", "jnt_margin", "jnt_solref", "jnt_solimp")
LIGHT = 1e-9  # kg and kg m², what MuJoCo wants of a body that moves; its damping makes it follow, not its inertia

Share = Annotated[float, Field(gt=0, le=10)]


@dataclass
class MaxwellElement:
    """share: stiffness k over that of the joint's spring. time: τ, s, in which the branch gives way."""

    share: Share
    time: Annotated[float, Field(gt=0, le=1000)]


@dataclass
class JenkinsElement:
    """share: stiffness k over that of the joint's spring. yield_bend: rad, beyond which it slips."""

    share: Share
    yield_bend: Annotated[float, Field(gt=0, le=3)]


@dataclass
class Joints:
    """What each joint has beside its spring and damper: `branch` 1, 2, … and `slider` 1, 2, … in this order.

    round: whether it hardens, and ends, by its whole bend, in place of each of its two hinges by its own.
    """

    branches: Annotated[list[MaxwellElement], Field(max_length=3)] = field(default_factory=list)
    sliders: Annotated[list[JenkinsElement], Field(max_length=5)] = field(default_factory=list)
    round: bool = False


def add_elements(spec: mujoco.MjSpec, joints: Joints, armature: float) -> None:
    """Give every joint of an arm its branches and sliders, and make it round, in place.

    Args:
        armature: kg m², of a branch's hinge.

    Raises:
        InputError: a body to be round has not two hinges of the same spring.
    """
    hinges = [(joint, joint.parent.name) for joint in spec.joints]
    if joints.round:
        _make_round(spec)
    for number, branch in enumerate(joints.branches, 1):
        for joint, body in hinges:
            name = f"{joint.name}_{BRANCH}_{number}"
            light_body = spec.body(f"{body}_{BRANCH}_{number}") or _light_body(spec, f"{body}_{BRANCH}_{number}")
            stiffness = branch.share * float(joint.stiffness[0])
            light_body.add_joint(
                name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis, limited=False, armature=armature,
                damping=[stiffness * branch.time, 0, 0],
            )  # fmt: skip
            tie = spec.add_tendon(name=f"{name}{TIE}", stiffness=[stiffness, 0, 0], springlength=[0, 0])
            tie.wrap_joint(joint.name, 1)
            tie.wrap_joint(name, -1)
    for number, slider in enumerate(joints.sliders, 1):
        for joint, _ in hinges:
            spring = spec.add_tendon(
                name=f"{joint.name}_{SLIDER}_{number}", stiffness=[slider.share * float(joint.stiffness[0]), 0, 0],
                springlength=[0, 0], springyield=slider.yield_bend,
            )  # fmt: skip
            spring.wrap_joint(joint.name, 1)


def _make_round(spec: mujoco.MjSpec) -> None:
    model = spec.copy().compile()  # its limits are in rad, whatever the file's unit
    for body in spec.bodies:
        hinges = list(body.joints)
        if not hinges:
            continue
        springs = [tuple(map(float, hinge.stiffness)) for hinge in hinges]
        if len(springs) != 2 or springs[0] != springs[1] or springs[0][1]:
            problem, expected = f"found springs {springs}", "two hinges with the same odd one, or `round: false`"
            raise InputError(f"build_mjcf.joints: round: body {body.name!r}: {problem}, expected {expected}")
        for number, sign in enumerate((1, -1), 1):
            name = f"{hinges[0].name}_{DIAGONAL}_{number}"
            diagonal = spec.add_tendon(name=name, stiffness=[0, 0, DIAGONAL_SHARE * springs[0][2]])
            diagonal.wrap_joint(hinges[0].name, 1)
            diagonal.wrap_joint(hinges[1].name, sign)
            _limit_diagonal(diagonal, model, [model.joint(hinge.name).id for hinge in hinges])
        for hinge in hinges:
            hinge.stiffness = [springs[0][0], 0, HINGE_SHARE * springs[0][2]]


def _limit_diagonal(diagonal, model: mujoco.MjModel, hinges: list[int]) -> None:
    """Let it end where two hinges of `model` do, in place, if these end alike on all four sides; else their limits have
    a preferred axis."""
    (low, high), outward = model.jnt_range[hinges[0]], np.sqrt(2)
    alike = all(len(np.unique(getattr(model, name)[hinges], axis=0)) == 1 for name in LIMIT_FIELDS)
    if not (alike and model.jnt_limited[hinges[0]] and low == -high):
        return
    diagonal.limited, diagonal.range = True, [outward * low, outward * high]
    diagonal.margin = outward * model.jnt_margin[hinges[0]]
    diagonal.solref_limit, diagonal.solimp_limit = model.jnt_solref[hinges[0]], model.jnt_solimp[hinges[0]]
    diagonal.solimp_limit[2] *= outward


def _light_body(spec: mujoco.MjSpec, name: str):
    body = spec.worldbody.add_body(name=name)
    body.explicitinertial, body.mass, body.ipos, body.inertia = True, LIGHT, [0, 0, 0], [LIGHT] * 3
    return body
