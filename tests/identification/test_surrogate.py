"""The surrogate against residuals that bend by a known law, fitted again by scipy."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from trunkline.identification.fit.linearisation import Linearisation
from trunkline.identification.fit.surrogate import LONGEST, Surrogate, surrogate

TRIALS, ROWS = 6, 40
CURVATURE = 0.6  # of the residuals, beside slopes of about 1 and residuals of about 0.5


@dataclass
class BentResiduals:
    """Six trials of residuals a + B z + z C z; stands in for a `Problem` of two parameters."""

    offsets: np.ndarray
    slopes: np.ndarray
    bends: np.ndarray
    parameters = ("stiffness", "damping")
    trial_weights = np.ones(TRIALS)
    rubs = False

    def residuals(self, vectors, near=None):
        lines = np.einsum("trp,cp->tcr", self.slopes, vectors)
        bends = np.einsum("trpq,cp,cq->tcr", self.bends, vectors, vectors)
        return list(self.offsets[:, None] + lines + bends)

    def minimum(self, weights):
        def weighted(z):
            return np.concatenate([np.sqrt(w) * r[0] for w, r in zip(weights, self.residuals(z[None]), strict=True)])

        return least_squares(weighted, np.zeros(2), jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-14).x

    def jacobians(self, z):
        return list(self.slopes + 2 * np.einsum("trpq,q->trp", self.bends, z))


@dataclass
class Jumping(BentResiduals):
    rng: np.random.Generator

    def residuals(self, vectors, near=None):
        return [block + self.rng.normal(0, 0.02, block.shape) for block in super().residuals(vectors)]


class JumpingBesideAnIdleOne(BentResiduals):
    """Of three parameters the last is in no residual: it moves no jump either."""

    parameters = (*BentResiduals.parameters, "force_range")
    rubs = True

    def residuals(self, vectors, near=None):
        blocks = super().residuals(vectors[:, :2])
        rngs = [np.random.default_rng(np.frombuffer(row.tobytes(), np.uint32)) for row in vectors[:, :2]]
        jumps = np.stack([rng.normal(0, 0.02, (TRIALS, ROWS)) for rng in rngs], axis=1)
        return [block + jump for block, jump in zip(blocks, jumps, strict=True)]


def bent(curvature):
    rng = np.random.default_rng(5)
    bends = curvature * (np.eye(2) + rng.normal(size=(TRIALS, ROWS, 2, 2)))
    offsets = 0.5 + 0.5 * rng.normal(size=(TRIALS, 1)) + 0.1 * rng.normal(size=(TRIALS, ROWS))
    slopes = rng.normal(size=(TRIALS, ROWS, 2)) + 0.3
    return BentResiduals(offsets, slopes, bends + bends.transpose(0, 1, 3, 2))


def around(problem):
    """The minimum, and both answers to weights there: to second order, and to first."""
    vector = problem.minimum(np.ones(TRIALS))
    blocks = [block[0] for block in problem.residuals(vector[None])]
    return vector, surrogate(problem, vector), Linearisation(vector, blocks, problem.jacobians(vector))


def test_trials_left_out_move_the_minimum_as_fits_without_them():
    problem = bent(CURVATURE)
    vector, second_order, first_order = around(problem)
    weights = 1 - np.eye(TRIALS)
    expected = [problem.minimum(row) - vector for row in weights]
    np.testing.assert_allclose(second_order.moves(weights), expected, atol=1e-5)
    assert np.abs(first_order.moves(weights) - expected).max() > 0.2 * np.abs(expected).max()


def test_so_do_random_weights():
    problem = bent(CURVATURE)
    vector, second_order, _ = around(problem)
    weights = np.random.default_rng(1).standard_exponential((50, TRIALS))
    expected = [problem.minimum(row) - vector for row in weights]
    np.testing.assert_allclose(second_order.moves(weights), expected, atol=1e-5)


@pytest.mark.parametrize(("curvature", "share"), [(CURVATURE, 0.75), (0.0, 0.5)])
def test_jumps_of_an_arm_whose_cables_rub_move_it_less(curvature, share):
    """Each candidate sticks and slips in its own way. Around two estimates of nearly the same loss, intervals of the
    smallest design were once 1.3 and 0.1 wide. Where nothing bends, what looks like it are jumps."""
    problem = bent(curvature)
    vector, smooth, _ = around(problem)
    weights, errors = 1 - np.eye(TRIALS), {True: [], False: []}
    expected = smooth.moves(weights)
    for rubs, of_design in errors.items():
        for seed in range(40):
            jumping = Jumping(problem.offsets, problem.slopes, problem.bends, np.random.default_rng(seed))
            jumping.rubs = rubs
            of_design.append(np.square(surrogate(jumping, vector).moves(weights) - expected).mean())
    assert np.sqrt(np.mean(errors[True]) / np.mean(errors[False])) < share


def test_its_normals_are_those_of_the_jacobian():
    problem = bent(CURVATURE)
    for problem.rubs in (False, True):
        _, second_order, first_order = around(problem)
        np.testing.assert_allclose(second_order.normals(), first_order.normals(), rtol=1e-9)
    halved = Surrogate(second_order.grams, np.full(TRIALS, 0.5))
    np.testing.assert_allclose(halved.normals(), first_order.normals() / 2, rtol=1e-9)


def test_of_straight_residuals_first_order_is_all():
    _, second_order, first_order = around(bent(0.0))
    weights = np.random.default_rng(1).standard_exponential((50, TRIALS))
    np.testing.assert_allclose(second_order.moves(weights), first_order.moves(weights), atol=1e-6)


def test_what_no_residual_depends_on_does_not_spoil_the_others():
    problem = bent(CURVATURE)
    problem.slopes[..., 1] = problem.bends[..., 1] = problem.bends[..., 1, :] = 0
    vector, second_order, _ = around(problem)
    weights = 1 - np.eye(TRIALS)
    moves = second_order.moves(weights)
    assert (np.abs(moves[:, 1]) <= LONGEST).all()
    np.testing.assert_allclose(moves[:, 0], [problem.minimum(row)[0] - vector[0] for row in weights], atol=1e-5)


def test_where_cables_rub_it_moves_nowhere():
    """The least-squares fit gave it a slope, from the others' jumps, and the next descent took it to a bound."""
    problem = bent(CURVATURE)
    vector, smooth, _ = around(problem)
    jumping = JumpingBesideAnIdleOne(problem.offsets, problem.slopes, problem.bends)
    three = surrogate(jumping, np.append(vector, 0.0))
    weights = np.concatenate([1 - np.eye(TRIALS), np.ones((1, TRIALS))])
    assert (three.minima(weights)[:, 2] == 0).all()
    np.testing.assert_array_equal(three.determines(np.ones(TRIALS)), [True, True, False])
    error = three.moves(weights)[:, :2] - smooth.moves(weights)
    assert np.abs(error).max() < 0.1 * np.abs(smooth.moves(weights)).max()


def test_seen_from_another_place_losses_and_minima_are_the_same():
    _, surrogate_there, _ = around(bent(CURVATURE))
    place, ahead = np.array([0.05, -0.03]), np.array([[0.0, 0.0], [0.1, 0.2]])
    weights = np.linspace(0.5, 1.0, TRIALS)
    moved = surrogate_there.moved(place, weights)
    np.testing.assert_allclose(moved.losses(ahead), surrogate_there.losses(place + ahead), rtol=1e-9)
    np.testing.assert_allclose(moved.minima(weights[None]) + place, surrogate_there.minima(weights[None]), atol=1e-6)
    np.testing.assert_array_equal(moved.weights, weights)


def test_of_first_order_its_minima_are_those_of_weighted_least_squares():
    rng = np.random.default_rng(5)
    jacobians, residuals = rng.normal(size=(6, 40, 15)), rng.normal(size=(6, 40))
    rows = np.concatenate([residuals[..., None], jacobians], axis=2)  # r + J d = rows @ (1, d)
    first = Surrogate(rows.transpose(0, 2, 1) @ rows, second=False)
    weights = rng.uniform(0.2, 1.0, (3, 6))
    for weight, place_of_one in zip(weights, first.minima(weights), strict=True):
        root = np.sqrt(weight)[:, None]
        stacked = (root[..., None] * jacobians).reshape(-1, 15), -(root * residuals).ravel()
        np.testing.assert_allclose(place_of_one, np.linalg.lstsq(*stacked)[0], atol=1e-8)
    place = rng.normal(size=15)
    recentred = first.moved(place, np.ones(6))
    np.testing.assert_allclose(recentred.losses(np.zeros((1, 15))), first.losses(place[None]))
    np.testing.assert_allclose(recentred.losses(np.ones((1, 15))), first.losses(1 + place[None]))
