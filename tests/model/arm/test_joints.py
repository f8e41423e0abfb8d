"""Branches and sliders against closed forms, and that they change nothing at rest."""

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import small_spec
from trunkline.identification.parameters.parameters import candidate_fields, set_fields
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement, add_elements
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain

ARMATURE = 1e-5
STIFFNESS, SHARE, TIME, YIELD = 2.0, 0.4, 0.5, 0.03


def one_joint(joints: Joints, inertia: float = 1e6, damping: float = 0.0) -> mujoco.MjModel:
    """One hinge; by default so heavy that it stays where it is put."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = 1e-3, [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    body = spec.worldbody.add_body(name="unit_01")
    body.explicitinertial, body.mass, body.ipos, body.inertia = True, 1e-3, [0, 0, 0], [inertia] * 3
    body.add_joint(name="unit_01_x", axis=[1, 0, 0], stiffness=[STIFFNESS, 0, 0], damping=[damping, 0, 0])
    add_elements(spec, joints, ARMATURE)
    return spec.compile()


def torques(model: mujoco.MjModel, angles: np.ndarray) -> np.ndarray:
    """Passive torque on the arm's hinge, N m, while it is led through `angles` (T,), rad, one a step. Shape (T,)."""
    data, result = mujoco.MjData(model), []
    for angle in angles:
        data.qpos[0], data.qvel[0] = angle, 0
        mujoco.mj_forward(model, data)
        result.append(data.qfrc_passive[0])
        mujoco.mj_step(model, data)
    return np.array(result)


@pytest.mark.parametrize("branches", [[(SHARE, TIME)], [(0.3, 0.1), (0.2, 1.0)]])
def test_a_held_joint_relaxes_as_a_standard_linear_solid(branches):
    """Of several branches as the sum of their terms."""
    time, bend = np.arange(2000) * 1e-3, 0.2
    elements = [MaxwellElement(*branch) for branch in branches]
    result = -torques(one_joint(Joints(elements)), np.full(len(time), bend))
    expected = STIFFNESS * bend * (1 + sum(share * np.exp(-time / decay) for share, decay in branches))
    assert np.abs(result / expected - 1).max() < 1e-3


def test_a_loaded_joint_creeps_as_a_standard_linear_solid():
    """From 20 ms on. The solid has no inertia; the hinge has some, and swings at first about where it belongs. That
    dies away with 2 I / D = 2 ms, so after 10 of these to e^-10. A stronger damper would end it sooner, and hold the
    creep back by about D / K, 0.1 % of the relaxation time."""
    inertia, damping, step, torque = 1e-6, 1e-3, 2e-4, 0.1
    model = one_joint(Joints([MaxwellElement(SHARE, TIME)]), inertia, damping)
    model.opt.timestep = step
    data, bends = mujoco.MjData(model), []
    data.qfrc_applied[0] = torque
    for _ in range(round(2 / step)):
        mujoco.mj_step(model, data)
        bends.append(data.qpos[0])
    time = step * np.arange(1, len(bends) + 1)
    expected = torque / STIFFNESS * (1 - SHARE / (1 + SHARE) * np.exp(-time / TIME / (1 + SHARE)))
    settled = time >= 10 * 2 * inertia / damping
    assert np.abs(np.array(bends) / expected - 1)[settled].max() < 1e-3


def test_a_slider_turns_round_and_encloses_an_area_as_an_elastic_plastic_spring():
    model, reach = one_joint(Joints(sliders=[JenkinsElement(SHARE, YIELD)])), 0.2
    quarter = np.linspace(0, reach, 2000)
    cycle = np.concatenate([quarter, quarter[::-1], -quarter, -quarter[::-1]])
    angles = np.concatenate([cycle, cycle])
    extra = -torques(model, angles) - STIFFNESS * angles
    stiffness = SHARE * STIFFNESS
    assert extra[1999] == pytest.approx(stiffness * YIELD, rel=0.005)  # slips, a step late
    back = np.interp(reach - YIELD, angles[3999:1999:-1], extra[3999:1999:-1])
    assert back == pytest.approx(0, abs=0.01 * stiffness * YIELD)  # half way through the reversal
    area = np.trapezoid(extra[8000:], angles[8000:])
    assert area == pytest.approx(4 * stiffness * YIELD * (reach - YIELD), rel=0.01)


def test_several_sliders_add_up_and_each_has_parameters_of_its_own():
    """Iwan: on the way out each bears k x up to its yield, on the way back it turns round by twice that (Masing)."""
    model = one_joint(Joints(sliders=[JenkinsElement(0.1, 0.1)] * 3))
    values = {
        "hysteresis": 0.3, "yield_bend": 0.01, "hysteresis_2": 0.2, "yield_bend_2": 0.03,
        "hysteresis_3": 0.1, "yield_bend_3": 0.1,
    }  # fmt: skip
    set_fields(model, candidate_fields(model, {name: np.array([value]) for name, value in values.items()}))
    shares, yields = np.array(list(values.values())).reshape(3, 2).T
    out = np.linspace(0, 0.2, 4000)
    angles = np.concatenate([out, out[::-1]])
    extra = -torques(model, angles) - STIFFNESS * angles
    way, full = extra[:4000], STIFFNESS * shares * yields
    expected = np.minimum(STIFFNESS * shares * out[:, None], full).sum(axis=1)
    back = (full - np.minimum(STIFFNESS * shares * (0.2 - out[::-1, None]), 2 * full)).sum(axis=1)
    np.testing.assert_allclose(way, expected, atol=0.005 * full.sum())
    np.testing.assert_allclose(extra[4000:], back, atol=0.005 * full.sum())


@pytest.fixture(scope="module")
def pair() -> tuple[mujoco.MjModel, mujoco.MjModel]:
    plain, full = small_spec(), small_spec()
    maxwell = [MaxwellElement(0.3, 0.5), MaxwellElement(0.2, 2.0)]
    add_elements(full, Joints(maxwell, [JenkinsElement(0.2, 0.02)]), ARMATURE)
    return plain.compile(), full.compile()


def test_elements_stand_after_the_arms_own(pair):
    plain, full = pair
    assert ArmModel(full).hinge_count == ArmModel(plain).hinge_count == plain.njnt
    assert ArmModel(full).cables.tolist() == ArmModel(plain).cables.tolist() == list(range(plain.ntendon))
    branches, sliders = ArmModel(full).branches, ArmModel(full).sliders
    assert (len(branches), len(sliders)) == (2, 1)
    for group in (*branches, *sliders):
        np.testing.assert_array_equal(group.hinge, np.arange(plain.njnt))


def test_branches_that_have_given_way_bear_nothing():
    spec, poses = small_spec(), np.random.default_rng(1).uniform(-0.2, 0.2, (2, 3 * 16))
    add_elements(spec, Joints([MaxwellElement(0.3, 0.5), MaxwellElement(0.2, 2.0)]), ARMATURE)
    model = spec.compile()
    arm = ArmModel(model).hinge_count
    ArmModel(model).unload_branches(poses)
    for pose in poses:
        data = mujoco.MjData(model)
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qfrc_passive[arm:], 0, atol=1e-12)
        np.testing.assert_allclose(data.qfrc_passive[:arm], -model.jnt_stiffness[:arm] * pose[:arm], atol=1e-12)


def test_elements_change_nothing_at_rest(pair):
    plain, full = pair
    commands = np.repeat(plain.tendon_length0[None], 2, axis=0)
    commands[1, 0] -= 0.01
    rests = [settle(model, commands, np.array([3.0, 0.0, -9.0])) for model in pair]
    assert all(rest.rested.all() for rest in rests)
    np.testing.assert_allclose(rests[1].position, rests[0].position, atol=1e-8)
    for expected, actual in zip(read_chain(plain), read_chain(full), strict=True):
        np.testing.assert_array_equal(expected, actual)
