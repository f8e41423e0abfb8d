"""How sure the identified parameters are."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from trunkline.identification.search import Linearisation

RESAMPLINGS = 2000


@dataclass
class Certainty:
    """95 % intervals around an estimate z, and how well its directions are determined.

    Attributes:
        standard_error: of each parameter; infinite where nothing depends on it. Shape (P,).
        half_width: of its 95 % interval. Shape (P,).
        correlation: of the estimates. Shape (P, P).
        condition: of the Jacobian with columns of unit length; 1 is ideal.
        weakest: unit vector, in scaled columns, of the direction that the data determine least. Shape (P,).
    """

    standard_error: np.ndarray
    half_width: np.ndarray
    correlation: np.ndarray
    condition: float
    weakest: np.ndarray


def certainty(linear: Linearisation) -> Certainty:
    """Sandwich estimate, clustered by trial: (JᵀJ)⁻¹ (Σ_t g_t g_tᵀ) (JᵀJ)⁻¹ with g_t = J_tᵀ r_t (Liang, Zeger 1986).

    Residuals of one trial hang together (the model is wrong in the same way from frame to frame), so a formula for
    independent ones would promise far too much. Trials are taken as independent, with T - 1 degrees of freedom.

    Args:
        linear: of the residuals, at the estimate.
    """
    residuals, jacobians = linear.residuals, linear.jacobians
    trials = len(residuals)
    normal = sum(j.T @ j for j in jacobians)
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal * np.outer(scale, scale)) * np.outer(scale, scale)
    scores = np.stack([j.T @ r for j, r in zip(jacobians, residuals, strict=True)])
    scores -= scores.mean(axis=0)
    correction = trials / max(trials - 1, 1)
    covariance = inverse @ (scores.T @ scores * correction) @ inverse
    error = np.sqrt(np.maximum(np.diag(covariance), 0))
    safe = np.where(error > 0, error, 1.0)
    error = np.where(np.diag(normal) > 0, error, np.inf)
    singular, directions = np.linalg.eigh(normal * np.outer(scale, scale))
    return Certainty(
        standard_error=error,
        half_width=error * float(student.ppf(0.975, max(trials - 1, 1))),
        correlation=covariance / np.outer(safe, safe),
        condition=float(np.sqrt(singular[-1] / max(singular[0], 1e-300))),
        weakest=directions[:, 0],
    )


def bootstrap(linear: Linearisation, seed: int) -> np.ndarray:
    """95 % intervals of the estimate by giving trials random weights w_t, again and again (Rubin 1981).

    Each draw is answered by one Gauss-Newton step from the estimate, -(Σ w_t J_tᵀ J_t)⁻¹ Σ w_t J_tᵀ r_t. It
    cross-checks `certainty`: it takes no symmetry for granted, but is too narrow for a handful of trials.

    Returns:
        Lowest and highest z, infinite where nothing depends on a parameter. Shape (2, P).
    """
    trials = len(linear.residuals)
    normals = np.stack([j.T @ j for j in linear.jacobians])
    scores = np.stack([j.T @ r for j, r in zip(linear.jacobians, linear.residuals, strict=True)])
    weights = np.random.default_rng(seed).standard_exponential((RESAMPLINGS, trials))
    scores = scores - scores.mean(axis=0)  # at the estimate they sum to nothing, but for a search that stopped early
    sums = np.einsum("bt,tpq->bpq", weights, normals)
    steps = -np.einsum("bpq,bq->bp", np.linalg.pinv(sums, hermitian=True), weights @ scores)
    interval = linear.vector + np.percentile(steps, [2.5, 97.5], axis=0)
    blind = np.diag(normals.sum(axis=0)) == 0
    return np.where(blind, [[-np.inf], [np.inf]], interval)


def weakest_in_words(names: list[str], weakest: np.ndarray) -> str:
    """The weakest direction as a sentence on the parameters that take part in it."""
    order = np.argsort(-np.abs(weakest))
    if len(names) == 1 or np.abs(weakest[order[1]]) < 0.3:
        return f"{names[order[0]]} is determined least"
    first, second = names[order[0]], names[order[1]]
    same = weakest[order[0]] * weakest[order[1]] > 0
    return f"{first} and {second} {'rise together' if same else 'trade off'}"
