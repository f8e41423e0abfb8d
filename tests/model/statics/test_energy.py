"""The energy's derivatives are exact, and its pieces are those of MuJoCo."""

import mujoco
import numpy as np
import pytest

from tests.support.bent_chain import hardening_stump
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics import energy
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.factor import factorize, new_factor, solve
from trunkline.model.statics.limits import limit_energy, limit_torque
from trunkline.model.statics.placement import new_state, place

GRAVITY = np.array([4.0, 1.5, -8.0])


@pytest.fixture(scope="module")
def model():
    return hardening_stump()


@pytest.fixture(scope="module")
def chain(model):
    return read_chain(model)


def bent(chain, seed=0, reach=0.5):
    return np.random.default_rng(seed).uniform(-reach, reach, 2 * chain.units)


def pulls(chain, friction=0.0):
    """One tendon at a fixed tension, one on a spring, one at its ceiling."""
    lengths = chain.straight_lengths
    slope, ceiling = np.array([0.0, 800.0, 800.0]), np.array([np.inf, 1e4, 3.0])
    loose = np.linalg.norm(chain.hole_out - chain.hole_in, axis=2)
    return energy.Pull(
        np.array([4.0, 0.0, 1.0]), slope, lengths - [0.0, 0.05, 0.2], ceiling, np.full((chain.units, 2), 0.01),
        friction, loose,
    )  # fmt: skip


def dense(hessian):
    """The whole matrix from its products of rank r and the blocks of its units. Shape (nq, nq)."""
    upper = np.triu(hessian.left.T @ hessian.right)
    for i, (aa, ab, bb, _) in enumerate(hessian.block):
        upper[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[aa, ab], [0, bb]]
    return upper + np.triu(upper, 1).T


def test_gradient_and_hessian_are_the_derivatives_of_the_energy(chain):
    q, pull, state, step = bent(chain), pulls(chain), new_state(chain.units, 3), 1e-6
    energy.evaluate(chain, q, GRAVITY, pull, state)
    hessian = dense(energy.find_hessian(GRAVITY, pull, state))
    gradient = state.gradient.copy()
    angles = q.reshape(-1, 2)
    beyond = np.stack([*angles.T, angles.sum(axis=1), angles[:, 0] - angles[:, 1]], axis=1)
    below, above = (beyond < chain.limit[..., 0]).any(axis=0), (beyond > chain.limit[..., 1]).any(axis=0)
    assert (below | above).all(), "one of the limits is not passed: the test would miss it"
    for j in range(len(q)):
        ahead, behind = q.copy(), q.copy()
        ahead[j] += step
        behind[j] -= step
        high = energy.evaluate(chain, ahead, GRAVITY, pull, state)
        slope_high = state.gradient.copy()
        low = energy.evaluate(chain, behind, GRAVITY, pull, state)
        slope_low = state.gradient.copy()
        np.testing.assert_allclose(gradient[j], (high - low) / (2 * step), rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(hessian[j], (slope_high - slope_low) / (2 * step), rtol=1e-6, atol=1e-6)


def test_factor_solves_as_a_dense_solver_does(chain):
    q, state, x = bent(chain), new_state(chain.units, 3), np.random.default_rng(3).normal(size=2 * chain.units)
    energy.evaluate(chain, q, GRAVITY, pulls(chain), state)
    hessian, factor = energy.find_hessian(GRAVITY, pulls(chain), state), new_factor(chain.units, 6)
    assert len(hessian.left) == 4, "one tendon is elastic: the test would miss it"
    expected = np.linalg.solve(dense(hessian), x)
    assert factorize(hessian, factor)
    solve(hessian, factor, x)
    np.testing.assert_allclose(x, expected, rtol=1e-10, atol=1e-12)


def test_factor_refuses_exactly_what_is_not_positive_definite(chain):
    state, factor = new_state(chain.units, 3), new_factor(chain.units, 6)
    energy.evaluate(chain, bent(chain), GRAVITY, pulls(chain), state)
    hessian = energy.find_hessian(GRAVITY, pulls(chain), state)
    lowest = np.linalg.eigvalsh(dense(hessian))[0]
    for change, definite in ((-0.999 * lowest, True), (-0.002 * lowest, False)):
        hessian.block[:, [0, 2]] += change
        assert (np.linalg.eigvalsh(dense(hessian))[0] > 0) == definite
        assert factorize(hessian, factor) == definite


@pytest.mark.parametrize("depth", [1e-4, 4e-4, 7e-4, 2e-3, 0.2])
def test_limit_energy_is_the_integral_of_its_torque(chain, depth):
    gain, impedance = chain.limit_gain[1, 0], chain.limit_impedance[1, 0]
    depths = np.linspace(0, depth, 20001)
    torques = [limit_torque(gain, impedance, d)[0] for d in depths]
    assert limit_energy(chain, 1, 0, depth) == pytest.approx(np.trapezoid(torques, depths), rel=1e-6)


def test_lengths_and_their_gradients_are_mujocos(model, chain):
    data, q = mujoco.MjData(model), bent(chain, seed=1)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    state = new_state(chain.units, 3)
    place(chain, q, state)
    np.testing.assert_allclose(state.lengths, data.ten_length[ArmModel(model).cables], rtol=0, atol=1e-14)
    jacobian = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(jacobian, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
    np.testing.assert_allclose(state.jacobian, jacobian[ArmModel(model).cables], rtol=0, atol=1e-14)


def test_passive_torques_are_mujocos(model, chain):
    """Springs and gravity: minus the gradient without tendons, inside the limits."""
    data, q = mujoco.MjData(model), bent(chain, seed=2, reach=0.18)
    model.opt.gravity[:] = GRAVITY
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    nothing = energy.Pull(*np.zeros((4, 3)), np.zeros((chain.units, 2)), 0.0, np.zeros((chain.units, 3)))
    state = new_state(chain.units, 3)
    energy.evaluate(chain, q, GRAVITY, nothing, state)
    torque = data.qfrc_passive - data.qfrc_bias
    np.testing.assert_allclose(-state.gradient, torque, rtol=1e-12, atol=1e-12)


def limit_in_mujoco(model, data, kind):
    """What it is of, and its force f = -R⁻¹ (0 - aref), as MuJoCo has it where acceleration and velocity vanish."""
    mujoco.mj_forward(model, data)
    (row,) = np.flatnonzero(data.efc_type == int(kind))
    return data.efc_id[row], data.efc_D[row] * data.efc_aref[row]


@pytest.mark.parametrize("depth", [1e-4, 0.015, 0.03, 0.2])
def test_limit_torque_is_mujocos_constraint_force_at_rest(model, chain, depth):
    data, joint = mujoco.MjData(model), 5
    data.qpos[joint] = chain.limit[joint // 2, joint % 2, 1] + depth
    limited, expected = limit_in_mujoco(model, data, mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
    assert limited == joint
    gain, impedance = chain.limit_gain[joint // 2, joint % 2], chain.limit_impedance[joint // 2, joint % 2]
    assert limit_torque(gain, impedance, depth)[0] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("depth", [1e-4, 0.015, 0.03, 0.2])
@pytest.mark.parametrize("number", [0, 1])
def test_the_limit_of_a_diagonal_is_mujocos_too(model, chain, number, depth):
    """With the inverse inertia of the tendon, and along both hinges."""
    data, unit = mujoco.MjData(model), 2
    tendon = ArmModel(model).diagonals[number].tendon[unit]
    half = (chain.limit[unit, 2 + number, 1] + depth) / 2
    data.qpos[2 * unit : 2 * unit + 2] = half, (1 - 2 * number) * half
    limited, expected = limit_in_mujoco(model, data, mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON)
    assert limited == tendon
    gain, impedance = chain.limit_gain[unit, 2 + number], chain.limit_impedance[unit, 2 + number]
    assert limit_torque(gain, impedance, depth)[0] == pytest.approx(expected, rel=1e-10)


def test_limit_of_negative_solref_is_mujocos():
    model = hardening_stump()
    model.jnt_solref[:] = [-400.0, -5.0]
    chain, data = read_chain(model), mujoco.MjData(model)
    data.qpos[2] = chain.limit[1, 0, 0] - 0.03
    _, expected = limit_in_mujoco(model, data, mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
    result = limit_torque(chain.limit_gain[1, 0], chain.limit_impedance[1, 0], 0.03)[0]
    assert result == pytest.approx(expected, rel=1e-10)
