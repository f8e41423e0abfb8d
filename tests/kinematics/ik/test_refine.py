"""Lengths made exact by Gauss-Newton, and equilibria from a first guess."""

import numpy as np
import pandas as pd
import pytest

from trunkline.errors import InputError
from trunkline.frames import downwards, gravity_in_base
from trunkline.kinematics.dataset.columns import length_columns
from trunkline.kinematics.dataset.sampling import pull_directions
from trunkline.kinematics.dataset.table import sample_table
from trunkline.kinematics.ik.inputs import TILT
from trunkline.kinematics.ik.refine import refine
from trunkline.kinematics.ik.score import beyond_range, largest_difference, outside_targets
from trunkline.model.statics.equilibria import equilibrium, forward
from trunkline.model.statics.restart import restart


@pytest.fixture(scope="module")
def samples(chain):
    rng = np.random.default_rng(0)
    tables = [sample_table(chain, downwards(tilt, 0.0), 100, 16, 16, rng)[0] for tilt in (0.0, 1.2)]
    return pd.concat(tables, ignore_index=True)


def test_three_steps_undo_an_error_of_a_millimetre(chain, samples):
    targets, lengths = samples[TILT].to_numpy(), samples[length_columns(3)].to_numpy()
    wrong = lengths + np.random.default_rng(1).uniform(-1e-3, 1e-3, lengths.shape)
    before, after = (refine(chain, targets, wrong, steps) for steps in (0, 3))
    assert before.position_error.max() > 0.005 * chain.length
    assert after.converged.all()
    assert np.quantile(after.position_error, 0.95) < 1e-4 * chain.length
    assert (after.position_error <= 1e-3 * chain.length).mean() > 0.97
    assert (after.steps <= 3).all()


def test_polished_lengths_lead_to_the_error_stated(chain, samples):
    targets = samples[TILT].to_numpy()[:20] + [0, 0.002, 0, 0.004, 0, 0, 0, 0]  # a little off the surface of tips
    answer = refine(chain, targets, samples[length_columns(3)].to_numpy()[:20])
    tip = forward(chain, answer.lengths, gravity_in_base(targets[:, 0]))
    np.testing.assert_allclose(np.linalg.norm(tip.position - targets[:, 1:4], axis=1), answer.position_error, atol=1e-7)
    assert (tip.tensions.min(axis=1) < 1e-3).all()
    assert (tip.tensions <= chain.max_tension + 1e-3).all()


def test_exact_lengths_need_no_step(chain, samples):
    answer = refine(chain, samples[TILT].to_numpy(), samples[length_columns(3)].to_numpy())
    assert (answer.steps == 0).all()
    assert answer.position_error.max() < 1e-6


def test_restart_finds_the_equilibrium_that_the_loads_lead_to(chain):
    rng = np.random.default_rng(2)
    tensions = pull_directions(chain, rng.uniform(0, 2 * np.pi, 20)) * rng.uniform(0.05, 0.5, (20, 1))
    gravity = gravity_in_base(rng.uniform(0, 2, 20))
    there = equilibrium(chain, tensions, gravity)
    guess = there.qpos + rng.uniform(-0.05, 0.05, there.qpos.shape)
    rest = restart(chain, guess, np.zeros_like(tensions), there.lengths, gravity)
    assert rest.converged.all()
    np.testing.assert_allclose(rest.position, there.position, atol=1e-7)
    np.testing.assert_allclose(rest.tensions, tensions, atol=1e-4)


def test_far_targets_are_far_and_what_is_beyond_the_range_is_seen():
    targets = outside_targets(2000, 0.5, np.random.default_rng(0), columns=1)
    assert (np.linalg.norm(targets[:, 1:4], axis=1) > 0.5).mean() > 0.9
    np.testing.assert_allclose(np.linalg.norm(targets[:, 4:], axis=1), 1)
    sampled = np.array([[0.3, 0.4], [0.5, 0.6]])
    assert beyond_range(np.array([[0.3, 0.6]]), sampled) == 0
    assert beyond_range(np.array([[0.31, 0.62], [0.29, 0.5]]), sampled) == pytest.approx(0.02)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_answer_that_is_not_finite_is_an_error_of_one_line(value):
    sampled = np.array([[0.3, 0.4], [0.5, 0.6]])
    broken = np.array([[0.3, 0.6], [0.4, value], [0.4, 0.5]])
    with pytest.raises(InputError, match="found 1 of 3 answers of the network that are not finite"):
        beyond_range(broken, sampled)
    for first, second in ((broken, sampled[[0, 0, 1]]), (sampled[[0, 0, 1]], broken), (broken, broken)):
        with pytest.raises(InputError, match="found 1 of 3 answers"):
            largest_difference(first, second)
    assert largest_difference(sampled, sampled + [[0, 0], [0, -2e-3]]) == pytest.approx(2e-3)
