"""Motors that are commanded by force: what the model is, where it rests and how it moves."""

import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.model.arm.test_from_file import TEXT
from tests.model.arm.test_sections import SOLVER, arm
from tests.support.forced_arm import DOWN, FOUR, MOTORS, forced_model, forced_spec, holding_model, rest_of
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.model.arm.from_file import read_arm
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.mjcf import Actuation
from trunkline.model.arm.tendons import Tendon
from trunkline.model.arm.uniform import Uniform
from trunkline.model.arm_model import FORCE_SCALE, ArmModel
from trunkline.model.simulation.drive import drive
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated, equilibrium
from trunkline.model.statics.hysteresis import friction_band
from trunkline.model.statics.restart import actuated_from

PULLS = np.array([[6.0, 0.0, 0.0, 2.0], [0.0, 3.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [1.0, 8.0, 2.0, 0.0]])


def test_its_actuators_pull_with_what_they_are_sent():
    model = forced_model()
    forced = ArmModel(model)
    assert (forced.commands, forced.command_unit) == ("force", "N")
    assert ArmModel(holding_model()).commands == "length"
    assert model.actuator(0).name == "tendon_1_tension"
    np.testing.assert_array_equal(model.actuator_ctrlrange, [[0, 20]] * 4)
    np.testing.assert_array_equal(forced.controls(np.array([1.0, 0, 2, 3])), [1, 0, 2, 3])
    again = mujoco.MjModel.from_xml_string(forced_spec().to_xml())
    for name in ("gainprm", "biasprm", "dynprm", "ctrlrange", "forcerange", "gear", "dyntype"):
        np.testing.assert_allclose(getattr(again, f"actuator_{name}"), getattr(model, f"actuator_{name}"))


def test_tensions_follow_with_the_motors_lag_and_not_beyond_their_range():
    model = forced_model(time_constant=0.05)
    data = mujoco.MjData(model)
    data.ctrl[:] = [4.0, -3.0, 50.0, 0.0]
    steps = 30
    mujoco.mj_step(model, data, steps)
    mujoco.mj_forward(model, data)
    risen = 1 - np.exp(-steps * model.opt.timestep / 0.05)
    np.testing.assert_allclose(-data.actuator_force, risen * np.array([4.0, 0.0, 20.0, 0.0]), rtol=1e-6, atol=1e-12)


def straight_chain(units: int = 5, stiffness: float = 2.0) -> mujoco.MjModel:
    """Equal units with one tendon, 8 mm from the axis on the side of +x."""
    uniform = Uniform(
        length=0.2, units=units, damping_ratio=0.1, tendons=[Tendon(0.0, 0.008)], hole_ratio=0.8, tip_load=0.0,
        markers={}, kind="uniform", width=0.03, unit_masses=[0.01], joint_range_deg=60.0, joint_stiffness=stiffness,
    )  # fmt: skip
    return uniform.build(MOTORS, SOLVER, Path()).spec.compile()


def test_a_straight_chain_bends_by_moment_over_stiffness():
    """T r on every hinge about y, θ = T r / k, in the small, towards the tendon."""
    model = straight_chain()
    tension, about_y = 0.05, model.jnt_axis[:, 1] == 1
    bend = tension * 0.008 / 2.0
    rest = actuated(read_chain(model), np.array([[tension]]), np.zeros(3))
    assert rest.converged.all()
    np.testing.assert_allclose(np.abs(rest.qpos[0, about_y]), bend, rtol=5e-4)
    np.testing.assert_allclose(rest.qpos[0, ~about_y], 0, atol=1e-12)
    assert rest.position[0, 0] > 0
    settled = settle(model, np.array([[tension]]), np.zeros(3))
    np.testing.assert_allclose(settled.qpos, rest.qpos, atol=1e-7)


def test_statics_are_where_forces_on_tendons_settle():
    model = forced_model()
    chain = read_chain(model)
    rest = actuated(chain, PULLS, DOWN)
    assert chain.by_force
    assert rest.converged.all()
    np.testing.assert_array_equal(rest.tensions, PULLS)
    np.testing.assert_array_equal(rest.commands, PULLS)
    applied = [rest_of(model, pulls).site("tip").xpos for pulls in PULLS]
    np.testing.assert_allclose(rest.position, applied, atol=2e-6)
    settled = settle(model, PULLS, DOWN)
    assert settled.rested.all()
    np.testing.assert_allclose(settled.position, rest.position, atol=2e-6)
    np.testing.assert_allclose(settled.tensions, PULLS, atol=1e-9)
    np.testing.assert_allclose(actuated_from(chain, rest.qpos + 0.01, PULLS, DOWN).qpos, rest.qpos, atol=1e-7)


def test_motion_comes_to_the_same_rest():
    model = forced_model()
    driven = drive(model, PULLS, DOWN, 4.0, friction=False, calm=True)
    assert driven.rested.all()
    np.testing.assert_allclose(driven.end, actuated(read_chain(model), PULLS, DOWN).position, atol=2e-5)
    slack = drive(model, PULLS[2:3], DOWN, 0.5, friction=False).tips[0, 0]
    np.testing.assert_allclose(slack, actuated(read_chain(model), PULLS[2:3], DOWN).position[0], atol=2e-3)


def test_commands_beyond_the_range_are_cut_off():
    chain = read_chain(forced_model(max_force=5.0))
    beyond, within = np.array([[9.0, -4.0, 0.0, 0.0]]), np.array([[5.0, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(actuated(chain, beyond, DOWN).qpos, actuated(chain, within, DOWN).qpos, atol=1e-9)


def test_friction_adds_to_the_tension_that_is_held():
    """1 N of friction on the one tendon that pulls: as 5 N and as 7 N."""
    chain = read_chain(forced_model())
    pulls = np.array([[6.0, 0.0, 0.0, 0.0]])
    band = friction_band(chain, pulls, DOWN[None], np.array([1.0, 0, 0, 0]), np.zeros((5, 2)))
    for end, tension in ((band.loaded, 5.0), (band.unloaded, 7.0)):
        np.testing.assert_allclose(end, equilibrium(chain, tension / 6 * pulls, DOWN).position, atol=1e-8)


def test_cables_rub_as_under_motors_that_hold_lengths():
    """Tensions at the motors are what capstan friction falls from, however these are commanded."""
    spec, pull = small_spec(6, commands="force", kp=None, kv=0.0), np.array([[2.0, 0.0, 0.0]])
    add_holes(spec, GuideHoles(0.3, 4))
    model = spec.compile()
    model.tendon_frictionloss[ArmModel(model).cables] = 0
    chain = read_chain(model)
    rest, smooth = actuated(chain, pull, DOWN), actuated(chain.smooth, pull, DOWN)
    np.testing.assert_allclose(rest.position, equilibrium(chain, pull, DOWN).position, atol=1e-9)
    assert np.linalg.norm(rest.position - smooth.position) > 0.01
    driven, slid = (drive(model, pull, DOWN, 4.0, friction).end for friction in (True, False))
    assert np.linalg.norm(driven - slid) > 1e-3


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"commands": "length"}, "kp: missing, expected the position gain"),
        ({"commands": "force", "kp": 200.0}, "kp: found 200 beside `commands: force`, expected none"),
        ({"commands": "force", "backlash": 1e-3}, "backlash: found 0.001 beside `commands: force`, expected none"),
        ({"commands": "force", "rate_limit": 0.3}, "rate_limit: found 0.3 beside"),
    ],
)
def test_what_such_motors_have_not_is_named(settings, message):
    with pytest.raises(ValueError, match=message):
        Actuation(**{"friction": 0.0, "max_force": 9.0, "time_constant": 0.02} | settings)


def test_a_pretension_is_refused():
    tight = [*FOUR[:3], replace(FOUR[3], pretension=2.0)]
    with pytest.raises(InputError, match=r"build_mjcf.arm.tendons.3.pretension: found 2 N beside `commands: force`"):
        arm(tendons=tight).build(MOTORS, SOLVER, Path())


def from_file(folder: Path, *actuators: str) -> mujoco.MjModel:
    text = TEXT.replace(' forcerange="-40 0"', "")  # which would hold for motors too
    for name, line in zip("abc", actuators, strict=True):
        text, count = re.subn(rf'<position name="pull_{name}" tendon="{name}"/>', line, text)
        assert count == 1
    (folder / "arm.xml").write_text(text)
    return read_arm(folder / "arm.xml").compile()


PLAIN = '<motor name="pull_{0}" tendon="{0}" gear="-1" ctrlrange="0 30"/>'
MOTORS_OF_FILES = {
    "gear": PLAIN,
    "gain": '<general name="pull_{0}" tendon="{0}" biastype="none" gainprm="-1" ctrlrange="0 30"/>',
    "negative": '<motor name="pull_{0}" tendon="{0}" ctrlrange="-30 0"/>',
    "drum": '<motor name="pull_{0}" tendon="{0}" gear="-50" ctrlrange="0 0.6"/>',
    "force": '<motor name="pull_{0}" tendon="{0}" gear="-1" forcerange="0 30"/>',
}


@pytest.mark.parametrize("line", MOTORS_OF_FILES.values(), ids=MOTORS_OF_FILES)
def test_motors_of_a_file_are_sent_their_tension(tmp_path, line):
    model = from_file(tmp_path, *(line.format(name) for name in "abc"))
    assert ArmModel(model).commands == "force"
    assert ArmModel(model).number(FORCE_SCALE) == 1
    chain = read_chain(model)
    np.testing.assert_allclose(chain.max_tension, 30)
    pull = np.array([[3.0, 0.0, 0.0]])
    np.testing.assert_allclose(settle(model, pull, DOWN).position, actuated(chain, pull, DOWN).position, atol=2e-6)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('<muscle name="pull_{0}" tendon="{0}" ctrlrange="0 1"/>', "actuator 'pull_b': found a muscle, expected"),
        ('<motor name="pull_{0}" tendon="{0}" gear="-1"/>', "'pull_b': found a motor that shortens its tendon by -"),
        ('<motor name="pull_{0}" tendon="{0}" ctrlrange="-3 5"/>', "by -5 to 3 N, expected 0 to F: a ctrlrange or"),
        ('<position name="pull_{0}" tendon="{0}"/>', "'pull_a': found a motor beside 'pull_b', which is none"),
    ],
)
def test_other_actuators_are_refused_by_name(tmp_path, line, message):
    others = [PLAIN.format(name) for name in "ac"]
    with pytest.raises(InputError, match=message) as error:
        from_file(tmp_path, others[0], line.format("b"), others[1])
    assert "\n" not in str(error.value)
