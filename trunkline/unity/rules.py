"""Rules that an MJCF must keep so that MuJoCo's Unity importer makes the same model of it.

The importer reads what libmujoco saves, so that is what is checked here.
"""

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco

from trunkline.errors import InputError
from trunkline.unity.importer import CHOICES, ELEMENTS, imported_attributes

NAMED = {"body", "joint", "freejoint", "geom", "site", "spatial", "fixed", "general", "mesh", "material"}
OPSETS = range(7, 16)  # Unity Inference Engine manual, "Supported models"


@dataclass(frozen=True)
class Violation:
    """One broken rule.

    Attributes:
        element: where, e.g. `joint unit_01_x`.
        rule: name of the rule, e.g. `polynomial`.
        detail: what is there, and what the importer would make of it.
    """

    element: str
    rule: str
    detail: str

    def __str__(self) -> str:
        return f"{self.element}: {self.rule}: {self.detail}"


def save_as_mujoco(xml: str) -> tuple[str, list[str]]:
    """The file that libmujoco saves after loading `xml`, and the warnings of its compiler.

    Raises:
        InputError: if MuJoCo does not load it.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            spec = mujoco.MjSpec.from_string(xml)
            spec.compile()
            saved = spec.to_xml()
        except ValueError as error:
            raise InputError(f"MJCF for Unity: found {error}, expected a model that MuJoCo loads") from error
    return saved, sorted({str(warning.message) for warning in caught})


def lint_mjcf(xml: str) -> list[Violation]:
    """Check a model, MJCF text that names no other file, against every rule."""
    saved, complaints = save_as_mujoco(xml)
    root = ET.fromstring(saved)
    violations = [
        Violation("compiler", "warning", text) for text in complaints
    ]  # LoadModelFromFile throws on them
    violations += _unknown_elements(root)
    violations += _names(root)
    for world in root.iterfind("worldbody"):
        violations += _inertials(world, moving=False)
    for element in root.iter():
        violations += _attributes(element)
        violations += _values(element)
    violations += _axes(root)
    violations += [Violation(_label(mesh), "mesh", "vertices in the MJCF, expected none") for mesh in root.iter("mesh")]
    return violations


def lint_network(opset: int, external_data: bool) -> list[Violation]:
    """Check a network against what Unity's inference engine reads."""
    violations = []
    if opset not in OPSETS:
        violations.append(Violation("ik.onnx", "opset", f"{opset}, expected {OPSETS[0]} to {OPSETS[-1]}"))
    if external_data:
        violations.append(Violation("ik.onnx", "external data", "weights in another file"))
    return violations


def _label(element: ET.Element) -> str:
    return f"{element.tag} {element.get('name', '(unnamed)')}"


def _unknown_elements(root: ET.Element) -> Iterator[Violation]:
    pending = []
    for section in root:
        if section.tag in ELEMENTS:
            pending.append(section)
        else:
            yield Violation(section.tag, "element", "a section that the importer skips")
    while pending:
        parent = pending.pop()
        imported = ELEMENTS.get(parent.tag)
        for child in parent if imported is not None else ():
            if child.tag not in imported:
                yield Violation(_label(child), "element", f"<{child.tag}> in {_label(parent)} is skipped")
            elif child.tag in ("body", "spatial", "fixed"):
                pending.append(child)


def _names(root: ET.Element) -> Iterator[Violation]:
    first_uses: dict[str, str] = {}
    for section in root:
        if section.tag == "default":
            continue
        for element in section.iter():
            wrapped = section.tag == "tendon" and element.tag not in ("spatial", "fixed")
            if element.tag not in NAMED or wrapped:
                continue
            name = element.get("name")
            if not name:
                yield Violation(_label(element), "name", "no name")
                continue
            sanitized = name.replace("/", "_")  # MjEngineTool.Sanitize, in the names of assets
            if sanitized in first_uses:
                yield Violation(_label(element), "unique name", f"{first_uses[sanitized]} has that name too")
            first_uses[sanitized] = _label(element)


def _inertials(body: ET.Element, moving: bool) -> Iterator[Violation]:
    moving = moving or any(child.tag in ("joint", "freejoint") for child in body)
    if moving and body.find("inertial") is None:
        yield Violation(_label(body), "inertial", "mass from geoms, expected an <inertial>")
    for child in body.iterfind("body"):
        yield from _inertials(child, moving)


def _attributes(element: ET.Element) -> Iterator[Violation]:
    imported = imported_attributes(element)
    if imported is None:
        return
    for name, value in element.attrib.items():
        if name not in imported:
            yield Violation(_label(element), "attribute", f'{name}="{value}" is not imported')


def _values(element: ET.Element) -> Iterator[Violation]:
    for name in ("stiffness", "damping", "springlength"):
        value = element.get(name, "")
        if len(value.split()) > 1:
            rule = "springlength" if name == "springlength" else "polynomial"
            yield Violation(_label(element), rule, f'{name}="{value}", the importer reads one number')
    if float(element.get("ref", 0)) != 0:
        yield Violation(_label(element), "ref", f'ref="{element.get("ref")}", expected 0')
    for (tag, name), choices in CHOICES.items():
        if element.tag == tag and element.get(name) not in choices | {None}:
            yield Violation(
                _label(element), name, f"{element.get(name)}, known are {', '.join(sorted(choices))}"
            )
    if (
        element.tag == "general"
        and element.get("biastype") == "affine"
        and element.get("dyntype") == "filter"
    ):
        yield Violation(_label(element), "filter", "dyntype filter, expected filterexact (a time constant)")


def _axes(root: ET.Element) -> Iterator[Violation]:
    """libmujoco leaves out the default axis, z; before pull request 3546 the importer put x in its place."""
    for joint in root.iterfind("worldbody//joint"):
        if joint.get("axis") is None and joint.get("type", "hinge") in ("hinge", "slide"):
            yield Violation(
                _label(joint), "axis", "0 0 1, left out when saved; turn the body so that it differs"
            )
