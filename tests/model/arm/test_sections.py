"""Arms of several sections, tendons described one by one, markers beside the axis."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import LIMIT
from trunkline.errors import InputError
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.mjcf import Actuation, Marker, Solver
from trunkline.model.arm.sections import Section, Sections
from trunkline.model.arm.tendons import Tendon
from trunkline.model.arm_model import WINDING, ArmModel

SOLVER = Solver(0.002, 1e-5, *LIMIT, *LIMIT)
ACTUATION = Actuation(friction=0.0, kp=2000.0, max_force=50.0, time_constant=0.02)
TWO = [
    Section(length=0.1, units=2, width=0.03, mass=0.2, bending_stiffness=0.5),
    Section(length=0.06, units=3, width=0.02, mass=0.06, joint_stiffness=4.0),
]
TENDONS = [
    Tendon(0.0, 0.012, end=2),
    Tendon(90.0, (0.012, 0.008)),
    Tendon(-120.0, pretension=3.0),
]


def arm(**changed) -> Sections:
    settings = {
        "kind": "sections", "sections": TWO, "joint_range_deg": 40.0, "damping_ratio": 0.1, "tendons": TENDONS,
        "hole_ratio": 0.8, "tip_load": 0.0, "markers": {"tip": Marker(0.17, (0.005, -0.002))},
    }  # fmt: skip
    return Sections(**settings | changed)


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> mujoco.MjModel:
    return arm().build(ACTUATION, SOLVER, tmp_path_factory.mktemp("models")).spec.compile()


def test_each_section_has_units_of_its_own(model):
    np.testing.assert_allclose(model.body_mass[2:], [0.1, 0.1, 0.02, 0.02, 0.02])
    stiffness = [0.5 / 0.05] * 2 + [4.0] * 3  # EI over the unit's length; as given
    np.testing.assert_allclose(model.jnt_stiffness[:10:2], stiffness)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    heights = [data.body(f"unit_{k:02d}").xpos[2] for k in range(1, 6)]
    np.testing.assert_allclose(heights, [0, -0.05, -0.1, -0.12, -0.14], atol=1e-12)
    assert ArmModel(model).sections.tolist() == [2, 3]


def test_cables_that_end_on_the_way_cannot_rub():
    spec = arm().build(ACTUATION, SOLVER, Path()).spec
    with pytest.raises(InputError, match="build_mjcf.holes: found .* 'tendon_1', which bends 2 of 5 units, expected"):
        add_holes(spec, GuideHoles(0.1, 2))
    whole = arm(tendons=TENDONS[1:]).build(ACTUATION, SOLVER, Path()).spec
    add_holes(whole, GuideHoles(0.1, 2))
    assert ArmModel(whole.compile()).guide_holes.shape == (2, 2)


def test_tendons_run_where_they_are_described(model):
    names = {"tendon_1": 3, "tendon_2": 6, "tendon_3": 6}  # the mount's hole, and one in each unit on the way
    assert {model.tendon(t).name: int(model.tendon_num[t]) for t in ArmModel(model).cables} == names
    np.testing.assert_allclose(model.site("unit_02_tendon_1").pos[:2], [0.012, 0], atol=1e-12)
    np.testing.assert_allclose(model.site("base_tendon_2").pos[:2], [0, 0.012], atol=1e-12)
    np.testing.assert_allclose(model.site("unit_05_tendon_2").pos[:2], [0, 0.008], atol=1e-12)
    along = [model.site(f"unit_{k:02d}_tendon_2").pos[1] for k in range(1, 6)]
    assert (np.diff(along) < 0).all()
    third = 0.8 * 0.02 / 2 * np.array([np.cos(np.radians(-120)), np.sin(np.radians(-120))])
    np.testing.assert_allclose(model.site("unit_04_tendon_3").pos[:2], third, atol=1e-12)


def test_a_tendon_may_start_where_another_section_does():
    """Before that it is in a sheath: no bend of the first section changes its length."""
    tendons = [Tendon(0.0, 0.012, end=2), Tendon(90.0, (0.010, 0.006), start=2)]
    later = arm(tendons=tendons).build(ACTUATION, SOLVER, Path()).spec.compile()
    assert later.tendon_num.tolist() == [3, 4]
    np.testing.assert_allclose(later.site("unit_02_tendon_2").pos[:2], [0, 0.010], atol=1e-12)
    np.testing.assert_allclose(later.site("unit_05_tendon_2").pos[:2], [0, 0.006], atol=1e-12)
    data = mujoco.MjData(later)
    data.qpos[:4] = 0.2
    mujoco.mj_forward(later, data)
    assert abs(data.ten_length[0] - later.tendon_length0[0]) > 1e-3
    assert data.ten_length[1] == pytest.approx(later.tendon_length0[1], abs=1e-12)


def test_pretension_is_told_in_metres_of_cable(model):
    assert ArmModel(model).number(WINDING) == 1.0
    np.testing.assert_allclose(ArmModel(model).preload, [0, 0, 3.0 / 2000.0])


def test_a_marker_may_stick_out_and_sit_aside(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.site("tip_center").xpos, [0.005, -0.002, -0.17], atol=1e-12)
    assert model.body(model.site("tip_center").bodyid[0]).name == "unit_05"


def test_an_arm_may_bring_guesses_of_its_own_motors(tmp_path):
    actuation = Actuation(friction=0.0, kp=500.0, max_force=9.0, time_constant=0.02)
    built = arm(actuation=actuation).build(ACTUATION, SOLVER, tmp_path).spec.compile()
    assert built.actuator_gainprm[0, 0] == 500.0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"tendons": [Tendon(0.0, 0.01, end=6)]}, "tendons.0.end: found 6, expected one of the 5 units"),
        ({"tendons": [Tendon(0.0, 0.01, end=2, start=2)]}, "tendons.0.start: found 2, expected a unit before .* 2, or"),
        ({"tendons": [Tendon(0.0, 0.01, start=5)]}, "tendons.0.start: found 5, expected a unit before .* 5, or"),
        ({"markers": {"tip": 0.17}}, "markers.tip: found 0.17 m, expected at most the length of 0.16 m, or"),
    ],
)
def test_a_mistake_is_named(changed, message):
    with pytest.raises(ValueError, match=message):
        arm(**changed)


def test_a_section_has_one_stiffness():
    with pytest.raises(ValueError, match="found neither, expected either bending_stiffness"):
        Section(length=0.1, units=2, width=0.03, mass=0.2)
