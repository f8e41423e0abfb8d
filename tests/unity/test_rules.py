"""Every rule of the Unity importer: the arm keeps it, and a model that breaks it is named."""

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import small_mjcf, small_spec
from trunkline.errors import InputError
from trunkline.unity.pulls import as_pulls
from trunkline.unity.rules import Violation, lint_mjcf, lint_network


def pulls(spec: mujoco.MjSpec) -> str:
    """The arm as the package has it."""
    as_pulls(spec)
    spec.compile()
    return spec.to_xml()


MJCF = pulls(small_spec())


def insert(anchor: str, text: str) -> str:
    assert anchor in MJCF
    return MJCF.replace(anchor, text + anchor, 1)


def spec_with(change) -> str:
    spec = small_spec()
    as_pulls(spec)
    change(spec)
    spec.compile()
    return spec.to_xml()


def test_the_arm_keeps_every_rule():
    assert lint_mjcf(MJCF) == []


def polynomial_joint(spec):
    spec.joint("unit_02_x").stiffness = [1, 0, 2]


def polynomial_damping(spec):
    spec.joint("unit_03_y").damping = [1, 2, 0]


def polynomial_tendon(spec):
    spec.tendon("tendon_2").stiffness = [1, 0, 3]


def two_spring_lengths(spec):
    spec.tendon("tendon_2").springlength = [0.1, 0.5]


def reference(spec):
    spec.joint("unit_04_x").ref = 0.1


def discrete(spec):
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE


def keyframe(spec):
    spec.compile()
    spec.add_key(name="bent", qpos=np.zeros(16))


def shared_name(spec):
    spec.body("unit_01").add_site(name="tendon_1")


def no_name(spec):
    spec.body("unit_05").add_site(pos=[0, 0, 0.01])


def mass_of_geom(spec):
    body = spec.body("unit_08").add_body(name="gripper")
    body.add_joint(name="finger", axis=[1, 0, 0])
    body.add_geom(name="finger_geom", size=[0.01, 0, 0], mass=0.01)


def axis_z(spec):
    spec.joint("unit_06_x").axis = [0, 0, 1]


def plain_filter(spec):
    spec.actuator("tendon_1_position").dyntype = mujoco.mjtDyn.mjDYN_FILTER


def activation_limit(spec):
    actuator = spec.actuator("tendon_1_position")
    actuator.actlimited, actuator.actrange = True, [0, 1]


def gravity_compensation(spec):
    spec.body("unit_02").gravcomp = 0.5


def contact_pair(spec):
    spec.add_pair(name="touch", geomname1="unit_01_geom", geomname2="unit_08_geom")


def dropped_flag(spec):
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)


SPEC_CASES = {
    polynomial_joint: ("joint unit_02_x", "polynomial"),
    polynomial_damping: ("joint unit_03_y", "polynomial"),
    polynomial_tendon: ("spatial tendon_2", "polynomial"),
    two_spring_lengths: ("spatial tendon_2", "springlength"),
    reference: ("joint unit_04_x", "ref"),
    discrete: ("option (unnamed)", "integrator"),
    keyframe: ("keyframe", "element"),
    shared_name: ("spatial tendon_1", "unique name"),
    no_name: ("site (unnamed)", "name"),
    mass_of_geom: ("body gripper", "inertial"),
    axis_z: ("joint unit_06_x", "axis"),
    plain_filter: ("general tendon_1_position", "filter"),
    activation_limit: ("general tendon_1_position", "attribute"),
    gravity_compensation: ("body unit_02", "attribute"),
    contact_pair: ("pair touch", "element"),
    dropped_flag: ("flag (unnamed)", "attribute"),
}


@pytest.mark.parametrize("change", SPEC_CASES, ids=lambda change: change.__name__)
def test_a_broken_rule_is_named(change):
    broken = {(violation.element, violation.rule) for violation in lint_mjcf(spec_with(change))}
    assert broken == {SPEC_CASES[change]}


TEXT_CASES = {
    "frame": (insert('<body name="base">', '<frame name="mount"/>'), ("frame mount", "element")),
    "pulley": (
        insert('<site site="unit_02_tendon_1"/>', '<pulley divisor="2"/>'),
        ("pulley (unnamed)", "element"),
    ),
    "plugin": (
        insert("<worldbody>", '<extension><plugin plugin="mujoco.pid"/></extension>'),
        ("extension", "element"),
    ),
    "mesh in the text": (
        insert("<worldbody>", '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'),
        ("mesh m", "mesh"),
    ),
    "a control that older libraries do not know": (small_mjcf(), ("general tendon_1_position", "attribute")),
    "compile warning": (
        MJCF.replace("<compiler ", '<compiler settotalmass="3" ', 1),
        ("compiler", "warning"),
    ),
}


@pytest.mark.parametrize("case", TEXT_CASES)
def test_an_unsupported_element_is_named(case):
    text, expected = TEXT_CASES[case]
    assert expected in [(violation.element, violation.rule) for violation in lint_mjcf(text)]


def test_a_file_that_does_not_load_is_one_line():
    with pytest.raises(InputError, match="expected a model that MuJoCo loads"):
        lint_mjcf(MJCF.replace('tendon="tendon_1"', 'tendon="tendon_9"', 1))


@pytest.mark.parametrize(
    ("opset", "external", "rules"), [(15, False, []), (18, False, ["opset"]), (15, True, ["external data"])]
)
def test_network_rules(opset, external, rules):
    assert [violation.rule for violation in lint_network(opset, external)] == rules


def test_a_violation_reads_as_one_line():
    assert str(Violation("joint a", "ref", "0.1")) == "joint a: ref: 0.1"
