"""Parameters: what is written is what is read, and the physics that it stands for follows."""

import re
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from tests.support.bent_chain import HINGES, cantilever
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.identification.fit.setup import check_parameters
from trunkline.identification.parameters.parameter import Parameter
from trunkline.identification.parameters.parameters import (
    PARAMETERS,
    candidate_fields,
    in_writing_order,
    names_of,
    parameter_name,
    parameter_named,
    parameters_of,
    set_fields,
)
from trunkline.identification.parameters.saving import save_model
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement, add_elements
from trunkline.model.arm_model import AXIAL_STIFFNESS, PRELOAD, SECTIONS, WINDING, ArmModel

VALUES = {
    "joint_place": 0.3,
    "stiffness": 2.5, "hardening": 0.7, "joint_friction": 0.01, "damping": 0.02, "tendon_friction": 0.8,
    "friction_time": 0.03, "kp": 1500.0, "kp_ratio_2": 1.3, "kp_ratio_3": 0.8, "kv": 60.0, "force_range": 45.0,
    "time_constant": 0.08, "capstan_friction": 0.25,
    "relaxation": 0.5, "relaxation_time": 0.7, "relaxation_2": 0.1, "relaxation_time_2": 3.0,
    "relaxation_3": 0.2, "relaxation_time_3": 8.0, "hysteresis": 0.4, "yield_bend": 0.01,
    "hysteresis_2": 0.15, "yield_bend_2": 0.06, "hysteresis_3": 0.08, "yield_bend_3": 0.2,
    "rest_bend_x": 0.01, "rest_bend_y": -0.02, "rest_gradient_x": -0.01, "rest_gradient_y": 0.03,
    "dead_time": 0.04, "rate_limit": 0.3, "backlash": 0.002,
    "mount_tilt_x": 0.03, "mount_tilt_y": -0.02, "mount_twist": 0.05,
    "winding": 1.2, "tendon_distance": 0.03, "section_stiffness_2": 0.7, "mass": 0.9,
    "tendon_taper": 0.6, "axial_stiffness": 150.0,
    "preload_1": 0.003, "preload_2": -0.002, "preload_3": 0.001,
    "tendon_angle_1": 0.1, "tendon_angle_2": 2.0, "tendon_angle_3": -2.2,
}  # fmt: skip


SLIDERS = [JenkinsElement(0.2, 0.02), JenkinsElement(0.1, 0.05), JenkinsElement(0.05, 0.1)]
ELEMENTS = Joints([MaxwellElement(0.3, 0.5), MaxwellElement(0.2, 2.0), MaxwellElement(0.1, 5.0)], SLIDERS)


def full_spec() -> mujoco.MjSpec:
    """A small arm that has every part that a parameter may belong to."""
    return with_parts(small_spec(dead_time=0.02, rate_limit=0.1, backlash=0.001), [3, 5])


def with_parts(spec: mujoco.MjSpec, sections: list[int]) -> mujoco.MjSpec:
    """The arm with all but its motors' parts; sections: units of each."""
    add_elements(spec, ELEMENTS, 1e-5)
    add_holes(spec, GuideHoles(0.1, 2))
    numbers = {WINDING: [1.0], PRELOAD: [0.0, 0.001, 0.0], SECTIONS: sections}
    numbers[AXIAL_STIFFNESS] = np.linspace(90, 30, sum(sections))
    for number, values in numbers.items():
        spec.add_numeric(name=number, data=values, size=len(values))
    return spec


X, Y = HINGES


def start_model() -> mujoco.MjModel:
    return full_spec().compile()


def model_with(values: dict[str, float], factors=None, model: mujoco.MjModel | None = None) -> mujoco.MjModel:
    model = model or start_model()
    set_fields(model, candidate_fields(model, {k: np.array([v]) for k, v in values.items()}, factors))
    return model


OWN = list(parameters_of(start_model()))


def test_every_parameter_has_a_case():
    assert set(VALUES) == set(OWN)


@pytest.mark.parametrize("name", VALUES)
def test_what_is_written_is_read(name):
    model = model_with({name: VALUES[name]})
    assert parameter_named(name).read(model) == pytest.approx(VALUES[name])
    others = set(VALUES) - {name} - ({"joint_friction"} if name == "stiffness" else set())
    start = start_model()
    for other in others:  # nothing else moves
        assert parameter_named(other).read(model) == pytest.approx(parameter_named(other).read(start)), other


@pytest.mark.parametrize("hinges", [(X, Y), (Y, X), (("x", (-1, 0, 0)), Y)])
@pytest.mark.parametrize("about", ["x", "y"])
def test_an_arm_is_bent_about_an_axis_however_it_is_drawn(hinges, about):
    bent = {}
    for drawn in ((X, Y), hinges):
        model = model_with({f"rest_bend_{about}": 0.1}, model=cantilever(5, 1.0, 0.1, hinges=drawn))
        data = mujoco.MjData(model)
        data.qpos[:] = model.qpos_spring
        mujoco.mj_forward(model, data)
        bent[drawn] = data.site("tip").xpos.copy()
    np.testing.assert_allclose(bent[hinges], bent[(X, Y)], atol=1e-12)
    assert abs(bent[hinges]["xy".index(about) - 1]) > 0.05


def test_all_at_once_in_any_order():
    model = model_with(dict(reversed(VALUES.items())))
    for name, value in VALUES.items():
        assert parameter_named(name).read(model) == pytest.approx(value), name


def test_scaling_keeps_the_arm_s_proportions():
    start, model = start_model(), model_with({"stiffness": 2.5, "damping": 0.02})
    arm, stiffer = slice(ArmModel(start).hinge_count), 2.5 / start.jnt_stiffness[0]
    np.testing.assert_allclose(model.jnt_stiffness[arm] / start.jnt_stiffness[arm], stiffer)
    np.testing.assert_allclose(model.dof_damping[arm] / start.dof_damping[arm], 0.02 / start.dof_damping[0])
    for part in ArmModel(start).branches:  # branches are as stiff beside their springs as before, and as slow
        np.testing.assert_allclose(model.tendon_stiffness[part.tendon] / start.tendon_stiffness[part.tendon], stiffer)
        np.testing.assert_allclose(model.dof_damping[part.branch] / start.dof_damping[part.branch], stiffer)


@pytest.mark.parametrize(("place", "error"), [(0.0, 3 / 2 / 20 + 1 / 2 / 20**2), (0.5, -1 / 4 / 20**2)])
def test_an_arm_that_bends_in_the_middle_of_its_units_is_nearer_to_a_rod(place, error):
    """Sag of a cantilever under a small force F at its end, against F L³ / (3 E I) of a rod; K = E I n / L."""
    units, stiffness, length, force = 20, 5.0, 0.4, 0.01
    model = model_with({"joint_place": place}, model=cantilever(units, stiffness, length / units))
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0
    tip = model.site("tip")
    mujoco.mj_forward(model, data)
    jacobian = np.empty((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, tip.id)
    sag = force * np.sum(jacobian[0] ** 2 / model.jnt_stiffness)
    assert sag / (force * length**3 / (3 * stiffness * length / units)) == pytest.approx(1 + error, rel=1e-9)


# Two units as a lab may draw them: a flange, upside down, between them, a cap with the tip, hinges beside the line
DRAWN = """<mujoco><compiler angle="degree"/><worldbody><body name="base"><site name="base_center"/>
  <body name="upper" pos="0 0 -0.01" euler="0 90 0">
    <joint name="upper_x" axis="1 0 0" pos="0 0.01 0"/><joint name="upper_y" axis="0 1 0" pos="0 0.01 0"/>
    <geom size="0.01"/>
    <body name="flange" pos="0.04 0 0" euler="0 180 0">
      <body name="lower" pos="-0.02 0 0" euler="0 90 0">
        <joint name="lower_x" axis="1 0 0" pos="0.01 0 0.02"/><joint name="lower_y" axis="0 1 0" pos="0.01 0 0.02"/>
        <geom size="0.01"/>
        <body name="cap" pos="0 0 -0.03"><site name="tip" pos="0 0 -0.01"/></body>
      </body>
    </body>
  </body>
</body></worldbody></mujoco>"""


def test_hinges_of_a_drawn_arm_move_along_their_units_and_no_other_way():
    spec = mujoco.MjSpec.from_string(DRAWN)
    model = spec.compile()
    assert PARAMETERS["joint_place"].read(model) == pytest.approx(0.0)
    straight = mujoco.MjData(model)
    mujoco.mj_kinematics(model, straight)
    set_fields(model, candidate_fields(model, {"joint_place": np.array([0.25])}))
    expected = np.repeat([[0.015, 0.01, 0.0], [0.01, 0.0, -0.01]], 2, axis=0)  # a quarter of 60 mm, and of 40 mm
    np.testing.assert_allclose(model.jnt_pos, expected, atol=1e-12)
    again = mujoco.MjModel.from_xml_string(save_model(spec, model))
    np.testing.assert_allclose(again.jnt_pos, expected, atol=1e-6)
    moved = mujoco.MjData(again)
    mujoco.mj_kinematics(again, moved)
    np.testing.assert_allclose(moved.site("tip").xpos, straight.site("tip").xpos, atol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"lower" pos="-0.02', '"lower" pos="0.04', "body 'upper': found body 'lower' in its origin, expected that"),
        ('"0 0 -0.01"/></body>', '"0 0 0.03"/></body>', "body 'lower': found site 'tip' in its origin, expected that"),
        ('(?s)base_center"/>(.*)"tip"', r'base_center"/><site name="tip"/>\1"end"', "'lower': found site 'tip' to"),
    ],
)
def test_units_without_a_line_have_no_joint_place(old, new, message):
    changed, count = re.subn(old, new, DRAWN)
    assert count == 1
    config = SimpleNamespace(parameters=["joint_place"])
    with pytest.raises(InputError, match=f"params.yaml: identify_stiffness.parameters.joint_place: model: .*{message}"):
        check_parameters("identify_stiffness", config, mujoco.MjModel.from_xml_string(changed))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("yield_bend_2", "joints without slider 2, expected build_mjcf.joints with one"),
        ("capstan_friction", "cables that do not rub, expected build_mjcf.holes: rubbing"),
        ("dead_time", "motors without, expected build_mjcf.actuation.dead_time of more than 0"),
        ("rate_limit", "winches without, expected build_mjcf.actuation.rate_limit of more than 0"),
        ("backlash", "winches without, expected build_mjcf.actuation.backlash of more than 0"),
        ("winding", "evenly spread tendons, or motors that are commanded by force, expected tendons that are"),
        ("preload_2", "evenly spread tendons, or motors that are commanded by force, expected tendons that are"),
        ("preload_*", "evenly spread tendons, or motors that are commanded by force, expected tendons that are"),
        ("tendon_angle_4", "an arm without tendon 4, expected one for each .*, did you mean 'tendon_angle_3'"),
        ("section_stiffness_*", "an arm without section 2, expected build_mjcf.arm of the kind sections"),
    ],
)
def test_a_parameter_of_what_the_arm_lacks_is_refused(name, message):
    config = SimpleNamespace(parameters=[name])
    with pytest.raises(InputError, match=f"identify_control.parameters.{re.escape(name)}: found it for {message}"):
        check_parameters("identify_control", config, small_spec().compile())


@pytest.mark.parametrize("name", ["stifness", "section_stiffness_1", "preload_01", "preload", "mass_*", ""])
def test_what_is_no_parameter_of_any_arm_is_refused(name):
    with pytest.raises(ValueError, match=f"found '{re.escape(name)}', expected the name of a parameter"):
        parameter_name(name)


@pytest.mark.parametrize("name", ["stiffness", "section_stiffness_2", "preload_*", "tendon_angle_40"])
def test_an_arm_may_have_any_number_of_tendons(name):
    assert parameter_name(name) == name


def test_parameters_are_written_in_one_order():
    names = ["tendon_angle_10", "tendon_angle_2", "mass", "kp_ratio_2", "section_stiffness_2", "hardening", "stiffness"]
    order = "stiffness hardening kp_ratio_2 mass tendon_angle_2 tendon_angle_10 section_stiffness_2"
    assert " ".join(in_writing_order(names)) == order


def test_a_ratio_of_a_motor_that_the_arm_lacks_is_refused():
    config = SimpleNamespace(parameters=["kp_ratio_3"])
    with pytest.raises(InputError, match="kp_ratio_3: found it for an arm without motor 3"):
        check_parameters("identify_control", config, cantilever(2, 1.0, 0.1))


def test_one_name_stands_for_all_tendons():
    model = start_model()
    assert names_of("preload_*", model) == ["preload_1", "preload_2", "preload_3"]
    assert names_of("section_stiffness_*", model) == ["section_stiffness_2"]
    assert names_of("kp", model) == ["kp"]


def test_a_tendon_s_angle_turns_all_of_its_holes_and_keeps_their_distances():
    start, model = start_model(), model_with({"tendon_angle_2": 1.0})
    for index in range(start.nsite):
        old, new, name = start.site_pos[index], model.site_pos[index], start.site(index).name
        if name.endswith("_tendon_2"):
            assert np.arctan2(new[1], new[0]) == pytest.approx(1.0)
            assert np.hypot(*new[:2]) == pytest.approx(np.hypot(*old[:2]))
            assert new[2] == old[2]
        else:
            assert (new == old).all()


def test_the_tendons_distance_keeps_the_taper():
    start, model = start_model(), model_with({"tendon_distance": 0.02})
    holes = [index for index in range(start.nsite) if "_tendon_" in start.site(index).name]
    scales = np.hypot(*model.site_pos[holes, :2].T) / np.hypot(*start.site_pos[holes, :2].T)
    np.testing.assert_allclose(scales, scales[0])
    assert np.hypot(*model.site("base_tendon_1").pos[:2]) == pytest.approx(0.02)


def test_the_tendons_taper_keeps_the_mount_and_changes_evenly():
    start, model = start_model(), model_with({"tendon_taper": 0.6})
    for sites in (ArmModel(start).cable_sites(cable) for cable in ArmModel(start).cables):
        before, after = (np.hypot(*each.site_pos[sites, :2].T) for each in (start, model))
        steps = np.diff(after - before)
        np.testing.assert_allclose(steps, steps[0], atol=1e-12)
        assert after[[0, -1]] == pytest.approx([before[0], 0.6 * before[0]])


def test_axial_stiffness_keeps_its_ratios():
    model = model_with({"axial_stiffness": 150.0})
    np.testing.assert_allclose(ArmModel(model).axial_stiffness, 150 / 90 * ArmModel(start_model()).axial_stiffness)


def test_a_section_s_stiffness_leaves_the_others():
    model = model_with({"section_stiffness_2": 0.5})
    changed = model.jnt_stiffness[:16] / start_model().jnt_stiffness[:16]
    np.testing.assert_allclose(changed[:6], 1.0)
    np.testing.assert_allclose(changed[6:], changed[6])
    assert model.jnt_stiffness[6] / model.jnt_stiffness[0] == pytest.approx(0.5)


# Two units and a load, as a lab may draw them: masses by geoms, and of all together 0.3 kg
WEIGHED = """<mujoco><compiler settotalmass="0.3" inertiafromgeom="true"/><worldbody><body name="base">
  <body name="upper" pos="0 0 -0.01"><joint name="upper_x" axis="1 0 0"/><joint name="upper_y" axis="0 1 0"/>
    <geom size="0.01" pos="0.002 0 -0.03"/>
    <body name="collar" pos="0 0 -0.04"><geom type="box" size="0.01 0.02 0.005" euler="10 20 30"/></body>
    <body name="lower" pos="0 0 -0.05"><joint name="lower_x" axis="1 0 0"/><joint name="lower_y" axis="0 1 0"/>
      <geom size="0.01"/><site name="tip" pos="0 0 -0.04"/>
      <body name="tip_load" pos="0 0 -0.04"><geom size="0.008"/></body>
    </body>
  </body>
</body></worldbody></mujoco>"""


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
def test_an_arm_s_mass_scales_what_is_its_own_and_no_load():
    spec = mujoco.MjSpec.from_string(WEIGHED)
    start = spec.compile()
    load = start.body("tip_load").mass[0]
    assert PARAMETERS["mass"].read(start) == pytest.approx(0.3 - load)
    model = model_with({"mass": 2 * (0.3 - load)}, model=spec.compile())
    expected = np.array([0, 0, 2, 2, 2, 1.0])  # world, base, upper, collar, lower, load
    again = mujoco.MjModel.from_xml_string(save_model(spec, model))
    for made in (model, again):
        np.testing.assert_allclose(made.body_mass, expected * start.body_mass, rtol=1e-5)
        np.testing.assert_allclose(made.body_inertia, expected[:, None] * start.body_inertia, rtol=1e-5)
        for name in ("body_ipos", "body_iquat"):
            np.testing.assert_allclose(getattr(made, name), getattr(start, name), atol=1e-6)
        for name in ("dof_invweight0", "body_subtreemass"):  # what MuJoCo makes of masses as it compiles
            np.testing.assert_allclose(getattr(made, name), getattr(again, name), rtol=1e-4, err_msg=name)


def test_candidates_do_not_mix():
    model = small_spec().compile()
    fields = candidate_fields(model, {"kp": np.array([100.0, 200.0, 300.0])})
    assert fields["actuator_gainprm"].shape == (3, *model.actuator_gainprm.shape)
    for candidate, kp in enumerate((100.0, 200.0, 300.0)):
        set_fields(model, fields, candidate)
        assert PARAMETERS["kp"].read(model) == kp
        assert (model.actuator_biasprm[:, 1] == -kp).all()


def test_a_gain_that_is_identified_again_leaves_the_ratios_of_unequal_tendons():
    model = model_with({"kp_ratio_2": 1.3})
    first = PARAMETERS["kp"].read(model)
    model = model_with({"kp": 2 * first}, model=model)
    assert model.actuator_gainprm[:3, 0] == pytest.approx(2 * first * np.array([1, 1.3, 1]))
    assert (model.actuator_biasprm[:, 1] == -model.actuator_gainprm[:, 0]).all()


def test_a_unit_s_factor_is_shared_by_its_two_hinges():
    start = start_model()
    factors = np.linspace(0.9, 1.1, 8)
    model = model_with({}, {"stiffness": factors[None]})
    np.testing.assert_allclose(model.jnt_stiffness[:16] / start.jnt_stiffness[:16], np.repeat(factors, 2))
    for element in ArmModel(start).branches:
        grown = model.tendon_stiffness[element.tendon] / start.tendon_stiffness[element.tendon]
        np.testing.assert_allclose(grown, np.repeat(factors, 2))
    assert ArmModel(model).unit_of_hinge.tolist() == [index // 2 for index in range(16)]


def test_hardening_makes_the_torque_k_times_q_plus_h_q_cubed():
    model = model_with({"stiffness": 3.0, "hardening": 0.7, "damping": 0.0}, model=small_spec().compile())
    data = mujoco.MjData(model)
    data.qpos[0] = -0.4
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[0] == pytest.approx(3.0 * (0.4 + 0.7 * 0.4**3))


def test_a_longer_friction_time_lets_a_hook_creep_straight_sooner():
    """Friction that holds any hook is regularised: a stuck tendon creeps, the faster the longer its time constant."""
    left = []  # share of the hook, after some time
    for friction_time in (0.01, 0.03, 0.1):
        values = {"tendon_friction": 5.0, "friction_time": friction_time, "damping": 0.05}
        model = model_with(values, model=small_spec().compile())
        model.opt.gravity[:] = 0
        data = mujoco.MjData(model)
        data.qpos[1::2] = 0.1
        data.ctrl[:] = data.act[:] = model.tendon_length0 + 0.3  # motors let the tendons go
        hooks = []  # m of tendon that the bend has taken up
        for steps in (200, 800):
            mujoco.mj_step(model, data, steps)
            hooks.append(np.abs(data.ten_length - model.tendon_length0).max())
        left.append(hooks[1] / hooks[0])
    assert 1 > left[0] > 1.1 * left[1] > 2 * left[2] > 0


@pytest.mark.parametrize("name", OWN)
def test_every_parameter_survives_saving(name):
    """Also one that is declared tomorrow: what it writes has a place in MJCF, alone or beside others."""
    assert_survives(full_spec(), name)


def assert_survives(spec: mujoco.MjSpec, name: str) -> None:
    model = spec.compile()
    value = 1.3 * parameter_named(name).read(model) or 0.02
    set_fields(model, candidate_fields(model, {name: np.array([value])}))
    loaded = mujoco.MjModel.from_xml_string(save_model(spec, model))
    assert parameter_named(name).read(loaded) == pytest.approx(value, rel=1e-5)
    for field in parameter_named(name).fields:
        np.testing.assert_allclose(getattr(loaded, field), getattr(model, field), rtol=1e-5, atol=1e-9)


def test_a_parameter_without_a_place_in_mjcf_is_refused(monkeypatch):
    lost = Parameter("kg/m³", ("opt_density",), lambda model: 0.0, lambda *_: None)
    monkeypatch.setitem(PARAMETERS, "air", lost)
    spec = small_spec()
    with pytest.raises(ValueError, match="opt_density: found no place for it in MJCF"):
        save_model(spec, spec.compile())


def test_a_saved_model_has_the_parameters():
    spec = full_spec()
    model = spec.compile()
    factors = {"stiffness": np.linspace(0.9, 1.1, 8)[None]}
    set_fields(model, candidate_fields(model, {k: np.array([v]) for k, v in VALUES.items()}, factors))
    loaded = mujoco.MjModel.from_xml_string(save_model(spec, model))
    for name in {field for parameter in parameters_of(model).values() for field in parameter.fields}:
        np.testing.assert_allclose(getattr(loaded, name), getattr(model, name), rtol=1e-5, err_msg=name)
