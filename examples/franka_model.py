"""The FR3 as franka-sim takes it without a network: MJCF of the URDF in its own wheel, without meshes.

    fr3/bin/python examples/franka_model.py fr3.xml

It runs in franka-sim's environment. Rotor inertia and damping are added, which a URDF lacks: without them the wrist
runs away. ARMATURE is MuJoCo Menagerie's for the FR3, DAMPING a guess.
"""

import re
import sys
import xml.etree.ElementTree as ElementTree
from importlib.util import find_spec
from pathlib import Path

import mujoco

ARMATURE = (0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074)  # kg m²
DAMPING = 1.0  # N m s/rad


def main(out: str) -> None:
    package = find_spec("franka_sim")
    if package is None or package.origin is None:
        sys.exit("error: found no franka_sim, expected its environment's Python")
    robot = ElementTree.parse(Path(package.origin).parent / "models/fr3.urdf").getroot()
    for link in robot.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler", fusestatic="false")
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(robot, encoding="unicode"))
    for joint in spec.joints:
        number = int(re.fullmatch(r".*joint(\d)", joint.name)[1])  # type: ignore[index]
        joint.armature, joint.damping = ARMATURE[number - 1], DAMPING
    spec.compile()
    Path(out).write_text(spec.to_xml(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
