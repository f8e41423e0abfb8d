"""What MuJoCo's Unity importer (package `org.mujoco`) takes from an MJCF file, read from its C# source.

`MjImporterWithAssets.ImportFile` loads the file, saves it with libmujoco and makes components from what was
saved; `MjScene` later writes an MJCF from those components, in 32-bit floats, and compiles that. So an
attribute is kept only if a component has it. The tables follow `unity/Runtime/{Importer,Components}` of
github.com/google-deepmind/mujoco.
"""

import re
import xml.etree.ElementTree as ET

import numpy as np


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


# Elements that become components, by the element that holds them; None: whatever it holds is about looks or
# stands elsewhere too.
ELEMENTS: dict[str, frozenset[str] | None] = {
    "worldbody": _set("body inertial joint freejoint geom site camera light"),  # MjcfImporter
    "body": _set("body inertial joint freejoint geom site camera light"),
    "tendon": _set("spatial fixed"),
    "spatial": _set("site geom"),  # a <pulley> is read from an attribute that MuJoCo never writes
    "fixed": _set("joint"),
    "actuator": _set("general"),
    "contact": _set("exclude"),
    "equality": _set("connect weld joint tendon"),
    "asset": _set("mesh material texture hfield"),
    "option": _set("flag"),
    "custom": _set("numeric"),
    "compiler": _set(""),
    "size": _set(""),
    "statistic": None,
    "visual": None,
    "default": None,
    "sensor": None,
}

_SOLVER = _set("limited margin frictionloss solreflimit solimplimit solreffriction solimpfriction")
_POSE = _set("pos quat fromto zaxis xyaxes axisangle euler")
_LOOKS = _set("rgba material group class")
_TENDON = _SOLVER | _LOOKS | _set("name springlength stiffness damping range width")  # MjBaseTendon

# Attributes that survive; elements that are not listed are not looked into.
ATTRIBUTES: dict[str, frozenset[str]] = {
    # MjOptionStruct; the time step and gravity come from the project, hence from the manifest
    "option": _set(
        "timestep gravity impratio magnetic wind density viscosity o_margin o_solref o_solimp integrator"
        " cone jacobian solver iterations tolerance noslip_iterations noslip_tolerance"
        " ccd_iterations ccd_tolerance"
    ),
    # MjcfOptionFlag
    "flag": _set(
        "constraint equality frictionloss limit contact gravity clampctrl warmstart filterparent actuation"
        " refsafe override energy fwdinv multiccd"
    ),
    "body": _set("name pos quat childclass mocap"),  # MjBody
    "inertial": _POSE | _set("mass diaginertia"),  # MjInertial
    # MjHingeJoint, MjSlideJoint, MjJointSettings
    "joint": _SOLVER
    | _set("name class group type pos axis range ref springref springdamper stiffness damping armature"),
    # MjGeom, MjGeomSettings
    "geom": _POSE
    | _LOOKS
    | _set("name type size mesh hfield mass density priority contype conaffinity condim solmix solref solimp")
    | _set("margin gap friction fluidshape"),
    "site": _POSE | _LOOKS | _set("name type size"),  # MjSite
    "spatial": _TENDON,
    "fixed": _TENDON,
    "tendon": _TENDON,
    # MjActuator; `input`, which MuJoCo saves from 4.0 on, is refused by the libraries of earlier versions
    "general": _set(
        "name class group joint tendon ctrllimited forcelimited ctrlrange forcerange lengthrange gear dyntype"
        " gaintype biastype dynprm gainprm biasprm"
    ),
    "mesh": _set("name class file scale content_type"),
}

# Values of enumerated attributes that the components know. An unknown integrator aborts the import; an
# unknown actuator type falls back to the default without a word.
CHOICES: dict[tuple[str, str], frozenset[str]] = {
    ("option", "integrator"): _set("Euler RK4 implicit implicitfast"),
    ("general", "dyntype"): _set("none integrator filter filterexact muscle user"),
    ("general", "gaintype"): _set("fixed affine muscle user"),
    ("general", "biastype"): _set("none affine muscle user"),
}

_NUMBERS = re.compile(r"[-+.\deE\s]+")


def imported_attributes(element: ET.Element) -> frozenset[str] | None:
    """Attributes of this element that survive; None if all do, as far as is known.

    <site site=…> in a tendon, <joint joint=… coef=…> and <geom geom=…> refer to the elements of that name.
    """
    if element.get(element.tag) is not None:
        return frozenset((element.tag, "coef", "sidesite"))
    return ATTRIBUTES.get(element.tag)


def as_imported(saved: str) -> str:
    """The MJCF that Unity would compile: attributes without a component dropped, numbers in 32-bit floats.

    Args:
        saved: MJCF as libmujoco saves it. Time step and gravity stay, as the manifest restores them.
    """
    root = ET.fromstring(saved)
    for element in root.iter():
        imported = imported_attributes(element)
        for name, value in list(element.attrib.items()):
            if imported is not None and name not in imported:
                del element.attrib[name]
            elif value.strip() and _NUMBERS.fullmatch(value) and name not in ("name", "timestep", "gravity"):
                element.set(name, " ".join(f"{np.float32(number):.9g}" for number in value.split()))
        if element.tag == "geom" and float(element.get("mass", 0)) == 0:  # MjGeom.OnGenerateMjcf
            element.attrib.pop("mass", None)
    return ET.tostring(root, encoding="unicode")
