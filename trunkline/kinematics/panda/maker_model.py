"""The Panda with its maker's shapes, masses and inertias, from the wheel `dm-robotics-panda` (Apache License 2.0; its
meshes from franka_ros, of the same licence).

Geometry and limits are this room's. The wheel's agree but for the ranges, which it rounds inwards by up to 0.3 mrad,
and are replaced; a test compares the kinematics. Its friction at joint 6 is 0.0132 N m s/rad below 0, a fit to a real
robot that would feed a simulation energy: there it is 0. Its inertias are fits too, and joint torques at rest, which
are what limits are compared with, come from masses and centres alone.
"""

from importlib import import_module

import mujoco

from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import FLANGE, Q_MAX, Q_MIN

HULL_CORNERS = 48  # at most, of what each link touches with: MuJoCo collides hulls, the wheel's have up to 2000 corners
JOINTS = [f"joint_{number}" for number in range(1, 8)]


def shipped_panda(mount_offset: float) -> mujoco.MjSpec:
    """Bodies `link_0` to `link_7`, hinges `joint_1` to `joint_7`, geoms `link_0_geom`…, site `mount`.

    Its links collide as their hulls with whatever their geoms' contype and conaffinity name, of which the spec has 0:
    for the Panda with itself there is `collision`, whose capsules are the maker's.

    Args:
        mount_offset: from the flange to the mount along the flange's z, m.

    Raises:
        InputError: the wheel is not installed.
    """
    try:
        path = import_module("dm_robotics.panda.arm_constants").XML_PATH
    except ModuleNotFoundError as error:
        raise InputError(
            f"found no module {error.name}, expected that of `pip install --no-deps dm-robotics-panda`, "
            "which has the Panda's shapes"
        ) from error
    spec = mujoco.MjSpec.from_file(path)
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    for site in list(spec.sites):
        spec.delete(site)
    for mesh in spec.meshes:
        mesh.maxhullvert = HULL_CORNERS
    for number in range(8):
        body = spec.body(f"panda_link{number}")
        body.name, body.gravcomp = f"link_{number}", 0.0
        geom = body.geoms[0]
        geom.name, geom.contype, geom.conaffinity, geom.mass = f"link_{number}_geom", 0, 0, 0.0
    for number, (name, low, high) in enumerate(zip(JOINTS, Q_MIN, Q_MAX, strict=True), start=1):
        joint = spec.joint(f"panda_joint{number}")
        joint.name, joint.range = name, [low, high]
        joint.damping = [max(float(joint.damping[0]), 0.0), 0, 0]
    spec.delete(spec.body("panda_link8"))
    spec.body("link_7").add_site(name="mount", pos=[0, 0, FLANGE + mount_offset])
    return spec
