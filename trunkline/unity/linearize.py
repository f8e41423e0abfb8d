"""Polynomial springs and dampers, which Unity's importer cannot read: a line for it, and the way back.

MuJoCo's joint torque is -(a q + b q² + c q³) for a spring and -(a v + b v|v| + c v³) for a damper. The line
that stands in for it is nearest in the mean square over the angles and speeds of a given movement, Σ τ q / Σ q².
In Unity, `csharp/CalibratedSprings.cs` writes the polynomials back; `compile_with` does the same here.
"""

from dataclasses import dataclass

import mujoco
import numpy as np


@dataclass(frozen=True)
class JointLaw:
    """The spring or the damper of one hinge.

    Attributes:
        joint: its name.
        coefficients: a, b and c; N m over rad, rad², rad³, or over the same powers of rad/s.
        line: the slope that stands in for it where only one number is read, N m/rad or N m s/rad.
    """

    joint: str
    coefficients: tuple[float, float, float]
    line: float


def linearize_joints(
    spec: mujoco.MjSpec, angles: np.ndarray, speeds: np.ndarray
) -> tuple[list[JointLaw], list[JointLaw]]:
    """Replace polynomial springs and dampers of hinges by lines, in place.

    Args:
        spec: a model of hinges only.
        angles, speeds: of every joint while it moves, rad and rad/s. Shape (steps, njnt).

    Returns:
        The springs and the dampers that were replaced.
    """
    laws = {"stiffness": [], "damping": []}
    for joint, q, v in zip(spec.joints, angles.T, speeds.T, strict=True):
        for attribute, x, even in (("stiffness", q, q**2), ("damping", v, v * np.abs(v))):
            a, b, c = map(float, getattr(joint, attribute))
            if b == 0 and c == 0:
                continue
            slope = float((a * x + b * even + c * x**3) @ x / (x @ x)) if x.any() else a
            laws[attribute].append(JointLaw(joint.name, (a, b, c), slope))
            setattr(joint, attribute, [slope, 0, 0])
    return laws["stiffness"], laws["damping"]


def compile_with(mjcf: str, springs: list[JointLaw], dampers: list[JointLaw]) -> mujoco.MjModel:
    """The model of an MJCF with these springs and dampers, its own being lines."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    for spring in springs:
        index = model.joint(spring.joint).id
        a, *higher = spring.coefficients
        model.jnt_stiffness[index], model.jnt_stiffnesspoly[index] = a, higher
    for damper in dampers:
        index = model.jnt_dofadr[model.joint(damper.joint).id]
        a, *higher = damper.coefficients
        model.dof_damping[index], model.dof_dampingpoly[index] = a, higher
    return model
