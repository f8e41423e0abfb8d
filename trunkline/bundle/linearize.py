"""The closest model without polynomial springs and dampers, which Unity's importer cannot read.

MuJoCo's joint torque is -(a q + b q² + c q³) for a spring and -(a v + b v|v| + c v³) for a damper. The line
that replaces it is nearest in the mean square over the angles and speeds of a given movement, Σ τ q / Σ q².
"""

from dataclasses import dataclass

import mujoco
import numpy as np


@dataclass(frozen=True)
class Linearization:
    """One value that the bundle changes.

    Attributes:
        element: name of the joint.
        attribute: `stiffness` or `damping`.
        found: the polynomial's coefficients.
        written: the one that replaces them.
    """

    element: str
    attribute: str
    found: tuple[float, ...]
    written: float


def linearize_joints(spec: mujoco.MjSpec, angles: np.ndarray, speeds: np.ndarray) -> list[Linearization]:
    """Replace polynomial springs and dampers of hinges, in place.

    Args:
        spec: a model of hinges only.
        angles, speeds: of every joint while it moves, rad and rad/s. Shape (steps, njnt).
    """
    changes = []
    for joint, q, v in zip(spec.joints, angles.T, speeds.T, strict=True):
        for attribute, x, even in (("stiffness", q, q**2), ("damping", v, v * np.abs(v))):
            a, b, c = getattr(joint, attribute)
            if b == 0 and c == 0:
                continue
            slope = float((a * x + b * even + c * x**3) @ x / (x @ x)) if x.any() else float(a)
            changes.append(Linearization(joint.name, attribute, (a, b, c), slope))
            setattr(joint, attribute, [slope, 0, 0])
    return changes
