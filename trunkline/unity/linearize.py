"""Polynomial springs and dampers, which Unity's importer cannot read: a line for it, and the way back.

MuJoCo's joint torque is -(a q + b q² + c q³) for a spring and -(a v + b v|v| + c v³) for a damper. The line
that stands in for it is nearest in the mean square over the angles and speeds of a given movement, Σ τ q / Σ q².
So it is for a round joint's diagonals, whose lengths are sums and differences of angles. In Unity,
`csharp/Twin.cs` writes the polynomials back; `write_laws` does the same here.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.model.arm_model import ArmModel


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


@dataclass(frozen=True)
class TendonLaw:
    """The spring of one diagonal, as `JointLaw` has them.

    Attributes:
        tendon: its name.
        coefficients, line: as of a joint.
    """

    tendon: str
    coefficients: tuple[float, float, float]
    line: float


@dataclass(frozen=True)
class Laws:
    """What a model has that is no line: springs and dampers of hinges, and springs of round joints' diagonals."""

    springs: list[JointLaw]
    dampers: list[JointLaw]
    diagonals: list[TendonLaw]

    def __bool__(self) -> bool:
        return bool(self.springs or self.dampers or self.diagonals)


def linearize(spec: mujoco.MjSpec, angles: np.ndarray, speeds: np.ndarray) -> Laws:
    """Replace polynomial springs and dampers by lines, in place.

    Args:
        spec: a model of hinges only.
        angles, speeds: of every joint while it moves, rad and rad/s. Shape (steps, njnt).

    Returns:
        Those that were replaced.
    """
    diagonals, lengths = ArmModel(spec.compile()).diagonal_lengths(angles)
    laws, tendons = {"stiffness": [], "damping": []}, []
    for joint, q, v in zip(spec.joints, angles.T, speeds.T, strict=True):
        for attribute, x, even in (("stiffness", q, q**2), ("damping", v, v * np.abs(v))):
            a, b, c = map(float, getattr(joint, attribute))
            if b == 0 and c == 0:
                continue
            slope = _slope((a, b, c), x, even)
            laws[attribute].append(JointLaw(joint.name, (a, b, c), slope))
            setattr(joint, attribute, [slope, 0, 0])
    for index, length in zip(diagonals, lengths.T, strict=True):
        tendon = spec.tendons[index]
        a, b, c = map(float, tendon.stiffness)
        if b == 0 and c == 0:
            continue
        slope = _slope((a, b, c), length, length**2)
        tendons.append(TendonLaw(tendon.name, (a, b, c), slope))
        tendon.stiffness = [slope, 0, 0]
    return Laws(laws["stiffness"], laws["damping"], tendons)


def _slope(coefficients: tuple[float, float, float], x: np.ndarray, even: np.ndarray) -> float:
    a, b, c = coefficients
    return float((a * x + b * even + c * x**3) @ x / (x @ x)) if x.any() else a


def compile_with(mjcf: str, laws: Laws) -> mujoco.MjModel:
    """The model of an MJCF with these laws, its own being lines."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    write_laws(model, laws)
    return model


def write_laws(model: mujoco.MjModel, laws: Laws, prefix: str = "") -> None:
    """Give a compiled model these laws, in place. `prefix`: before the names of an arm that is not alone in it."""
    for spring in laws.springs:
        index = model.joint(prefix + spring.joint).id
        a, *higher = spring.coefficients
        model.jnt_stiffness[index], model.jnt_stiffnesspoly[index] = a, higher
    for damper in laws.dampers:
        index = model.jnt_dofadr[model.joint(prefix + damper.joint).id]
        a, *higher = damper.coefficients
        model.dof_damping[index], model.dof_dampingpoly[index] = a, higher
    for diagonal in laws.diagonals:
        index = model.tendon(prefix + diagonal.tendon).id
        a, *higher = diagonal.coefficients
        model.tendon_stiffness[index], model.tendon_stiffnesspoly[index] = a, higher
