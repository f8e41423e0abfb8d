"""Cables that rub on their holes, against the capstan equation."""

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import hinges_about, small_spec
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm_model import CAPSTAN_FRICTION, ArmModel
from trunkline.model.simulation.capstan import capstan_friction_of
from trunkline.model.simulation.drive import drive
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain

UNITS, FRICTION, BEND = 16, 0.3, 0.12
STEPS = 9  # of 1 ms: the last one is the first with limits that know which way the cables slide
GRAVITY = np.array([0.0, 0.0, -9.81])


def rubbing_arm(stretches: int = 8, friction: float = FRICTION) -> mujoco.MjModel:
    spec = small_spec(UNITS)
    for cable in spec.tendons:
        cable.frictionloss = 0.0
    add_holes(spec, GuideHoles(friction, stretches))
    return spec.compile()


def shares(speed: float, stretches: int) -> np.ndarray:
    """Moment of cable 1 about each unit's joint over what it were without friction, in an arm so heavy that it goes on
    to bend with `speed`, rad/s of every unit, while the motor pulls with a constant force. Shape (UNITS,)."""
    model = rubbing_arm(stretches)
    model.dof_armature[:], model.opt.gravity[:], model.opt.timestep = 1e6, 0, 0.001
    mujoco.mj_setConst(model, mujoco.MjData(model))
    batch = batch_of(model, 1)
    about_y = hinges_about(model, 1)
    batch.bind("qpos")[0, about_y], batch.bind("qvel")[0, about_y] = -BEND, -speed
    controls = np.tile(model.tendon_length0[ArmModel(model).cables] + 0.3, (1, STEPS, 1))
    controls[:, :, 0] = 0.0
    hold(batch, model, controls[:, 0])
    pulled, friction = batch.bind("qfrc_actuator")[0], batch.bind("qfrc_constraint")[0]
    move(batch, controls, ())
    return 1 + friction[about_y] / pulled[about_y]


@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_tension_falls_as_the_capstan_equation_says(speed):
    result = shares(speed, 8)
    bend = BEND + speed * 0.001 * (STEPS - 1)
    turned = bend * (np.arange(UNITS) + 0.5)  # at the holes up to the chord across each unit's joint
    np.testing.assert_allclose(result, np.exp(-np.sign(speed) * FRICTION * turned), rtol=0.03)


def test_friction_taken_together_bends_as_much():
    np.testing.assert_allclose(shares(0.5, 4).mean(), shares(0.5, 8).mean(), rtol=0.04)


def test_friction_acts_where_the_cable_does():
    """In a bent arm at rest, the last unit's arms of every stretch's friction are those of the cable itself."""
    model = rubbing_arm(4)
    controls = np.tile(model.tendon_length0[ArmModel(model).cables] - [0.05, 0, 0], (1, 1600, 1))
    batch = batch_of(model, 1)
    hold(batch, model, controls[:, 0])
    slope = batch.bind("ten_J")
    move(batch, controls, ())
    arm = ArmModel(model)
    last = model.tendon_adr[arm.guide_holes] + model.tendon_num[arm.guide_holes] - 2  # of the hinge y
    for cable, entries in zip(arm.cables, last, strict=True):
        row = model.ten_J_rowadr[cable] + model.ten_J_rownnz[cable] - 2
        assert abs(model.wrap_prm[entries[0]] / slope[0, row] - 1) > 0.02, "or the arm is straight"
        np.testing.assert_allclose(batch.expand("wrap_prm")[0, entries], slope[0, row], rtol=1e-3)


def test_a_cable_without_tension_does_not_rub():
    model = rubbing_arm()
    batch = batch_of(model, 1)
    batch.bind("qvel")[:] = 1.0
    controls = np.tile(model.tendon_length0[ArmModel(model).cables] + 0.3, (1, 40, 1))
    hold(batch, model, controls[:, 0])
    move(batch, controls, ())
    assert (batch.expand("tendon_frictionloss") == 0).all()


def test_without_friction_holes_change_nothing():
    plain, smooth = rubbing_arm(0), rubbing_arm(4, 0.0)
    slid = rubbing_arm(4)
    ArmModel(slid).switch_off(CAPSTAN_FRICTION)
    controls = np.tile(plain.tendon_length0[:3], (2, 200, 1))
    controls[1, :, 0] -= 0.03
    moved = [move(batch_of(model, 2), controls, ("qpos",))["qpos"] for model in (plain, smooth, slid, rubbing_arm(4))]
    np.testing.assert_allclose(moved[1], moved[0], atol=1e-9)
    np.testing.assert_allclose(moved[2], moved[0], atol=1e-9)
    assert np.abs(moved[3] - moved[0])[1].max() > 1e-4


@pytest.mark.filterwarnings("error")
def test_a_simulation_that_diverges_leaves_the_limits_of_others_as_they_are():
    model, limits = rubbing_arm(), []
    for bend, speed in ((0.1, 1.0), (1e5, 1.0), (1e5, -1.0)):
        batch = batch_of(model, 2)
        batch.bind("qpos")[:, 1::2], batch.bind("qvel")[:, 1::2] = [[0.1], [bend]], [[1.0], [speed]]
        hold(batch, model, np.tile(model.tendon_length0[ArmModel(model).cables] - 0.01, (2, 1)))
        friction = capstan_friction_of(batch)
        friction.begin(np.arange(2))
        friction.refresh(np.arange(2))
        limits.append(batch.expand("tendon_frictionloss").copy())
    assert limits[0].any()
    np.testing.assert_array_equal([both[0] for both in limits], np.tile(limits[0][0], (3, 1)))
    assert not all(np.isfinite(both).all() for both in limits), "one of the two overflows"


def test_rest_is_the_middle_of_what_friction_holds():
    plain, rubbing = rubbing_arm(0), rubbing_arm(4)
    commands = plain.tendon_length0 - [[0.05, -0.3, -0.3]]
    rests = [settle(model, commands, GRAVITY) for model in (plain, rubbing)]
    np.testing.assert_allclose(rests[1].position, rests[0].position, atol=1e-8)
    chain = read_chain(rubbing)
    assert chain.capstan == FRICTION
    for expected, actual in zip(read_chain(plain), chain._replace(capstan=0.0), strict=True):
        np.testing.assert_array_equal(expected, actual)
    middle = rests[0].position[0]
    rubbing.dof_damping *= 20  # led so slowly, it does not swing
    way_in = np.tile(commands, (200, 1)) + np.linspace(0.05, 0, 200)[:, None] * [1, 0, 0]
    way_out = np.tile(commands, (200, 1)) - np.linspace(0.02, 0, 200)[:, None] * [1, 0, 0]
    ends = [drive(rubbing, way[None], GRAVITY, 8.0).end[0] - middle for way in (way_in, way_out)]
    assert ends[0] @ ends[1] < -0.5 * np.linalg.norm(ends[0]) * np.linalg.norm(ends[1])
    free = drive(rubbing, way_in[None], GRAVITY, 8.0, friction=False).end[0]
    assert np.linalg.norm(free - middle) < 0.02 * np.linalg.norm(ends[0])


def test_candidates_of_a_batch_rub_each_with_its_own_coefficient():
    model = rubbing_arm(4)
    controls = np.tile(model.tendon_length0[:3], (2, 200, 1))
    controls[:, :, 0] -= 0.03
    fields = candidate_fields(model, {"capstan_friction": np.array([0.1, 0.4])})
    batch = batch_of(model, 2)
    for name, values in fields.items():
        batch.expand(name)[:] = values
    both = move(batch, controls, ("qpos",))["qpos"]
    for row, friction in enumerate((0.1, 0.4)):
        alone = move(batch_of(rubbing_arm(4, friction), 1), controls[:1], ("qpos",))["qpos"][0]
        np.testing.assert_allclose(both[row], alone, atol=1e-12)
