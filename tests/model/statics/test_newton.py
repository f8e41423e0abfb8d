"""When an equilibrium counts: torques and cables in balance, stable, and within the iterations."""

import numpy as np
import pytest

from tests.support.bent_chain import cantilever, stump
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.energy import Pull
from trunkline.model.statics.newton import (
    LENGTH_TOLERANCE,
    MAX_ITERATIONS,
    TORQUE_TOLERANCE,
    find_equilibrium,
    new_work,
)

ASIDE = np.array([3.0, 0.0, -9.0])  # m/s²
UP = np.array([0.0, 0.0, 9.81])
SPRING = 1e5  # N/m, as which Newton feels a cable


@pytest.fixture(scope="module")
def chain():
    return read_chain(stump())


def rest(chain, q, gravity, cables: bool = False, shorter=0.0, tension=None):
    """(residual, stretch, iterations, converged) from angles `q`, which are moved there: with motors at the straight
    arm's lengths, or with cables so much `shorter`, m, that pull with `tension`, N, which becomes what they do."""
    k = chain.tendons
    tension = np.zeros(k) if tension is None else tension
    slope = np.full(k, SPRING) if cables else np.array(chain.gain)
    ceiling = np.full(k, np.inf) if cables else np.array(chain.max_tension)
    lengths = np.array(chain.straight_lengths - np.broadcast_to(shorter, k))
    torque, loose = np.zeros((chain.units, 2)), np.zeros((chain.units, k))
    pull = Pull(tension, slope, lengths, ceiling, torque, chain.capstan, loose)
    return find_equilibrium(chain, q, gravity, pull, cables, new_work(chain.units, k))


@pytest.fixture(scope="module")
def resting(chain):
    q = np.zeros(2 * chain.units)
    assert rest(chain, q, ASIDE)[3]
    return q


@pytest.mark.parametrize(("off", "at_once"), [(0.0, True), (1e-13, True), (1e-5, False), (0.1, False)])
def test_an_arm_out_of_balance_is_brought_into_balance_before_it_counts(chain, resting, off, at_once):
    q = resting + off
    residual, _, iterations, converged = rest(chain, q, ASIDE)
    assert converged
    assert residual <= TORQUE_TOLERANCE
    assert (iterations == 0) is at_once
    np.testing.assert_allclose(q, resting, atol=1e-7)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["angles", "gravity"])
def test_what_is_no_number_never_converges(chain, resting, bad, where):
    q, gravity = resting.copy(), ASIDE.copy()
    (q if where == "angles" else gravity)[0] = bad
    assert not rest(chain, q, gravity)[3]


@pytest.mark.parametrize(
    ("stiffness", "gravity", "converged"),
    [
        (1.0, -UP, True),  # hangs
        (1e-3, -UP, True),
        (10.0, UP, True),  # stands, held by its springs
        (1e-3, UP, False),  # would fall: in balance, as straight as it is, but not stable
        (0.0, UP, False),
    ],
)
def test_balance_alone_is_no_rest(stiffness, gravity, converged):
    """A straight chain along gravity: nothing pushes it to a side."""
    chain = read_chain(cantilever(4, stiffness, 0.4, 0.05))
    residual, stretch, iterations, stable = rest(chain, np.zeros(8), gravity)
    assert (residual, stretch, iterations) == (pytest.approx(0, abs=TORQUE_TOLERANCE), 0.0, 0)
    assert stable is converged


@pytest.mark.parametrize("shorter", [(0.0, 0.0, 0.0), (-0.3, -0.3, -0.3), (0.004, -0.3, -0.3), (0.004, 0.003, -0.3)])
def test_with_cables_lengths_are_in_balance_too(chain, shorter):
    residual, stretch, _, converged = rest(chain, np.zeros(2 * chain.units), -UP, True, np.array(shorter))
    assert converged
    assert residual <= TORQUE_TOLERANCE
    assert stretch <= LENGTH_TOLERANCE


def test_torques_in_balance_by_cables_that_give_are_no_rest(chain):
    """As of springs that are stretched by what they pull: the same pose and torques, but cables do not stretch."""
    q, tension, shorter = np.zeros(2 * chain.units), np.zeros(chain.tendons), np.array([0.004, -0.3, -0.3])
    assert rest(chain, q, -UP, True, shorter, tension)[3]
    assert tension[0] > 0.5
    there, springs = q.copy(), shorter + tension / SPRING
    _, stretch, iterations, converged = rest(chain, q, -UP, True, springs, np.zeros(chain.tendons))
    assert converged
    assert iterations > 0
    assert stretch <= LENGTH_TOLERANCE
    assert np.abs(q - there).max() > 1e-5, "drawn in by what the springs had given"


def test_cables_that_no_pose_has_never_converge(chain):
    """All of them far shorter than the arm can be pressed together."""
    _, stretch, iterations, converged = rest(chain, np.zeros(2 * chain.units), -UP, True, np.full(3, 0.1))
    assert not converged
    assert iterations == MAX_ITERATIONS
    assert stretch > LENGTH_TOLERANCE
