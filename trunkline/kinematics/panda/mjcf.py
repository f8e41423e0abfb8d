"""The Panda as a compact MuJoCo model, for tools that want one (mink, viewers): kinematics and self-collision.

Frames, limits and capsules are those of `kinematics` and `collision`. Masses are placeholders: nothing here is
about dynamics.
"""

import mujoco
import numpy as np

from trunkline.kinematics.panda.collision import PAIRS, link_capsules
from trunkline.kinematics.panda.kinematics import DH_A, DH_ALPHA, DH_D, FLANGE, Q_MAX, Q_MIN

PLACEHOLDER_MASS = 1.0  # kg
PLACEHOLDER_INERTIA = [1e-2, 1e-2, 1e-2]  # kg m^2


def panda_spec(mount_offset: float) -> mujoco.MjSpec:
    """Bodies `link_0` to `link_7`, hinges `joint_1` to `joint_7`, site `mount`; contacts between links only.

    Args:
        mount_offset: from the flange to the mount along the flange's z, in m.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "panda"
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    capsules = link_capsules(mount_offset)
    body = spec.worldbody.add_body(name="link_0")
    names = {0: _add_capsules(body, 0, capsules[0])}
    for joint in range(7):
        alpha = DH_ALPHA[joint]
        position = [DH_A[joint], -np.sin(alpha) * DH_D[joint], np.cos(alpha) * DH_D[joint]]
        body = body.add_body(name=f"link_{joint + 1}", pos=position, quat=[np.cos(alpha / 2), np.sin(alpha / 2), 0, 0])
        body.explicitinertial, body.mass, body.inertia = True, PLACEHOLDER_MASS, PLACEHOLDER_INERTIA
        body.ipos = [0, 0, 0]  # without a place, MuJoCo leaves the masses out of the file that it saves
        body.add_joint(name=f"joint_{joint + 1}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1],
                       range=[Q_MIN[joint], Q_MAX[joint]], limited=True)
        names[joint + 1] = _add_capsules(body, joint + 1, capsules.get(joint + 1, []))
    body.add_site(name="mount", pos=[0, 0, FLANGE + mount_offset])
    for first, second in PAIRS:
        for a in names[first]:
            for b in names[second]:
                spec.add_pair(name=f"{a}_{b}", geomname1=a, geomname2=b)
    return spec


def _add_capsules(body, link: int, capsules: list) -> list[str]:
    """Add the capsules of `link` to `body`, spheres where both ends coincide; the names of the geoms."""
    names = [f"link_{link}_{index + 1}" for index in range(len(capsules))]
    for name, (start, end, radius) in zip(names, capsules, strict=True):
        geom = body.add_geom(name=name, contype=0, conaffinity=0, size=[radius, 0, 0])
        if start == end:
            geom.type, geom.pos = mujoco.mjtGeom.mjGEOM_SPHERE, start
        else:
            geom.type, geom.fromto = mujoco.mjtGeom.mjGEOM_CAPSULE, [*start, *end]
    return names
