"""Controls as pulls: the same forces, and 0 pulls nothing."""

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import small_spec
from trunkline.unity.pulls import as_pulls, controls, rest_lengths, rounded_up, takes_pulls

RNG = np.random.default_rng(0)


def pair(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    """A model that takes commands, and the same that takes pulls, as their files are read."""
    spec.compile()
    calibrated = spec.to_xml()
    as_pulls(spec)
    spec.compile()
    pulled = spec.to_xml()
    assert "input=" in calibrated
    assert "input=" not in pulled
    return mujoco.MjModel.from_xml_string(calibrated), mujoco.MjModel.from_xml_string(pulled)


def forces(model: mujoco.MjModel, qpos, qvel, commands) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    data.act[:] = controls(model, commands)
    mujoco.mj_forward(model, data)
    return data.actuator_force.copy()


def test_a_pull_is_the_command_that_it_stands_for():
    calibrated, pulled = pair(small_spec())
    assert (takes_pulls(calibrated), takes_pulls(pulled)) == (False, True)
    all_forces = []
    for _ in range(20):
        qpos, qvel = RNG.uniform(-0.3, 0.3, calibrated.nq), RNG.normal(0, 1, calibrated.nv)
        commands = calibrated.tendon_length0 - RNG.uniform(-0.05, 0.05, 3)
        expected = forces(calibrated, qpos, qvel, commands)
        np.testing.assert_allclose(forces(pulled, qpos, qvel, commands), expected, atol=1e-9)
        all_forces.append(expected)
    assert np.min(all_forces) == -80  # saturated
    assert np.max(all_forces) == 0  # slack
    assert np.any((np.array(all_forces) < -1) & (np.array(all_forces) > -79))


def test_nothing_pulls_at_0_and_little_more_would():
    calibrated, pulled = pair(small_spec())
    assert np.all(rest_lengths(pulled) >= calibrated.tendon_length0)
    np.testing.assert_allclose(rest_lengths(pulled), calibrated.tendon_length0, atol=1e-5)
    still = np.zeros(calibrated.nq)
    assert not forces(pulled, still, still, rest_lengths(pulled)).any()
    assert (forces(pulled, still, still, rest_lengths(pulled) - 2e-5) < 0).all()
    assert (forces(calibrated, still, still, np.zeros(3)) == -80).all()  # what 0 was before


def test_a_range_of_commands_becomes_one_of_pulls():
    spec = small_spec()
    for actuator in spec.actuators:
        actuator.ctrllimited, actuator.ctrlrange = mujoco.mjtLimited.mjLIMITED_TRUE, [0.4, 0.52]
    calibrated, pulled = pair(spec)
    expected = rest_lengths(pulled)[:, None] - calibrated.actuator_ctrlrange[:, ::-1]
    np.testing.assert_allclose(pulled.actuator_ctrlrange, expected, atol=1e-6)


@pytest.mark.parametrize(("value", "expected"), [(1100.44, 1100.44), (1100.4401, 1100.45), (0.0, 0.0), (-3.21, -3.21)])
def test_six_digits_are_kept_and_none_is_lost(value, expected):
    assert rounded_up(value) == pytest.approx(expected, abs=1e-9)
