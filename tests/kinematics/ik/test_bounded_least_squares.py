"""Least squares within bounds against every point of a grid, and against scipy."""

import numpy as np
from scipy.optimize import lsq_linear

from trunkline.kinematics.ik.bounded_least_squares import bounded_least_squares


def test_bounded_least_squares_by_brute_force():
    rng = np.random.default_rng(0)
    matrix, wanted, most = rng.normal(size=(40, 6, 2)), rng.normal(size=(40, 6)), np.array([0.4, 0.7])
    grid = np.stack(np.meshgrid(*(np.linspace(0, m, 201) for m in most)), axis=-1).reshape(-1, 2)
    cost = np.linalg.norm(wanted[:, None] - np.einsum("nki,gi->ngk", matrix, grid), axis=2).min(axis=1)
    solution = bounded_least_squares(matrix, wanted, most)
    assert (solution >= 0).all()
    assert (solution <= most).all()
    left = np.linalg.norm(wanted - np.einsum("nki,ni->nk", matrix, solution), axis=1)
    assert (left <= cost + 1e-12).all()
    np.testing.assert_allclose(left, cost, atol=5e-3)


def test_bounded_least_squares_against_scipy():
    rng = np.random.default_rng(1)
    matrix, wanted, most = rng.normal(size=(60, 6, 2)), rng.normal(size=(60, 6)), np.array([0.4, 0.7])
    expected = [lsq_linear(a, b, (0, most), method="bvls").x for a, b in zip(matrix, wanted, strict=True)]
    np.testing.assert_allclose(bounded_least_squares(matrix, wanted, most), expected, atol=1e-9)
