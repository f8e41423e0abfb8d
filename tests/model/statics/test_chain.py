"""Which models the statics take, and how they refuse the others."""

import mujoco
import pytest

from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.model.statics.chain import read_chain
from trunkline.model_files import read_model


def test_spiral_arm_reads_as_it_was_built():
    chain = read_chain(small_spec(8).compile())
    assert (chain.units, chain.tendons) == (8, 3)
    assert chain.length == pytest.approx(0.507)
    assert list(chain.max_tension) == [80, 80, 80]


def test_payload_on_the_tip_counts_as_part_of_the_last_unit():
    spec = small_spec(4)
    gripper = spec.body("unit_04").add_body(name="gripper", pos=[0, 0, -0.1])
    gripper.explicitinertial, gripper.mass, gripper.inertia, gripper.ipos = True, 0.1, [1e-5] * 3, [0, 0, 0]
    plain, loaded = read_chain(small_spec(4).compile()), read_chain(spec.compile())
    assert loaded.mass[-1] == pytest.approx(plain.mass[-1] + 0.1)
    expected = (plain.mass[-1] * plain.center[-1, 2] - 0.1 * 0.1) / loaded.mass[-1]
    assert loaded.center[-1, 2] == pytest.approx(expected)


def add_equality(spec):
    joint = mujoco.mjtObj.mjOBJ_JOINT
    spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1="unit_01_x", name2="unit_01_y", objtype=joint)


def add_slide(spec):
    spec.body("unit_04").add_joint(name="slider", type=mujoco.mjtJoint.mjJNT_SLIDE)


def add_third_hinge(spec):
    spec.body("unit_02").add_joint(name="twist", axis=[0, 0, 1])


def add_branch(spec):
    body = spec.body("unit_02").add_body(name="finger", mass=0.01, inertia=[1e-5] * 3, explicitinertial=True)
    for axis in ([1, 0, 0], [0, 1, 0]):
        body.add_joint(axis=axis)


def stiffen_tendon(spec):
    spec.tendon("tendon_2").stiffness = [5, 0, 0]


def let_motor_push(spec):
    spec.actuator("tendon_1_position").forcerange = [-10, 10]


def touch(spec):
    for name in ("unit_01_geom", "unit_03_geom"):
        spec.geom(name).contype, spec.geom(name).conaffinity = 1, 1


def rename_tip(spec):
    spec.site("tip").name = "end"


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (add_equality, "equality"),
        (add_slide, "slider"),
        (add_third_hinge, "unit_02"),
        (add_branch, "finger"),
        (stiffen_tendon, "tendon_2"),
        (let_motor_push, "tendon_1_position"),
        (touch, "unit_01_geom"),
        (rename_tip, "tip"),
    ],
)
def test_models_with_other_forces_are_refused_by_name(change, named):
    spec = small_spec(4)
    change(spec)
    with pytest.raises(InputError, match=named) as refusal:
        read_chain(spec.compile())
    assert "found" in str(refusal.value) or "may touch" in str(refusal.value)
    assert "expected" in str(refusal.value)


def test_missing_and_broken_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_model(tmp_path / "arm.xml")
    (tmp_path / "arm.xml").write_text("<mujoco><worldbody>")
    with pytest.raises(InputError, match=r"arm\.xml"):
        read_model(tmp_path / "arm.xml")
