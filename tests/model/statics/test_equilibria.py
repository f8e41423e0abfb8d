"""Equilibria: against MuJoCo at rest, against beam theory, and against themselves from the other side."""

import numpy as np
import pytest

from tests.support.bent_chain import cantilever, hardening_stump, rubbing, stump
from tests.support.noisy_trials import with_values
from trunkline.frames import gravity_in_base
from trunkline.kinematics.dataset.sampling import pull_directions
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated, equilibrium, equilibrium_paths, forward
from trunkline.model.statics.sensitivity import sensitivity


@pytest.fixture(scope="module")
def arm():
    return stump()


@pytest.fixture(scope="module")
def chain(arm):
    return read_chain(arm)


def random_pulls(chain, count, seed=0, share=1.0):
    """Tensions of two neighbouring tendons in random proportion, and gravity at random angles up to 120°."""
    rng = np.random.default_rng(seed)
    tensions = pull_directions(chain, rng.uniform(0, 2 * np.pi, count)) * rng.uniform(0, share, (count, 1)) ** 2
    return tensions, gravity_in_base(rng.uniform(0, np.radians(120), count))


@pytest.mark.parametrize("build", [stump, hardening_stump], ids=["plain", "hardening"])
def test_equilibrium_is_where_mujoco_comes_to_rest(build):
    model = build()
    chain = read_chain(model)
    tensions, gravity = random_pulls(chain, 12)
    result = equilibrium(chain, tensions, gravity)
    assert result.converged.all()
    settled = settle(model, result.lengths - tensions / chain.gain, gravity)
    assert settled.rested.all()
    np.testing.assert_allclose(settled.position, result.position, rtol=0, atol=2e-5)
    np.testing.assert_allclose(settled.tensions, tensions, rtol=0, atol=2e-3)


def test_an_arm_on_a_turned_mount_rests_there_in_its_own_frame(arm, chain):
    """As an identified mount is; gravity and tip are then in the frame of the mount, not of the world."""
    turned = with_values(arm, {"mount_tilt_x": 0.1, "mount_twist": -0.2})
    tensions, gravity = random_pulls(chain, 3)
    result = equilibrium(read_chain(turned), tensions, gravity)
    np.testing.assert_allclose(result.position, equilibrium(chain, tensions, gravity).position, atol=1e-9)
    settled = settle(turned, result.lengths - tensions / chain.gain, gravity)
    np.testing.assert_allclose(settled.position, result.position, rtol=0, atol=2e-5)


def test_units_that_bend_further_down_rest_where_mujoco_does(arm, chain):
    lower = with_values(arm, {"joint_place": 0.4})
    tensions, gravity = random_pulls(chain, 6)
    result = equilibrium(read_chain(lower), tensions, gravity)
    settled = settle(lower, result.lengths - tensions / chain.gain, gravity)
    np.testing.assert_allclose(settled.position, result.position, rtol=0, atol=2e-5)
    assert np.linalg.norm(result.position - equilibrium(chain, tensions, gravity).position, axis=1).max() > 1e-3


def test_actuators_saturate_as_mujocos_do(arm, chain):
    commands = chain.straight_lengths - np.array([[0.5, -0.1, -0.1], [0.03, 0.02, -0.1]])
    result = actuated(chain, commands, gravity_in_base(0.5))
    assert result.converged.all()
    assert result.tensions[0, 0] == chain.max_tension[0]
    settled = settle(arm, commands, gravity_in_base(0.5))
    np.testing.assert_allclose(settled.position, result.position, rtol=0, atol=2e-5)


def test_cantilever_sags_as_the_beam_formula_says():
    """Small tip deflection of a discrete rod: Σ_i M_i (L - s_i) / K, M_i the moment of the weight beyond hinge i."""
    units, stiffness, length, mass = 20, 50.0, 0.02, 1e-3
    chain = read_chain(cantilever(units, stiffness, length, mass))
    gravity = np.array([0.0, 9.81, 0.0])
    hinges = np.arange(units) * length
    centers = hinges + length / 2
    moments = [mass * 9.81 * np.maximum(centers - s, 0).sum() for s in hinges]
    expected = np.sum(np.array(moments) / stiffness * (units * length - hinges))
    result = equilibrium(chain, np.zeros((1, 0)), gravity)
    assert result.converged.all()
    assert result.position[0, 1] == pytest.approx(expected, rel=1e-4)
    np.testing.assert_allclose(result.position[0, [0, 2]], [0, -units * length], atol=1e-5)


def test_straight_arm_hangs_straight(chain):
    result = equilibrium(chain, np.zeros((1, 3)), gravity_in_base(0.0))
    np.testing.assert_allclose(result.position[0], [0, 0, -chain.length], atol=1e-12)
    np.testing.assert_allclose(result.quaternion[0], [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(result.lengths[0], chain.straight_lengths, atol=1e-12)


@pytest.mark.parametrize(("friction", "count", "share"), [(0.0, 60, 1.0), (0.3, 40, 0.6)])
def test_lengths_and_commands_lead_back_to_the_same_pose(chain, friction, count, share):
    chain = rubbing(chain, friction)
    tensions, gravity = random_pulls(chain, count, share=share)
    there = equilibrium(chain, tensions, gravity)
    assert there.converged.all()
    assert there.residual.max() < 1e-9
    for back in (forward(chain, there.lengths, gravity), actuated(chain, there.commands, gravity)):
        assert back.converged.all()
        np.testing.assert_allclose(back.position, there.position, rtol=0, atol=1e-7)
        np.testing.assert_allclose(back.tensions, tensions, rtol=0, atol=1e-4)
        assert (back.tensions >= 0).all()


def test_longer_slack_tendon_changes_nothing_and_a_shorter_one_pulls(chain):
    tensions, gravity = np.array([[20.0, 6.0, 0.0]]), gravity_in_base(0.7)
    there = equilibrium(chain, tensions, gravity)
    longer = forward(chain, there.lengths + [0, 0, 0.01], gravity)
    np.testing.assert_allclose(longer.position, there.position, rtol=0, atol=1e-8)
    assert longer.tensions[0, 2] == 0
    np.testing.assert_allclose(longer.lengths[0, 2], there.lengths[0, 2], atol=1e-8)
    shorter = forward(chain, there.lengths - [0, 0, 1e-3], gravity)
    assert shorter.converged.all()
    assert shorter.tensions[0, 2] > 0.01
    np.testing.assert_allclose(shorter.lengths[0], there.lengths[0] - [0, 0, 1e-3], atol=1e-8)


def test_paths_and_single_solves_meet(chain):
    tensions, _ = random_pulls(chain, 8, seed=2)
    path = tensions[:, None] * np.linspace(0.1, 1, 7)[:, None]
    along = equilibrium_paths(chain, path, gravity_in_base(1.0))
    alone = equilibrium(chain, path.reshape(-1, 3), gravity_in_base(1.0))
    np.testing.assert_allclose(along.qpos, alone.qpos, rtol=0, atol=1e-6)
    assert along.iterations.mean() < alone.iterations.mean()


def test_buckled_arm_is_not_called_an_equilibrium(chain):
    """All tendons at full pull press the straight arm together: it balances, but on a knife's edge."""
    result = equilibrium(chain, chain.max_tension[None], np.zeros(3))
    assert result.residual[0] < 1e-9
    assert not result.converged[0]


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_sensitivities_are_differences_of_equilibria(chain, friction):
    chain, tensions, step = rubbing(chain, friction), np.array([[12.0, 5.0, 0.5]]), 1e-4
    gravity = gravity_in_base(0.9)
    here = equilibrium(chain, tensions, gravity)
    slopes = sensitivity(chain, here.qpos, here.tensions, gravity)
    for t in range(3):
        change = step * np.eye(3)[[t]]
        ahead, behind = (equilibrium(chain, tensions + s * change, gravity) for s in (1, -1))
        np.testing.assert_allclose(
            slopes.tip_by_tension[0, :, t], (ahead.position - behind.position)[0] / (2 * step), rtol=1e-4, atol=1e-7
        )
        np.testing.assert_allclose(
            slopes.length_by_tension[0, :, t], (ahead.lengths - behind.lengths)[0] / (2 * step), rtol=1e-4, atol=1e-7
        )


@pytest.mark.parametrize("solve", ["tensions", "lengths"])
def test_results_are_the_same_bits_at_any_thread_count(chain, monkeypatch, solve):
    tensions, gravity = random_pulls(chain, 30, seed=3)
    lengths = equilibrium(chain, tensions, gravity).lengths
    results = []
    for threads in ("1", "2"):
        monkeypatch.setenv("TRUNKLINE_THREADS", threads)
        result = equilibrium(chain, tensions, gravity) if solve == "tensions" else forward(chain, lengths, gravity)
        results.append(result)
    for name, values in vars(results[0]).items():
        assert np.array_equal(values, vars(results[1])[name]), name
