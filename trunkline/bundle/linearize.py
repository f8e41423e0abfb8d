"""The closest model without polynomial springs and dampers, which Unity's importer cannot read.

MuJoCo's joint torque is -(a q + b q² + c q³) and -(a v + b v|v| + c v³). The line that is nearest in
the mean square over a symmetric range: over ±R, k = a + 3/5 c R²; over ±V, d = a + 3/4 b V + 3/5 c V².
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


def linearize_joints(spec: mujoco.MjSpec, speed: float) -> list[Linearization]:
    """Replace polynomial joint springs and dampers in place.

    Args:
        spec: the model; an unlimited joint's range counts as ±π.
        speed: V, the joint speed in rad/s up to which damping matters.
    """
    changes = []
    for joint in spec.joints:
        reach = float(np.abs(joint.range).max()) or np.pi
        stiffness, damping = np.array(joint.stiffness), np.array(joint.damping)
        if stiffness[1:].any():
            line = stiffness[0] + 3 / 5 * stiffness[2] * reach**2
            changes.append(Linearization(joint.name, "stiffness", tuple(stiffness.tolist()), float(line)))
            joint.stiffness = [line, 0, 0]
        if damping[1:].any():
            line = damping[0] + 3 / 4 * damping[1] * speed + 3 / 5 * damping[2] * speed**2
            changes.append(Linearization(joint.name, "damping", tuple(damping.tolist()), float(line)))
            joint.damping = [line, 0, 0]
    return changes
