"""What a joint of an elastomer does beside bending like two springs: it creeps, remembers, is round. In plain MJCF.

A Maxwell branch, a spring and a damper in series, is a hinge of negligible inertia on the world, tied to the arm's
hinge by a fixed tendon of stiffness k (coefficients 1 and -1), with damping k τ. A Jenkins element, a spring and a dry
slider in series, is a fixed tendon on the arm's hinge alone, whose spring yields. Both are in proportion to the
stiffness of their joint, so they fall along a spiral with α³ as that does. At rest a branch bears nothing; sliders open
a band of shapes at rest, of which the model's statics are the middle.

A round joint hardens by its whole bend, whichever way: its energy is K/2 (x² + y²) + K c/4 (x² + y²)². Two hinges that
harden each by itself would be half as hard half-way between their axes. As 3 (x² + y²)² = 2 x⁴ + 2 y⁴ + ((x + y)⁴ +
(x - y)⁴)/2, hinges have two thirds of K c, and two fixed tendons, the diagonals x + y and x - y, a sixth each.
"""

from dataclasses import dataclass, field
from typing import Annotated

import mujoco
from pydantic import Field

from trunkline.errors import InputError
from trunkline.model.arm_model import BRANCH, DIAGONAL, DIAGONAL_SHARE, HINGE_SHARE, SLIDER, TIE

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

    round: whether it hardens by its whole bend, in place of each of its two hinges by its own.
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
        for hinge in hinges:
            hinge.stiffness = [springs[0][0], 0, HINGE_SHARE * springs[0][2]]


def _light_body(spec: mujoco.MjSpec, name: str):
    body = spec.worldbody.add_body(name=name)
    body.explicitinertial, body.mass, body.ipos, body.inertia = True, LIGHT, [0, 0, 0], [LIGHT] * 3
    return body
